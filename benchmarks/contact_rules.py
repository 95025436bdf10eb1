"""What rules of contact make of real presses of a ball: area of the contact, and points off the ball.

python benchmarks/contact_rules.py PRESS… --background FILE --ball 6.31 --mm-per-pixel 0.0634 [--sensor NAME]

Each press is read by a calibration of 12 others, spread over the gel. The contact by a rule is compared with the disc
within the rim, where the measured slopes are steepest, and its points with the ball of the true diameter that fits the
points well within the rim best.
"""

from pathlib import Path

import click
import numpy as np
from rich.progress import track

from pcsr.errors import UserError
from pcsr.sensors import PressImage, calibrate, gel, read_rgb
from pcsr.sensors.balls import fitted_ball
from pcsr.sensors.contact import in_contact
from pcsr.sensors.fitting import INNER

FITTED = 12
FOLDS = 3
OFF = 0.05
"""Distance from the ball, in mm, from which on a point is off it."""
THRESHOLDS = (0.05, 0.1, 0.15, 0.2, 0.3)
SHARES = (0.2, 0.4)


@click.command()
@click.argument("presses", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path))
@click.option("--background", required=True, type=click.Path(exists=True, path_type=Path))
@click.option("--ball", required=True, type=float, help="Diameter of the ball in mm.")
@click.option("--mm-per-pixel", required=True, type=float)
@click.option("--sensor", default="gelsight-mini", show_default=True)
def main(presses: tuple[Path, ...], background: Path, ball: float, mm_per_pixel: float, sensor: str) -> None:
    rest = read_rgb(background)
    images = {str(path): read_rgb(path) for path in presses}
    options = {"mm_per_pixel": mm_per_pixel, "sensor": sensor, "gel": gel(sensor)}
    whole = calibrate([PressImage(name, image, ball) for name, image in images.items()], rest, **options)
    names = sorted(whole.places)
    found: dict[str, list[tuple[float, float]]] = {}
    for fold in track(range(FOLDS), "reading", transient=True):
        held_out = names[fold::FOLDS]
        others = [PressImage(name, images[name], ball) for name in names if name not in held_out]
        calibration = calibrate(others, rest, count=FITTED, **options).calibration
        for name in held_out:
            try:
                reading = calibration.read(images[name], rest)
            except UserError:
                continue
            place, height = whole.places[name], reading.indentation
            rows, columns = np.indices(height.shape)
            sag = calibration.gel.sag(positions(height.shape, mm_per_pixel), calibration.columns, calibration.rows)
            points = np.column_stack([positions(height.shape, mm_per_pixel), height.ravel() - sag])
            distance = np.hypot(columns - place.centre[0], rows - place.centre[1]).ravel()
            centre = fitted_ball(points[distance < INNER * place.rim], ball / 2)
            off = np.abs(np.linalg.norm(points - centre, axis=1) - ball / 2) > OFF
            disc = np.pi * place.rim**2
            masks = {f"> {least} mm": height > least for least in THRESHOLDS}
            masks |= {f"> {share} of the deepest, connected": in_contact(height, share) for share in SHARES}
            for rule, mask in masks.items():
                found.setdefault(rule, []).append((mask.sum() / disc, off[mask.ravel()].mean()))
    click.echo(f"{len(next(iter(found.values())))} presses; medians: area / disc, share of points off by {OFF} mm")
    for rule, figures in found.items():
        area, share = np.median(figures, axis=0)
        click.echo(f"{rule:32} {area:5.2f} {share:6.1%}")


def positions(shape: tuple[int, int], mm_per_pixel: float) -> np.ndarray:
    """Positions of all pixels along x and y, row by row, from the centre of the gel's face in mm."""
    rows, columns = np.indices(shape)
    x, y = columns - (shape[1] - 1) / 2, (shape[0] - 1) / 2 - rows
    return np.column_stack([x.ravel(), y.ravel()]) * mm_per_pixel


if __name__ == "__main__":
    main()
