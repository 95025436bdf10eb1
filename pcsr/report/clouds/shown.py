"""Clouds prepared for a view: thinned, coloured, and in the cubes of their views."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from pcsr.clouds.cloud import Cloud
from pcsr.report.clouds.colouring import SOURCE, Classes, Colours, colours_of
from pcsr.report.clouds.extent import Cube, cubes

MOST_EACH, MOST = 200_000, 1_000_000
"""Largest number of points that are shown of one cloud, and of all together."""
MOST_TOUCHED = 50_000
"""Largest number of points that are shown of recorded touches."""


class Named(NamedTuple):
    """Cloud with the name that its view has."""

    name: str
    cloud: Cloud


@dataclass(frozen=True)
class ShownCloud:
    """Points of a cloud that are shown, of all that it has."""

    name: str
    points: Float64[np.ndarray, "n 3"]
    colours: np.ndarray | None
    """A row for each point, as in `Colours.clouds`."""
    cube: Cube
    total: int
    """Number of points of the whole cloud."""
    low: Float64[np.ndarray, "3"]
    """Lowest coordinates of the whole cloud."""
    high: Float64[np.ndarray, "3"]
    """Highest coordinates of the whole cloud."""
    outside: int
    """Number of points that are so far away that they are not shown."""
    counts: str = ""
    """Numbers of old, new and touched points in the whole cloud, empty if they are not marked: ``200 old, 600 new``."""

    @property
    def caption(self) -> str:
        """Name and number of points: ``scan.ply, 200,000 of 2,000,000 points``."""
        number = f"{len(self.points):,} of {self.total:,}" if len(self.points) < self.total else f"{self.total:,}"
        noun = "point" if self.total == 1 else "points"
        return f"{self.name}, {number} {noun}{f': {self.counts}' if self.counts else ''}"

    @property
    def notes(self) -> list[str]:
        """Sentences on the points that are not shown."""
        far = "1 point is far away and is" if self.outside == 1 else f"{self.outside:,} points are far away and are"
        notes = [f"{far} not shown"] if self.outside else []
        if len(self.points) < self.total - self.outside:
            notes.append(f"shown: {len(self.points):,} of {self.total:,} points, drawn at random")
        return [f"{self.name}: {note}" for note in notes]


@dataclass(frozen=True)
class Scene:
    """Clouds to be shown side by side."""

    clouds: Sequence[ShownCloud]
    colours: Colours
    touched: Float64[np.ndarray, "m 3"]
    """Points of recorded touches, which every view shows."""

    @property
    def notes(self) -> list[str]:
        """Sentences on what the views leave out."""
        notes = [note for cloud in self.clouds for note in cloud.notes]
        if len({id(cloud.cube) for cloud in self.clouds}) > 1:
            notes.append("the clouds differ too much in place or size for one frame: each fills its own view")
        return notes


def scene(named: Sequence[Named], by: str | None = None, touches: Sequence[np.ndarray] = (), seed: int = 0) -> Scene:
    """Prepare clouds for a view.

    Args:
        named: clouds, at least one.
        by: column of the colours, as `colours_of` takes it.
        touches: points (m, 3) of each recorded touch, in the frame and unit of the clouds.
        seed: seed of the points that are drawn from large clouds.

    Raises:
        UserError: no cloud has the column.
    """
    colours = colours_of([cloud for _, cloud in named], by)
    rng = np.random.default_rng(seed)
    most = max(1, min(MOST_EACH, MOST // len(named)))
    shown = []
    views = cubes([cloud.points for _, cloud in named])
    for (name, cloud), own, cube in zip(named, colours.clouds, views, strict=True):
        inside = np.flatnonzero(cube.holds(cloud.points))
        rows = _drawn(inside, most, rng)
        shown.append(
            ShownCloud(
                name,
                cloud.points[rows],
                None if own is None else own[rows],
                cube,
                len(cloud),
                cloud.points.min(0),
                cloud.points.max(0),
                len(cloud) - len(inside),
                _counts(colours, own),
            )
        )
    touched = np.concatenate([np.zeros((0, 3)), *(np.asarray(touch, np.float64) for touch in touches)])
    touched = touched[_drawn(np.arange(len(touched)), MOST_TOUCHED, rng)]
    return Scene(shown, colours, touched)


def rows_of(cloud: ShownCloud, classes: Classes) -> Iterator[tuple[str, str, Int64[np.ndarray, " m"]]]:
    """Yield label, colour and rows of each class that a cloud has points of."""
    if cloud.colours is None:
        return
    for code, (label, colour) in enumerate(zip(classes.labels, classes.colours, strict=True)):
        rows = np.flatnonzero(cloud.colours == code)
        if len(rows):
            yield label, colour, rows


def _drawn(rows: Int64[np.ndarray, " n"], most: int, rng: np.random.Generator) -> Int64[np.ndarray, " m"]:
    """Draw at most so many rows at random, in their order."""
    return rows if len(rows) <= most else np.sort(rng.choice(rows, most, replace=False))


def _counts(colours: Colours, codes: np.ndarray | None) -> str:
    key = colours.key
    if codes is None or not isinstance(key, Classes) or key.name != SOURCE:
        return ""
    counts = [(label, int((codes == code).sum())) for code, label in enumerate(key.labels)]
    return ", ".join(f"{count:,} {label}" for label, count in counts if count)
