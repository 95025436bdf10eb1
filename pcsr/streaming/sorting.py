"""Sorting of a cloud's points into tiles on disk, chunk by chunk, with a search for faults on the way."""

import datetime
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float64, Int

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.column_kinds import ColumnKinds, column_kinds
from pcsr.clouds.faults import Bad
from pcsr.clouds.faults.find import counted
from pcsr.clouds.faults.near_copies import near_copies
from pcsr.clouds.faults.positions import Positions
from pcsr.clouds.faults.rules import HEALTHY, Rules, Suspicion
from pcsr.clouds.faults.screening import refusal, remark
from pcsr.clouds.formats.chunks import ChunkedCloud
from pcsr.errors import PcsrWarning, UserError
from pcsr.geometry.checks import check_cloud
from pcsr.streaming.examples import deciding, joined
from pcsr.streaming.stored import packed, unpacked
from pcsr.streaming.tiles import TileTree, depth_for
from pcsr.streaming.work_folder import WorkFolder

SAMPLE = 1 << 18
"""Smallest number of points by whose medians a cloud is divided and by whose values its columns are judged."""
SAMPLES_EACH = 64
"""Smallest number of them in a tile."""
MOST_SUSPECTS = 1 << 18
"""Most suspicious points that are judged together with the sample."""
EXAMPLES, USED = "examples", "used"
"""Names of the files with the rows of `deciding`, and with a byte for each point: 1 if it is used, otherwise 0."""


@dataclass(frozen=True)
class Tile:
    """Tile of a sorted cloud."""

    number: int
    count: int
    """Number of used points."""
    lower: list[float]
    """Least coordinates of its used points."""
    upper: list[float]
    """Largest coordinates of its used points."""

    @property
    def name(self) -> str:
        """Name of the file with its points."""
        return tile_name(self.number)


@dataclass(frozen=True)
class Plan:
    """Sorted cloud: what is known of it as a whole."""

    count: int
    """Number of points of the file."""
    used: int
    """Number of points that are used."""
    tiles: list[Tile]
    """Tiles with points, of which consecutive ones are neighbours."""
    kinds: dict[str, Any]
    """Fields of `ColumnKinds`."""
    date: str
    """Day on which the work began."""

    @classmethod
    def of(cls, saved: dict[str, Any]) -> "Plan":
        """Return the plan from what `saved` returned."""
        return cls(**{**saved, "tiles": [Tile(**tile) for tile in saved["tiles"]]})

    def saved(self) -> dict[str, Any]:
        """Return the plan as JSON values."""
        return asdict(self)

    @property
    def column_kinds(self) -> ColumnKinds:
        """How each column is carried to new points."""
        return ColumnKinds(**{**self.kinds, "rounded": frozenset(self.kinds["rounded"])})


@dataclass
class _Found:
    """Faulty points of one kind."""

    count: int = 0
    row: int = 0
    point: Float64[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))

    def add(self, rows: Int[np.ndarray, " m"], points: Float64[np.ndarray, "m 3"]) -> None:
        if len(rows) and not self.count:
            self.row, self.point = int(rows[0]), points[0]
        self.count += len(rows)


def tile_name(number: int) -> str:
    """Return the name of the file with the points of a tile."""
    return f"tile-{number:06d}"


def sort(cloud: ChunkedCloud, work: WorkFolder, most: int, bad: Bad, advance: Callable[[int, int], None]) -> Plan:
    """Sort the points of a cloud into tiles of at most about `most` points, and save the plan.

    Args:
        cloud: the file.
        work: folder for the tiles.
        most: number of points of a tile.
        bad: treatment of faulty points, as in `screen`.
        advance: called with the number of points read, of all passes, and their total.

    Raises:
        UserError: there are faulty points and `bad` is "refuse", no point is left, or all lie on one spot.

    Warns:
        PcsrWarning: there are faulty points or duplicates.
    """
    work.start_anew()
    name, total = str(cloud.path), 3 * cloud.count
    depth = depth_for(cloud.count, most)
    sample = _sample(cloud, max(SAMPLE, SAMPLES_EACH << depth), lambda done: advance(done, total))
    rules, healthy = _rules(cloud, sample, lambda done: advance(cloud.count + done, total))
    if not len(healthy):
        raise UserError(f"{name}: no healthy point is among {len(sample)} of its {cloud.count} points")
    tree = TileTree.of(healthy.points, depth)
    faults, examples = _distribute(cloud, work, tree, rules, bad, lambda done: advance(2 * cloud.count + done, total))
    sentences = [
        rules.sentence(kind, fault.count, cloud.count, fault.row, fault.point)
        for kind, fault in enumerate(faults)
        if fault.count
    ]
    if sentences and bad == "refuse":
        raise refusal(name, sentences)
    tiles, copies = _without_copies(work, 2**depth, examples)
    if not tiles:
        raise UserError(f"{name}: none of its {cloud.count} points is healthy")
    corners = np.array([corner for tile in tiles for corner in (tile.lower, tile.upper)])
    check_cloud(corners, name, extent=True)
    for sentence in sentences:
        warnings.warn(remark(name, sentence, bad, harmful=True), PcsrWarning, stacklevel=3)
    if copies.count:
        what = "are copies of others" if copies.count > 1 else "are a copy of another"
        sentence = counted(copies.count, cloud.count, f"{what}, such as point {copies.row}, counted from 0")
        warnings.warn(remark(name, sentence, bad, harmful=False), PcsrWarning, stacklevel=3)
    kinds = asdict(column_kinds(joined([healthy, examples]).columns))
    plan = Plan(
        cloud.count,
        sum(tile.count for tile in tiles),
        tiles,
        {**kinds, "rounded": sorted(kinds["rounded"])},
        datetime.date.today().isoformat(),
    )
    work.save(EXAMPLES, packed(examples, np.zeros(len(examples), np.int64)))
    work.save_plan(plan.saved())
    return plan


