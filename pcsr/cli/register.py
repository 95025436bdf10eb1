"""`pcsr register`: register touches to a cloud, and write the corrected touches as a recording."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE, OUTPUT_FOLDER, columns_option
from pcsr.cli.registered import RegistrationOutput
from pcsr.cli.touch_options import POSE_ERROR, REPORT, TouchOptions
from pcsr.cli.warnings_shown import yellow_warnings
from pcsr.errors import RunError, UserError

if TYPE_CHECKING:
    from pcsr.clouds.faults import Bad
    from pcsr.clouds.pose_error import PoseError
    from pcsr.recorded import Recording
    from pcsr.registration import Registration


@click.command()
@click.argument("cloud", type=FILE)
@click.option("--touch", "folder", type=FILE, required=True, metavar="DIR", help="Folder of recorded touches.")
@click.option(
    "-o",
    "--out",
    type=OUTPUT_FOLDER,
    default=None,
    metavar="DIR",
    help="Write the corrected touches to this folder as a recording, without refused ones.",
)
@POSE_ERROR
@REPORT
@click.option(
    "--bad",
    type=click.Choice(["refuse", "drop"]),
    default="refuse",
    show_default=True,
    help="Treatment of points of CLOUD that are not finite, of sentinels such as many points at 0 0 0, and of far "
    "outliers. refuse: register nothing; drop: leave them out.",
)
@columns_option
@click.option(
    "--format",
    "suffix",
    default=None,
    help="Format of CLOUD, whatever its suffix: ply, xyz, kitti, nuscenes, colmap …  [default: by the suffix]",
)
@click.option("--overwrite", is_flag=True, help="Replace a recording that exists in the folder of -o.")
def register(
    cloud: Path,
    folder: Path,
    out: Path | None,
    pose_error: "PoseError | None",
    report: Path | None,
    bad: "Bad",
    columns: str | None,
    suffix: str | None,
    overwrite: bool,
) -> None:
    """Register touches to a cloud and report the error of the arm.

    CLOUD is a file of points that a camera or scanner saw, in the frame and unit of the touches. The table says of each
    touch how far it is moved, by how many points of the cloud, and the error that is left. The offset that all touches
    share corrects the arm.
    """
    from pcsr.clouds.faults import screen
    from pcsr.clouds.formats import read_cloud
    from pcsr.progress import progress_bars
    from pcsr.registration import Registration
    from pcsr.registration.report import sentences

    touch = TouchOptions(folder, pose_error, as_is=False, report=report)
    touch.check([cloud], [] if out is None else [out])
    _check_folder(out, folder, overwrite=overwrite)
    console, errors = streams.console(), streams.console(error=True)
    with yellow_warnings(errors):
        points = screen(read_cloud(cloud, suffix, bad="keep", columns=columns), bad, str(cloud)).points
    recording = touch.read()
    output = RegistrationOutput(recording, console, report, most=None)
    with progress_bars(errors, hidden=False) as progress:
        registration = output.register(points, progress, as_is=False)
    assert isinstance(registration, Registration)
    for sentence in sentences(registration, points, recording.touches[0].unit):
        console.print(sentence, markup=False, highlight=False, soft_wrap=True)
    if out is not None:
        _write(out, recording, registration, overwrite=overwrite)


def _check_folder(out: Path | None, folder: Path, *, overwrite: bool) -> None:
    """Check that the corrected recording can be written, before the work.

    Raises:
        UserError: its folder is that of the recording, or holds another one.
    """
    from pcsr.recorded import MANIFEST

    if out is None:
        return
    given = folder.parent if folder.name == MANIFEST else folder
    if out.resolve() == given.resolve():
        raise UserError(f"-o {out}: that is the recording itself, which stays as it is: name another folder")
    if (out / MANIFEST).exists() and not overwrite:
        raise UserError(f"{out} holds a recording already: choose another folder, or overwrite it (--overwrite)")


def _write(out: Path, recording: "Recording", registration: "Registration", *, overwrite: bool) -> None:
    """Write the touches that are not refused, with the error that is left.

    Raises:
        RunError: all touches are refused, or a file cannot be written.
    """
    from pcsr.recorded import write
    from pcsr.registration.report import remaining_error

    pairs = zip(recording.names, registration.touches, strict=True)
    kept = {name: one.touch for name, one in pairs if one.verdict != "refused"}
    if not kept:
        raise RunError(f"{out} is not written: all {len(recording.touches)} touches are refused")
    error = remaining_error(registration)
    write(out, list(kept.values()), list(kept), overwrite=overwrite, pose_error=error)
    click.echo(f"{out}: {len(kept)} of {len(recording.touches) + len(recording.skipped)} touches, corrected")
