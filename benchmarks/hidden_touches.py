"""Touches of a side that no camera saw, corrected by those of the seen side: how far they are off before and after.

python benchmarks/hidden_touches.py [--parts 24] [--draws 3] [--save]

Test parts of `cad-parts` of 30 mm, a cloud of 512 points from one camera, two touches of the seen surface and two of
the hidden one. All touches of a part share an error of the arm, and each has a smaller one of its own. `pcsr.register`
gets the errors that it expects by default, 1 mm and 2 degrees.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import click
import numpy as np
from rich.progress import track
from saved import save, show
from scipy.spatial import cKDTree

import pcsr
from pcsr.data.sample import item_seed
from pcsr.data.view import seen_points
from pcsr.errors import PcsrError, UserError
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import View
from pcsr.registration import Registration
from pcsr_plugins.touch.digit.noise import Noise

TOUCHES = 12
"""Random touches of a part, of which the first two of each side are taken."""
SEEN, HIDDEN = 0.8, 3.0
"""Median distances of a touch from the cloud, in spacings, up to which it is seen, and from which it is hidden."""
SHARED, PRIVATE = (1.0, 2.0), (0.2, 0.3)
"""Errors in millimetres and degrees."""


@dataclass(frozen=True)
class Case:
    """A part's cloud, its exact touches, and those that the arm reported: two seen, two hidden."""

    cloud: np.ndarray
    exact: Sequence[pcsr.Touch]
    reported: Sequence[pcsr.Touch]


def cases(parts: int, draws: int) -> Iterator[Case]:
    """The test parts that have two touches of each kind, once for each draw."""
    registry = load_plugins()
    shapes = registry.get("shapes", "cad-parts")(held_out=24)
    digit = registry.get("touch", "digit")
    noise = Noise(
        position_noise=PRIVATE[0],
        rotation_noise=PRIVATE[1],
        shared_position_noise=SHARED[0],
        shared_rotation_noise=SHARED[1],
    )
    for draw in range(draws):
        for name in track(shapes.names("test")[:parts], f"parts, draw {draw + 1}", transient=True):
            item = shapes.item(name)
            rng = np.random.default_rng(item_seed(draw, name))
            cloud = seen_points(item.mesh, 512, View(cameras=1), rng, name)
            seed = int(rng.integers(2**31))
            try:
                exact, reported = (
                    digit(object_size=30.0, noise=of).touches(item, cloud.copy(), TOUCHES, seed)
                    for of in (Noise(), noise)
                )
            except UserError:
                continue  # too thin or too hollow for so many touches
            rows = _rows(cloud, exact)
            if len(rows) == 4:
                yield Case(cloud, [exact[row] for row in rows], [reported[row] for row in rows])


def _rows(cloud: np.ndarray, touches: Sequence[pcsr.Touch]) -> list[int]:
    """Two touches of the seen surface, then two of the hidden one."""
    tree = cKDTree(cloud)
    spacing = np.median(tree.query(cloud, k=[2, 3, 4, 5])[0].mean(1))
    away = [np.median(tree.query(touch.points)[0]) / spacing for touch in touches]
    seen = [row for row, distance in enumerate(away) if distance < SEEN][:2]
    hidden = [row for row, distance in enumerate(away) if distance > HIDDEN][:2]
    return [*seen, *hidden] if len(seen) == len(hidden) == 2 else []


def off(case: Case, registration: Registration) -> np.ndarray:
    """For each touch the mean distance of its points from where they should be, in mm, reported and registered; and
    the share of points that are used."""
    found = []
    for exact, reported, one in zip(case.exact, case.reported, registration.touches, strict=True):
        registered = reported.points @ one.motion[:3, :3].T + one.motion[:3, 3]
        distances = (np.linalg.norm(points - exact.points, axis=1).mean() for points in (reported.points, registered))
        found.append([*(distance * exact.unit for distance in distances), len(one.touch.points) / len(exact.points)])
    return np.array(found)


@click.command()
@click.option("--parts", type=click.IntRange(1), default=24, show_default=True)
@click.option("--draws", type=click.IntRange(1), default=3, show_default=True)
@click.option("--save", "saving", is_flag=True, help="Write docs/numbers/hidden-touches.json.")
def main(parts: int, draws: int, saving: bool) -> None:
    """Print the error of seen and of hidden touches, as reported and registered."""
    try:
        measured = np.array([off(case, pcsr.register(case.reported, case.cloud)) for case in cases(parts, draws)])
    except PcsrError as error:
        raise click.ClickException(str(error)) from error
    if not len(measured):
        raise click.ClickException(
            "no part has two touches of the seen side and two of the hidden one: take more parts"
        )
    columns = ("touches", "reported, mm", "registered, mm", "left", "median of left", "points used")
    columns += ("of used points: reported, mm", "registered, mm", "left")
    rows = []
    for name, some in (("seen", measured[:, :2]), ("hidden", measured[:, 2:])):
        before, after, used = some.reshape(-1, 3).T
        weighted = [(values * used).sum() / used.sum() for values in (before, after)]
        row = [f"{before.mean():.2f}", f"{after.mean():.2f}", f"{after.mean() / before.mean():.0%}"]
        row += [f"{np.median(after / before):.0%}", f"{used.mean():.0%}", *(f"{value:.2f}" for value in weighted)]
        rows.append([f"{len(before)} {name}", *row, f"{weighted[1] / weighted[0]:.0%}"])
    show(columns, rows)
    if saving:
        save(
            "hidden-touches",
            f"python benchmarks/hidden_touches.py --parts {parts} --draws {draws} --save",
            columns,
            rows,
        )


if __name__ == "__main__":
    main()
