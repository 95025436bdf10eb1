"""`pcsr touch next`: poses at which the finger should touch next."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE, columns_option, complete_part, plugin_option
from pcsr.errors import UserError

if TYPE_CHECKING:
    from pcsr.clouds.faults import Bad
    from pcsr.exploration.choosing import NextTouches
    from pcsr.plugins.registry import Registry


@click.command("next")
@click.argument("cloud", type=FILE)
@click.option("--touch", "folder", type=FILE, default=None, metavar="DIR", help="Folder of the touches so far.")
@click.option("--touch-as-is", "as_is", is_flag=True, help="Use the touches where they were reported.")
@click.option(
    "--count", type=click.IntRange(1, 100), default=5, show_default=True, metavar="N", help="Number of poses."
)
@click.option(
    "-o",
    "--out",
    "outs",
    multiple=True,
    type=FILE,
    metavar="FILE",
    help="Write the poses to this .json or .ply file. May be repeated.",
)
@click.option(
    "--sensor", default="digit", show_default=True, metavar="NAME", help="Preset of the sensor, such as gelsight-mini."
)
@click.option(
    "--policy",
    default="expected-error",
    show_default=True,
    metavar="NAME",
    shell_complete=complete_part("policy"),
    help="Policy that chooses among the poses.",
)
@click.option(
    "--camera",
    type=float,
    nargs=3,
    default=None,
    metavar="X Y Z",
    help="Position of the camera, in the frame and unit of the cloud.  [default: estimated]",
)
@click.option("--all-around", is_flag=True, help="The cloud shows the object from all sides: guess no far side.")
@click.option(
    "--unit",
    default=None,
    metavar="UNIT",
    help="Unit of the cloud: mm, m, or its length in mm.  [default: that of the touches, else mm]",
)
@click.option(
    "--candidates",
    type=click.IntRange(1, 10_000),
    default=None,
    metavar="N",
    help="Points of the surface at which poses are tried.  [default: 160]",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, metavar="N", help="Seed of the poses.")
@click.option(
    "--frame", default="object", show_default=True, metavar="NAME", help="Frame of the cloud, for ROS in the JSON file."
)
@click.option(
    "--bad",
    type=click.Choice(["refuse", "drop", "keep"]),
    default="refuse",
    show_default=True,
    help="Treatment of points that are not finite, of sentinels and of far outliers. refuse: an error; drop and keep: "
    "they are not used.",
)
@columns_option
@click.option(
    "--format", "suffix", default=None, help="Format of CLOUD, whatever its suffix.  [default: by the suffix]"
)
@plugin_option
def next_(
    cloud: Path,
    folder: Path | None,
    as_is: bool,
    count: int,
    outs: tuple[Path, ...],
    sensor: str,
    policy: str,
    camera: tuple[float, float, float] | None,
    all_around: bool,
    unit: str | None,
    candidates: int | None,
    seed: int,
    frame: str,
    bad: "Bad",
    columns: str | None,
    suffix: str | None,
    registry: "Registry",
) -> None:
    """Find the poses at which the next touches lower the error of the upsampled cloud most.

    CLOUD is a file of points that a camera saw, in the frame of the touches. Each pose is where the face of the sensor
    should come to rest; the finger approaches along the normal. On the far side of a cloud that was seen from
    one side, the surface is guessed.

    \b
    pcsr touch next scan.ply -o next.json
    pcsr touch next scan.ply --touch touches/ --sensor gelsight-mini --unit m -o next.json -o next.ply
    """  # noqa: D301 (click's mark is the letter itself)
    from pcsr.cli.reasons import echo_skipped
    from pcsr.clouds.faults import screen
    from pcsr.clouds.formats import read_cloud
    from pcsr.exploration.next import CANDIDATES, fingertip_of, next_touches
    from pcsr.exploration.writing import check_suffix, write_next
    from pcsr.files import check_target
    from pcsr.progress import progress_bars
    from pcsr.recorded import read

    if cloud.is_dir():
        raise UserError(f"{cloud} is a folder: name the file of the cloud")
    if as_is and folder is None:
        raise UserError("--touch-as-is: it is about the touches of --touch, which is not given")
    for out in outs:
        check_suffix(out)
        check_target(out)
        if out.resolve() == cloud.resolve():
            raise UserError(f"-o {out}: that is the cloud itself: name another file")
    chooser = registry.get("policy", policy)()
    points = screen(read_cloud(cloud, suffix, bad="keep", columns=columns), bad, str(cloud))
    if folder is not None:
        echo_skipped(read(folder))
    with progress_bars(streams.console(error=True), hidden=False) as progress:
        task = progress.add_task("poses", total=count)
        found = next_touches(
            points,
            () if folder is None else folder,
            count=count,
            sensor=fingertip_of(sensor, registry),
            policy=chooser,
            camera=camera,
            all_around=all_around,
            unit=unit,
            candidates=CANDIDATES if candidates is None else candidates,
            seed=seed,
            touch_as_is=as_is,
            advance=lambda done, total: progress.update(task, completed=done),
        )
    _show(found, given=camera is not None)
    for out in outs:
        if out.suffix.lower() == ".ply" and len(found) == 0:
            click.echo(f"{out} is not written: there is no pose")
            continue
        write_next(out, found, frame)
        click.echo(f"{out}: {_poses(found)}")


def _poses(found: "NextTouches") -> str:
    return "1 pose" if len(found) == 1 else f"{len(found)} poses"


def _show(found: "NextTouches", *, given: bool) -> None:
    """Print a line for each pose, why there are fewer than were asked for, and behind which side a far one is guessed.

    Args:
        found: the poses.
        given: whether the position of the camera was given.
    """
    for index, touch in enumerate(found):
        x, y, z = touch.pose[:3, 3]
        gain = "" if touch.gain is None or touch.share is None else f", -{touch.share:.1%} ({touch.gain:.3g} mm²)"
        where = ", on a guessed side" if touch.guessed else ""
        click.echo(f"{index}: at {x:.5g} {y:.5g} {z:.5g}{gain}, contact of {touch.contact_area:.0f} mm²{where}")
    if found.towards is not None and not given:
        x, y, z = found.towards
        click.echo(
            f"The cloud seems to be seen from one side, direction {x:.2f} {y:.2f} {z:.2f}: its far side is guessed. If "
            f"it shows all sides, give --all-around; if you know where the camera was, --camera."
        )
    if found.reason:
        click.echo(f"{_poses(found)}: {found.reason}")
