"""`pcsr view`: clouds side by side in the browser, as an HTML page, or as a picture."""

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE, columns_option
from pcsr.cli.reasons import echo_skipped
from pcsr.errors import UserError

if TYPE_CHECKING:
    import numpy as np

    from pcsr.clouds.cloud import Cloud
    from pcsr.report.clouds.shown import Named

PIPE = Path("-")
PAGE = Path("view.html")
"""Name of the page where none is given."""
SUFFIXES = (".html", ".htm", ".png")


@click.command()
@click.argument("clouds", nargs=-1, required=True, type=FILE, metavar="FILE...")
@click.option(
    "-o",
    "--out",
    type=FILE,
    default=None,
    metavar="FILE",
    help="Write this page (.html) or picture (.png), open nothing.",
)
@click.option(
    "--color",
    default=None,
    metavar="COLUMN",
    help="Colour by this column; x, y or z; rgb, the clouds' own colours; or none.  "
    "[default: source, else rgb, else z]",
)
@click.option(
    "--before",
    type=FILE,
    default=None,
    metavar="FILE",
    help="Show the points that this cloud has too as old, the others as new.",
)
@click.option("--touch", type=FILE, default=None, metavar="DIR", help="Show these recorded touches too.")
@click.option(
    "--format",
    "suffix",
    default=None,
    help="Format of a pipe and of files whose suffix names none, such as .bin: kitti, nuscenes, colmap, ply …  "
    "[default: ply for pipes and files without a suffix]",
)
@columns_option
def view(
    clouds: tuple[Path, ...],
    out: Path | None,
    color: str | None,
    before: Path | None,
    touch: Path | None,
    suffix: str | None,
    columns: str | None,
) -> None:
    """Show clouds side by side in the browser.

    FILE is the file of a cloud, or - for a pipe. One camera turns around all clouds. Writes the page view.html, which
    needs no network, and opens it. Without a desktop it says where the page is. A column called source (0 old, 1 new, 2
    touched), or --before, sets the colours of old, new and touched points. Of a large cloud 200,000 points are shown,
    drawn at random.

    \b
    pcsr view scan.ply dense.ply --before scan.ply
    pcsr view scan.las --color classification -o scan.png
    """  # noqa: D301 (click's mark is the letter itself)
    from pcsr.clouds.formats import TEXT_READERS
    from pcsr.clouds.formats.format_table import named_by
    from pcsr.extras import require

    path = _target(out)
    require({"matplotlib": "a picture"} if path.suffix.lower() == ".png" else {"plotly": "the viewer"})
    if list(clouds).count(PIPE) > 1:
        raise UserError("- is given twice, and there is one standard input: give it once")
    files = [*clouds, *([] if before is None else [before])]
    if suffix is not None and all(map(named_by, files)):
        raise UserError(f"--format {suffix[:80]}: the suffixes of all clouds name their formats: leave it out")
    if columns is not None and not any(_format(file, suffix) in TEXT_READERS for file in files):
        raise UserError(f"--columns {columns[:200]}: no cloud is text, whose columns it could name: leave it out")
    read = [_read(one, suffix, columns) for one in clouds]
    old = None if before is None else _read(before, suffix, columns)
    touches = _touches(touch)
    from pcsr.files import write_bytes, write_text
    from pcsr.report.clouds.colouring import SOURCE
    from pcsr.report.clouds.shown import scene  # imports torch, so mistakes in files are reported first

    named = _named(clouds, read)
    if old is not None:
        named, color = _with_origin(named, old, str(before)), SOURCE if color is None else color
    seen = scene(named, color, touches)
    if path.suffix.lower() == ".png":
        from pcsr.report.figures.canvas import encoded
        from pcsr.report.figures.clouds_picture import clouds_picture

        write_bytes(path, encoded(clouds_picture(seen), "png"))
    else:
        from pcsr.report.web.clouds_page import clouds_page
        from pcsr.report.web.document import plotly_source

        write_text(path, clouds_page(seen, plotly=plotly_source()))
    for note in seen.notes:
        click.echo(note, err=True)
    for cloud in seen.clouds:
        click.echo(cloud.caption)
    click.echo(f"{path}{'' if out else _opened(path)}")


