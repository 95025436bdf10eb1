"""`pcsr sensor read`: contact points from images of a calibrated tactile sensor."""

from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE
from pcsr.cli.sensor_images import check_distinct, echo_reasons, image_files, name_of, reason
from pcsr.errors import UserError

if TYPE_CHECKING:
    from pcsr.sensors import Reading

HEADS = ("image", "points", "indentation mm", "contact mm²", "error mm", "at the edge")
"""Heads of the table."""


@click.command()
@click.argument("images", nargs=-1, required=True, type=FILE, metavar="IMAGE...")
@click.option(
    "--background", required=True, type=FILE, metavar="FILE", help="Image of the untouched gel, of the same time."
)
@click.option("--calibration", "calibration_file", required=True, type=FILE, metavar="FILE", help="Calibration.")
@click.option(
    "-o",
    "--out",
    type=FILE,
    required=True,
    metavar="PATH",
    help="Cloud of the contact points: a file for one image, by its suffix; a folder for several.",
)
@click.option(
    "--preview",
    type=FILE,
    metavar="PATH",
    help="Draw the image, the indentation and the contact: a .png for one image, a folder for several.",
)
def read(images: tuple[Path, ...], background: Path, calibration_file: Path, out: Path, preview: Path | None) -> None:
    """Compute the contact points of images of a tactile sensor.

    IMAGE is a camera image of a touch, or a folder of them. The points are in mm, in the frame of the sensor: x to the
    right of the image, y up, z out of the object into the gel, the origin at the centre of the untouched gel. The
    column error has the expected error of each point, as a standard deviation. Of a contact at the edge of the image a
    part may be out of view.

    \b
    pcsr sensor read touch.png --background rest.png --calibration mini.json -o touch.ply --preview touch-seen.png
    """  # noqa: D301 (click's mark is the letter itself)
    from pcsr.clouds.cloud import Cloud
    from pcsr.clouds.formats import CLOUD_WRITERS, write_cloud
    from pcsr.files import write_bytes
    from pcsr.progress import progress_bars
    from pcsr.sensors import Calibration, read_rgb
    from pcsr.sensors.background import doubt

    calibration, rest = Calibration.load(calibration_file), read_rgb(background)
    calibration.check_background(rest, f"--background {background}")
    if remark := doubt(rest, calibration.background, f"--background {background}", calibration.sensor):
        click.echo(remark, err=True)
    files = image_files(images, "IMAGE", [background])
    check_distinct(files)
    several = len(files) > 1 or images[0].is_dir()
    inputs = [*files, background, calibration_file]
    clouds = _targets("-o", out, files, CLOUD_WRITERS, ".ply", inputs, several=several)
    pictures = (
        [] if preview is None else _targets("--preview", preview, files, (".png",), ".png", inputs, several=several)
    )
    rows: list[tuple[str, ...]] = []
    unused: dict[str, str] = {}
    with progress_bars(streams.console(error=True), hidden=not several) as progress:
        task = progress.add_task("reading images", total=len(files))
        for number, file in enumerate(files):
            try:
                image = read_rgb(file)
                reading = calibration.read(image, rest)
            except UserError as error:
                unused[name_of(file)] = reason(error, file)
            else:
                write_cloud(clouds[number], Cloud(reading.points, {"error": reading.errors}))
                if pictures:
                    from pcsr.report.sensors.touch_picture import touch_picture

                    write_bytes(pictures[number], touch_picture(image, reading))
                rows.append(_row(file, reading))
            progress.advance(task)
    echo_reasons(unused, "is skipped")
    if not rows:
        raise UserError(f"none of {len(files)} images can be used: the reasons are above")
    console = streams.console()
    streams.print_table(console, HEADS, rows, HEADS[1:-1])
    places = str(out) if preview is None else f"{out}, pictures: {preview}"
    console.print(f"{len(rows)} of {len(files)} images: {places}", markup=False, highlight=False, soft_wrap=True)


def _row(file: Path, reading: "Reading") -> tuple[str, ...]:
    """Return the row of an image: the error is the root mean square of those of its points."""
    error = float((reading.errors**2).mean() ** 0.5)
    deepest = float(reading.indentation[reading.contact].max())
    edge = "yes" if reading.at_edge else ""
    return name_of(file), str(len(reading.points)), f"{deepest:.2f}", f"{reading.area:.1f}", f"{error:.3f}", edge


def _targets(
    option: str,
    path: Path,
    files: Sequence[Path],
    suffixes: Collection[str],
    suffix: str,
    inputs: Iterable[Path],
    *,
    several: bool,
) -> list[Path]:
    """Return the path to write to for each image, checked before the work.

    Args:
        option: name of the option.
        path: its value.
        files: the images.
        suffixes: suffixes of files that can be written.
        suffix: suffix of the files in a folder.
        inputs: files that must not be replaced.
        several: whether the path is that of a folder.

    Raises:
        UserError: the path is of one file for several images, or of no kind that can be written; two images would be
            written to one file; or an input would be replaced.
    """
    from pcsr.files import check_target

    if path.is_dir() or not path.suffix or (several and path.suffix.lower() not in suffixes):
        targets = [path / f"{file.stem}{suffix}" for file in files]
    elif several:
        raise UserError(f"{option} {path}: it is one file for {len(files)} images: name a folder")
    else:
        targets = [path]
        if path.suffix.lower() not in suffixes:
            raise UserError(f"{option} {path}: name a file with the suffix {', '.join(sorted(suffixes))}, or a folder")
    above = next((one for one in (path, *path.parents) if one.exists()), Path())
    if targets[0] != path and not above.is_dir():
        raise UserError(f"{option} {path}: {above} is a file: name a folder")
    protected = {one.resolve(): one for one in inputs}
    first: dict[Path, Path] = {}
    for file, target in zip(files, targets, strict=True):
        check_target(target)
        if target.resolve() in protected:
            raise UserError(f"{option} {path}: {target} is an input of this command: name another folder or file")
        if first.setdefault(target, file) is not file:
            raise UserError(f"{first[target]} and {file} would both be written to {target}: read them one by one")
    return targets
