"""`pcsr recorded check`: a table of the touches of a recording, and what is odd about it."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE
from pcsr.cli.reasons import skipped_lines
from pcsr.errors import UserError, printable

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float

PAGES = (".html", ".htm")


@click.command()
@click.argument("folder", type=FILE, metavar="DIR")
@click.option(
    "--cloud",
    "cloud_file",
    type=FILE,
    default=None,
    metavar="FILE",
    help="Cloud that belongs to the touches, in their frame and unit: the table has the distances from it.",
)
@click.option(
    "--page", type=FILE, default=None, metavar="FILE", help="Write an HTML page with pictures of the touches."
)
def check(folder: Path, cloud_file: Path | None, page: Path | None) -> None:
    """Check a recording, and show what its touches hold.

    DIR is the folder of a recording. The table has the number of points of each touch, the depth to which they reach
    into the gel, the area of the contact and the position of the sensor in the object's unit. Below it are the touches
    that cannot be used, and what is odd about the others. If one cannot be used the exit code is 2.
    """
    from pcsr.recorded import MANIFEST, read
    from pcsr.report.recording.facts import NUMBERS, table, touch_facts
    from pcsr.report.recording.remarks import remarks, unusable

    _check_page(page)
    cloud = None if cloud_file is None else _cloud(cloud_file)
    recording = read(folder)
    facts = touch_facts(recording, cloud)
    heads, rows = table(facts, recording.touches[0].unit)
    console = streams.console()
    streams.print_table(console, heads, rows, NUMBERS)
    useless = {} if cloud is None else unusable(recording, cloud)
    lines = skipped_lines(recording)
    lines += [f"touch {name} cannot be used with {cloud_file}: it {reason}" for name, reason in useless.items()]
    odd = [*lines, *remarks(recording, facts, cloud)]
    for line in odd:
        console.print(printable(line, lines=False), style="yellow", markup=False, highlight=False, soft_wrap=True)
    if page is not None:
        from pcsr.files import write_text
        from pcsr.report.web.recording_page import recording_page

        place = folder.parent if folder.name == MANIFEST else folder
        write_text(page, recording_page(place.resolve().name, recording, facts, odd))
        console.print(f"pictures: {page}", markup=False, highlight=False, soft_wrap=True)
    count = len(recording.touches) + len(recording.skipped)
    unfit = len(recording.skipped) + len(useless)
    if unfit:
        raise UserError(f"{unfit} of {count} touches cannot be used: the reasons are listed above")
    error = recording.pose_error
    stated = "" if error is None else f", with an error of {error.position:g} mm and {error.rotation:g} degrees"
    console.print(f"{folder}: all {count} touches can be used{stated}", markup=False, highlight=False, soft_wrap=True)


def _check_page(page: Path | None) -> None:
    """Check that the page can be written, before the work."""
    from pcsr.files import check_target

    if page is None:
        return
    if page.suffix.lower() not in PAGES:
        raise UserError(f"--page {page}: a page is written as HTML: name a file with the suffix .html")
    check_target(page)


def _cloud(path: Path) -> "Float[np.ndarray, 'n 3']":
    from pcsr.clouds.faults import screen
    from pcsr.clouds.formats import read_cloud

    return screen(read_cloud(path, bad="keep"), "refuse", str(path)).points