def _opened(path: Path) -> str:
    """Open the page in a browser, and say so or what to do."""
    from pcsr.cli.browser import open_page

    return (
        ": opened in the browser" if open_page(path) else ": no browser can be opened from here; open this file in one"
    )


def _target(out: Path | None) -> Path:
    """Path to write to, checked before the work.

    Raises:
        UserError: the suffix is unknown, there can be no file, or view.html is not a page of this command.
    """
    from pcsr.files import check_target

    if out is not None:
        if out.suffix.lower() not in SUFFIXES:
            raise UserError(f"-o {out}: a view is written as {', '.join(SUFFIXES)}: give the file such a suffix")
        check_target(out)
        return out
    if not os.access(Path(), os.W_OK):
        return Path(tempfile.mkdtemp(prefix="pcsr-")) / PAGE
    check_target(PAGE)
    if PAGE.exists():
        from pcsr.report.web.clouds_page import MARKER

        with PAGE.open("rb") as file:
            if MARKER.encode() not in file.read(100_000):
                raise UserError(f"{PAGE} exists, and is no page of this command: name another file with -o")
    return PAGE


def _format(path: Path, suffix: str | None) -> str:
    """Return the format of a file or pipe; see `format_of`."""
    from pcsr.clouds.formats.format_table import format_of, named_by, without_suffix

    if suffix is None and without_suffix(path):
        suffix = ".ply"
    return format_of(path, None if named_by(path) else suffix)


def _read(path: Path, suffix: str | None, columns: str | None) -> "Cloud":
    """Read a cloud, without points that are not finite, and say how many there were."""
    from pcsr.clouds.formats import TEXT_READERS, read_cloud, read_cloud_pipe

    kind = _format(path, suffix)
    names = columns if kind in TEXT_READERS else None
    if path == PIPE:
        cloud = read_cloud_pipe(streams.open_input(), kind, "the cloud from the pipe", bad="drop", columns=names)
    else:
        cloud = read_cloud(path, kind, bad="drop", columns=names)
    if dropped := cloud.about.get("dropped"):
        click.echo(f"{path}: {dropped} points are not finite and are not shown", err=True)
    return cloud


def _named(paths: Sequence[Path], clouds: "Sequence[Cloud]") -> "list[Named]":
    """Name clouds by their files, and by their paths where two files have the same name."""
    from pcsr.report.clouds.shown import Named

    names = ["standard input" if path == PIPE else path.name for path in paths]
    names = [str(path) if names.count(name) > 1 else name for path, name in zip(paths, names, strict=True)]
    # A file's name may hold bytes that are no UTF-8, which no page can.
    names = [name.encode("utf-8", "backslashreplace").decode() for name in names]
    return [Named(name, cloud) for name, cloud in zip(names, clouds, strict=True)]


def _with_origin(named: "Sequence[Named]", old: "Cloud", before: str) -> "list[Named]":
    """Mark the points that the old cloud has as old, and the others as new."""
    from pcsr.report.clouds.origin import with_origin
    from pcsr.report.clouds.shown import Named

    marked = []
    for name, cloud in named:
        cloud, count = with_origin(cloud, old)
        if not count:
            click.echo(f"{name}: none of its points is in {before}: is it in another frame or unit?", err=True)
        marked.append(Named(name, cloud))
    return marked


def _touches(folder: Path | None) -> "list[np.ndarray]":
    """Points of each recorded touch; the touches that cannot be used are named."""
    if folder is None:
        return []
    from pcsr.recorded import read

    recording = read(folder)
    echo_skipped(recording)
    return [touch.points for touch in recording.touches]
