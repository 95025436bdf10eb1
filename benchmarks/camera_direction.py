"""How well the direction of the camera is estimated from a cloud alone.

python benchmarks/camera_direction.py [--parts 24] [--seeds 3] [--save]

Test parts of `cad-parts`, 512 points: seen by one camera, three radii away, in the direction that is estimated; by two
and four cameras; and at random points of all sides, where none should be found.
"""

import click
import numpy as np
from saved import save, show

import pcsr.data.view
from pcsr.data.view import seen_points, spread_directions
from pcsr.exploration.far_side import seen_from
from pcsr.geometry.sampling import surface_points
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import View

POINTS = 512
COLUMNS = ("cloud", "clouds", "seen from one side", "error, median", "error, 90 %")


def angles(cameras: int, parts: int, seeds: int) -> list[float]:
    """Errors of the direction in degrees, from the nearest camera; NaN where none is found."""
    shapes = load_plugins().get("shapes", "cad-parts")(held_out=24)
    found = []
    for name in shapes.names("test")[:parts]:
        mesh = shapes.item(name).mesh
        for seed in range(seeds):
            rng = np.random.default_rng([seed, *name.encode()])
            if cameras:
                directions = spread_directions(cameras, rng)
                pcsr.data.view.spread_directions = lambda count, rng, known=directions: known
                points = seen_points(mesh, POINTS, View(cameras=cameras), rng, name)
            else:
                directions = np.zeros((1, 3))
                points = surface_points(mesh, POINTS, rng)
            towards = seen_from(points)
            cosine = np.nan if towards is None else float((directions @ towards).max())
            found.append(float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))))
    return found


@click.command()
@click.option("--parts", default=24, show_default=True)
@click.option("--seeds", default=3, show_default=True)
@click.option("--save", "saving", is_flag=True, help="Write the table to docs/numbers.")
def main(parts: int, seeds: int, saving: bool) -> None:
    """Print the table."""
    original, rows = pcsr.data.view.spread_directions, []
    try:
        for cameras in (1, 2, 4, 0):
            errors = np.array(angles(cameras, parts, seeds))
            known = errors[np.isfinite(errors)]
            cells = [f"{np.quantile(known, q):.0f}°" if cameras and len(known) else "" for q in (0.5, 0.9)]
            what = f"{cameras} camera{'s' if cameras > 1 else ''}" if cameras else "random points"
            rows.append([what, str(len(errors)), f"{len(known) / len(errors):.0%}", *cells])
    finally:
        pcsr.data.view.spread_directions = original
    show(COLUMNS, rows)
    if saving:
        words = f" --parts {parts} --seeds {seeds}" if (parts, seeds) != (24, 3) else ""
        save("camera-direction", f"python benchmarks/camera_direction.py{words} --save", COLUMNS, rows)


if __name__ == "__main__":
    main()