def _sample(cloud: ChunkedCloud, count: int, advance: Callable[[int], None]) -> Cloud:
    """Return about `count` points, one of each of as many equal parts of the file, or all if there are fewer."""
    if count >= cloud.count:
        rows = np.arange(cloud.count)
    else:
        ends = np.arange(count + 1) * cloud.count // count
        rows = np.random.default_rng(0).integers(ends[:-1], ends[1:])
    parts, at = [], 0
    for chunk in cloud.chunks():
        here = rows[np.searchsorted(rows, at) : np.searchsorted(rows, at + len(chunk))] - at
        parts.append(chunk.chosen(here))
        at += len(chunk)
        advance(at)
    whole = joined(parts)
    return whole.chosen(np.isfinite(whole.points).all(axis=1))


def _rules(cloud: ChunkedCloud, sample: Cloud, advance: Callable[[int], None]) -> tuple[Rules, Cloud]:
    """Return the rules for faults, and the points of the sample without faults."""
    at, suspects = 0, [np.zeros((0, 3))]
    suspicious = Suspicion.of(sample.points) if len(sample) else None
    for chunk in cloud.chunks():
        at += len(chunk)
        if suspicious is not None and sum(map(len, suspects)) < MOST_SUSPECTS:
            suspects.append(chunk.points[suspicious(chunk.points)])
        advance(at)
    if suspicious is None:
        return Rules((), np.zeros((0, 3)), np.zeros((0, 3))), sample
    others = sample.points[~suspicious(sample.points)]
    rules = Rules.of(np.concatenate([others, *suspects])[: len(others) + MOST_SUSPECTS])
    return rules, sample.chosen(rules.kinds(sample.points) == HEALTHY)


def _distribute(
    cloud: ChunkedCloud,
    work: WorkFolder,
    tree: TileTree,
    rules: Rules,
    bad: Bad,
    advance: Callable[[int], None],
) -> tuple[list[_Found], Cloud]:
    """Append the points without faults to the files of their tiles.

    Returns:
        The faulty points of each kind, and the rows of `deciding` of all points that will be written.
    """
    at = 0
    faults = [_Found() for _ in range(rules.count)]
    examples: Cloud | None = None
    for chunk in cloud.chunks():
        kinds, rows = rules.kinds(chunk.points), at + np.arange(len(chunk))
        for kind, fault in enumerate(faults):
            there = kinds == kind
            fault.add(rows[there], chunk.points[there])
        healthy = kinds == HEALTHY
        with work.appended(USED) as file:
            file.write(healthy.tobytes())
        written = chunk if bad == "keep" else chunk.chosen(healthy)
        if len(written):
            few = written.chosen(deciding(written))
            few = few if examples is None else joined([examples, few])
            examples = few.chosen(deciding(few))
        used = np.flatnonzero(healthy)
        tiles = tree.tiles(chunk.points[used])
        order = np.argsort(tiles, kind="stable")
        table = packed(chunk.chosen(used[order]), rows[used[order]])
        numbers, starts = np.unique(tiles[order], return_index=True)
        for number, part in zip(numbers, np.split(table, starts[1:]), strict=True):
            with work.appended(tile_name(int(number))) as file:
                file.write(part.tobytes())
        at += len(chunk)
        advance(at)
    if examples is None:
        raise UserError(f"{cloud.path}: none of its {cloud.count} points is healthy")
    return faults, examples


def _without_copies(work: WorkFolder, count: int, like: Cloud) -> tuple[list[Tile], _Found]:
    """Replace the raw file of each tile by one without duplicates, and mark these as not used."""
    dtype = packed(like, np.zeros(len(like), np.int64)).dtype
    tiles, copies = [], _Found()
    for number in range(count):
        name = tile_name(number)
        table = work.raw(name, dtype)
        if not len(table):
            continue
        points = unpacked(table[["row", "points"]], (), {}).points
        positions = Positions.of(points)
        first = np.zeros(len(points), bool)
        first[positions.first] = True
        kept = np.flatnonzero(first)
        first[kept[near_copies(points[kept])]] = False
        if not first.all():
            copies.add(table["row"][~first], points[~first])
            used = np.memmap(work.raw_path(USED), np.uint8, "r+")
            used[table["row"][~first]] = 0
            used.flush()
            del used
            table, points = table[first], points[first]
        work.save(name, table)
        work.drop_raw(name)
        tiles.append(Tile(number, len(table), points.min(axis=0).tolist(), points.max(axis=0).tolist()))
    return tiles, copies
