"""`pcsr upsample` of one half of a ball, with camera images of a tactile sensor pressed onto the other half.

python benchmarks/pressed_ball.py PRESS… --background FILE --ball 6.31 --mm-per-pixel 0.0634 [--touches 6]

The presses are real images of a ball of known diameter. Of those whose contact keeps away from the edge of the image,
some at equal steps in the order of their names are held out as touches; all others calibrate the sensor. The
camera's cloud is made up: 600 random points of the upper half. So are the poses: each held-out press is put onto the
lower half with the ball that fits its points best at the origin.
Printed is how far new points of the part that the camera does not see lie from the ball.
"""

import json
import shutil
import tempfile
from pathlib import Path

import click
import numpy as np
from click.testing import CliRunner
from jaxtyping import Float
from scipy.spatial import cKDTree

from pcsr import cli
from pcsr.clouds.formats import read_points, write_points
from pcsr.errors import PcsrError
from pcsr.sensors import Calibration, PressImage, calibrate, gel, read_rgb
from pcsr.sensors.balls import fitted_ball

POINTS, RATE = 600, 4
LOWEST = -0.1
"""Height of the lowest point that the camera sees, in radii of the ball."""
TILT = 0.6
"""Height of the touches' directions below the horizon, as the sine of the angle."""
MARGIN = 8
"""Pixels that a contact keeps from the edge of the image."""
APART = 0.5
"""A part of the surface is bare if no point is closer, in mm."""


def sphere(count: int) -> Float[np.ndarray, "n 3"]:
    """Directions that are spread evenly (Fibonacci lattice)."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.arange(count) * np.pi * (3 - 5**0.5)
    return np.column_stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z])


def directions(count: int) -> Float[np.ndarray, "n 3"]:
    """Directions of touches: one from below, the others around it."""
    angle = np.arange(count - 1) * 2 * np.pi / max(1, count - 1)
    level = np.sqrt(1 - TILT**2)
    around = np.column_stack([level * np.cos(angle), level * np.sin(angle), np.full(count - 1, -TILT)])
    return np.vstack([[0.0, 0.0, -1.0], around])


def in_view(calibration: Calibration, image: Path, background: Path) -> bool:
    """Whether the contact of a press does not come close to the edge of the image."""
    contact = calibration.read(read_rgb(image), read_rgb(background)).contact
    return not (
        contact[:MARGIN].any() or contact[-MARGIN:].any() or contact[:, :MARGIN].any() or contact[:, -MARGIN:].any()
    )


def pose(calibration: Calibration, image: Path, background: Path, ball: float, z: Float[np.ndarray, "3"]) -> list:
    """Pose of a press whose finger comes from direction z, and whose ball is at the origin."""
    reading = calibration.read(read_rgb(image), read_rgb(background))
    centre = fitted_ball(reading.points, ball / 2)
    x = np.cross(z, [0.3, 0.5, 0.8])
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    matrix[:3, 3] = -matrix[:3, :3] @ centre
    return matrix.tolist()


@click.command()
@click.argument("presses", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path))
@click.option("--background", required=True, type=click.Path(exists=True, path_type=Path))
@click.option("--ball", required=True, type=float, help="Diameter of the ball in mm.")
@click.option("--mm-per-pixel", required=True, type=float)
@click.option("--sensor", default="gelsight-mini", show_default=True)
@click.option("--touches", default=6, show_default=True)
@click.option("--first", default=0, show_default=True, help="Index of the first held-out press.")
@click.option("--keep", type=click.Path(path_type=Path), help="Folder for the cloud, the recording and the result.")
def main(
    presses: tuple[Path, ...],
    background: Path,
    ball: float,
    mm_per_pixel: float,
    sensor: str,
    touches: int,
    first: int,
    keep: Path | None,
) -> None:
    images = [PressImage(str(path), read_rgb(path), ball) for path in presses]
    options = {"mm_per_pixel": mm_per_pixel, "sensor": sensor, "gel": gel(sensor)}
    whole = calibrate(images, read_rgb(background), **options)
    usable = sorted(name for name in whole.places if in_view(whole.calibration, Path(name), background))
    held_out = [Path(name) for name in usable[first :: len(usable) // touches][:touches]]
    others = [one for one in images if Path(one.name) not in held_out and one.name in whole.places]
    calibration = calibrate(others, read_rgb(background), **options).calibration
    click.echo(
        f"{len(whole.places)} of {len(images)} presses show a whole ball, {len(usable)} of them far from the edge"
    )
    with tempfile.TemporaryDirectory() as temporary:
        folder = keep or Path(temporary)
        (folder / "touches").mkdir(parents=True, exist_ok=True)
        calibration.save(folder / "touches" / "sensor.json")
        shutil.copy(background, folder / "touches" / "background.png")
        entries = []
        for number, (path, z) in enumerate(zip(held_out, directions(touches), strict=True)):
            shutil.copy(path, folder / "touches" / f"{number}.png")
            matrix = pose(calibration, path, background, ball, z)
            entries.append({"image": f"{number}.png", "pose": {"matrix": matrix, "maps_to": "rigid"}})
        manifest = {
            "format": 1,
            "unit": "mm",
            "object_unit": "mm",
            "frame": "sensor",
            "sensor": sensor,
            "background": "background.png",
            "calibration": "sensor.json",
            "pose_error": {"position": 0, "rotation": 0},
            "touches": entries,
        }
        (folder / "touches" / "touches.json").write_text(json.dumps(manifest))
        random = np.random.default_rng(0).normal(size=(20 * POINTS, 3))
        random /= np.linalg.norm(random, axis=1, keepdims=True)
        write_points(folder / "camera.xyz", random[random[:, 2] > LOWEST][:POINTS] * ball / 2)
        for words in ((), ("--touch", str(folder / "touches"))):
            out = folder / "dense.xyz"
            arguments = ["upsample", str(folder / "camera.xyz"), "-o", str(out), "--rate", str(RATE), *words]
            done = CliRunner().invoke(cli.pcsr, arguments)
            if done.exit_code:
                raise PcsrError(done.output)
            report(read_points(out), ball / 2, "with touches" if words else "without touches")


def report(dense: Float[np.ndarray, "n 3"], radius: float, label: str) -> None:
    surface = sphere(20_000) * radius
    bare = float((cKDTree(dense).query(surface)[0] > APART).mean())
    hidden = dense[dense[:, 2] < 1.5 * LOWEST * radius]
    away = abs(np.linalg.norm(hidden, axis=1) - radius)
    figures = "no point of the hidden part"
    if len(hidden):
        middle, most, worst = np.quantile(away, [0.5, 0.9, 1.0])
        figures = f"{len(hidden)} points of the hidden part, {middle:.3f} mm from the ball in the median, "
        figures += f"90 % within {most:.3f}, all within {worst:.3f}"
    click.echo(f"{label}: {bare:.0%} of the ball without a point within {APART} mm; {figures}")


if __name__ == "__main__":
    main()
