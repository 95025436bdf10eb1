"""`pcsr recorded import`: write the touches in a ROS bag as a recording."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE, OUTPUT_FOLDER, Number
from pcsr.cli.streaming import stages
from pcsr.cli.touch_options import pose_error_option
from pcsr.cli.warnings_shown import yellow_warnings
from pcsr.errors import UserError, printable

if TYPE_CHECKING:
    from pcsr.clouds.pose_error import PoseError
    from pcsr.recorded.bags.importing import ImportedTouch
    from pcsr.ros.bag import Bag


HEADS = ("touch", "points", "depth mm", "position m", "quaternion x y z w")
"""Heads of the table."""


class _Times(click.ParamType[tuple[float, ...]]):
    """Click type of times in seconds, with commas between them."""

    name = "t1,t2,…"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Return the times."""
        if isinstance(value, tuple):
            return value
        try:
            return tuple(float(word) for word in str(value).split(","))
        except ValueError:
            from pcsr.validation_messages import shown

            raise UserError(f"--at {shown(str(value))}: it must be times in seconds, as in --at 3.2,7.85") from None


@click.command("import")
@click.argument("bags", nargs=-1, required=True, type=FILE, metavar="BAG...")
@click.option("--touch", "topic", required=True, metavar="TOPIC", help="Topic of the tactile sensor.")
@click.option(
    "--pose",
    required=True,
    metavar="FRAME|TOPIC",
    help="Frame of the sensor in tf, in which its messages are; or a topic of geometry_msgs/PoseStamped.",
)
@click.option(
    "--object-frame",
    metavar="FRAME",
    help="Frame of the object, or of its cloud.  [default: the frame of the poses, if they are a topic]",
)
@click.option(
    "-o", "--out", "folder", required=True, type=OUTPUT_FOLDER, metavar="DIR", help="Folder of the recording."
)
@click.option(
    "--at",
    type=_Times(),
    default=(),
    metavar="T1,T2,…",
    help="Times of the touches, in seconds since the start of the bag or as stamps.  [default: where the gel is "
    "deepest in each contact]",
)
@click.option(
    "--axes",
    type=click.Choice(["-z", "+z", "-x", "+x", "-y", "+y"]),
    default=None,
    help="Axis of its frame along which the sensor looks.  [default: +z for images, -z for clouds]",
)
@click.option(
    "--face",
    type=float,
    default=None,
    metavar="MM",
    help="Distance along that axis from the frame's origin to the gel's face; needed for depth images.  [default: 0]",
)
@click.option(
    "--contact-above",
    type=click.FloatRange(0),
    default=None,
    metavar="MM",
    help="Indentation from which on there is contact.  [default: 0.4 of the greatest for depth images; clouds are "
    "used whole]",
)
@click.option(
    "--camera-info",
    metavar="TOPIC",
    help="Topic of the intrinsics of depth images.  [default: camera_info beside the topic]",
)
@click.option("--calibration", type=FILE, metavar="FILE", help="Calibration of the sensor of images in colour.")
@click.option(
    "--background",
    metavar="FILE|TIME",
    help="Image of the untouched gel: a file, or a time as for --at.  [default: the first image in colour; depth "
    "images are compared with --face]",
)
@click.option("--sensor", "name", metavar="NAME", help="Name of the sensor.  [default: the topic's]")
@click.option(
    "--max-gap",
    type=Number(0, 60),
    default=0.1,
    show_default=True,
    metavar="S",
    help="Longest time from a touch to the nearest transform or pose, in seconds.",
)
@pose_error_option("none in the recording, which means 1,2")
@click.option("--overwrite", is_flag=True, help="Replace a recording that exists in DIR.")
def import_(
    bags: tuple[Path, ...],
    topic: str,
    pose: str,
    object_frame: str | None,
    folder: Path,
    at: tuple[float, ...],
    axes: Any,
    face: float | None,
    contact_above: float | None,
    camera_info: str | None,
    calibration: Path | None,
    background: str | None,
    name: str | None,
    max_gap: float,
    pose_error: "PoseError | None",
    overwrite: bool,
) -> None:
    """Write the touches in a ROS bag as a recording.

    BAG is a file of ROS 1 (.bag) or ROS 2 (.mcap, .db3), or a folder of ROS 2; several are read as one. TOPIC has
    contact clouds (PointCloud2), depth images (Image 32FC1, 16UC1) or images in colour (Image rgb8, bgr8, or
    CompressedImage). Of each contact the deepest message becomes a touch. The recording is in metres.

    \b
    pcsr recorded import scan.mcap --touch /digit/points --pose digit --object-frame camera -o touches/
    """  # noqa: D301 (click's mark is the letter itself)
    from pcsr.progress import progress_bars
    from pcsr.recorded.bags.importing import ImportOptions, import_touches
    from pcsr.recorded.bags.opening import Sensor
    from pcsr.ros.bag import Bag

    console, errors = streams.console(), streams.console(error=True)
    sensor = Sensor(axes, face, contact_above, camera_info, calibration, background)
    options = ImportOptions(topic, pose, object_frame, sensor, name, at, max_gap, pose_error, overwrite)
    with Bag(bags) as bag:
        with yellow_warnings(errors), progress_bars(errors, hidden=False) as progress:
            touches = import_touches(bag, folder, options, stages(progress))
        streams.print_table(console, HEADS, [_cells(one) for one in touches], HEADS[1:3])
        next_step = f"next: pcsr upsample {_scan(bag, bags, topic)} --touch {shlex.quote(str(folder))} -o dense.ply"
        for line in (f"{folder}: {len(touches)} touches, in metres", next_step):
            console.print(printable(line, lines=False), markup=False, soft_wrap=True)


def _cells(touch: "ImportedTouch") -> list[str]:
    """Return the cells of a touch in the table."""
    from scipy.spatial.transform import Rotation

    position = " ".join(f"{value:.4f}" for value in touch.pose[:3, 3])
    quaternion = " ".join(f"{value:.4f}" for value in Rotation.from_matrix(touch.pose[:3, :3]).as_quat())
    return [touch.name, str(len(touch.points)), f"{touch.pressed.depth:.2f}", position, quaternion]


def _scan(bag: "Bag", bags: Sequence[Path], touch_topic: str) -> str:
    """Return the cloud to upsample: the only topic with clouds beside that of the touches, or a word in its place."""
    from pcsr.ros.point_clouds import POINT_CLOUD

    names = [one.name for one in bag.topics.values() if one.type == POINT_CLOUD and one.count]
    names = [name for name in names if name.strip("/") != touch_topic.strip("/")]
    return shlex.quote(f"{bags[0]}:{names[0]}") if len(names) == 1 and len(bags) == 1 else "SCAN"
