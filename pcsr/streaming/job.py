"""Work on a sorted cloud: upsampling of each tile, and the result of all."""

import datetime
from collections.abc import Callable, Iterator
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pcsr.clouds.cloud import MADE, TOUCHED, Cloud
from pcsr.clouds.faults import Bad
from pcsr.clouds.formats import check_finite_only
from pcsr.clouds.formats.chunks import CHUNK, ChunkedCloud
from pcsr.clouds.formats.row_writing import Rows, RowWriter, row_writer
from pcsr.errors import RunError, UserError
from pcsr.files import write_whole
from pcsr.geometry.magnitude import exponent, scaled
from pcsr.model import Model, candidates, output_count
from pcsr.registration import Registration
from pcsr.streaming.examples import WITHIN, with_new_points
from pcsr.streaming.filling import SortedCloud, touches_near
from pcsr.streaming.given_errors import BYTES, load_errors, save_errors
from pcsr.streaming.registered import registered
from pcsr.streaming.sorting import EXAMPLES, USED, Plan, Tile
from pcsr.streaming.stored import unpacked
from pcsr.streaming.tile_progress import TileProgress
from pcsr.streaming.touched import Unseen
from pcsr.streaming.work_folder import WorkFolder, check_room
from pcsr.tensors import CloudArray
from pcsr.touches import GivenTouches
from pcsr.uncertainty.upsampled import upsampled_errors
from pcsr.upsample.candidates import Generated
from pcsr.upsample.dense import densify
from pcsr.workers import WorkerPool

NONE = np.zeros(0, np.int64)
"""Sources of no new points."""


@dataclass(frozen=True)
class Request:
    """What is asked for, as the parameters of `upsample_file`."""

    rate: float | int | None
    count: int | None
    keep: bool
    fields: tuple[str, ...]
    bad: Bad


@dataclass(frozen=True, eq=False)
class Job:
    """Upsampling of a sorted cloud."""

    model: Model
    input: ChunkedCloud
    work: WorkFolder
    target: Path
    request: Request
    cloud: SortedCloud
    writer: RowWriter
    power: int
    """Coordinates are divided by 2^power while they are worked on."""
    touches: list[CloudArray]
    """Touched points, divided by 2^power."""
    touch_errors: list[Float[np.ndarray, " _"]]
    """Expected errors of these, divided by 2^power; NaN where they are unknown."""
    unseen: Unseen
    """Those of them that are added to the tiles."""
    new: int
    """Number of new points, touched ones included."""

    @classmethod
    def of(
        cls,
        model: Model,
        cloud: ChunkedCloud,
        work: WorkFolder,
        plan: Plan,
        target: Path,
        request: Request,
        touches: GivenTouches,
        report: Callable[[Registration], None] | None = None,
    ) -> "Job":
        """Prepare the upsampling; `report` is called with the registration of the touches.

        Raises:
            UserError: as of `upsample_file`.

        Warns:
            PcsrWarning: touches are refused and `report` is None, or touched points lie where the cloud has no points.
        """
        kept = cloud.count if request.bad != "drop" else plan.used
        unused = kept - plan.used if request.keep else 0
        wanted = output_count(plan.used, unused, request.rate, request.count)
        new = wanted - plan.used if request.keep else wanted
        if new < 0:
            raise UserError(
                f"{wanted} points are fewer than the {plan.used} of the cloud: ask for more, or don't keep the old "
                f"ones (--replace)"
            )
        first = next(cloud.chunks(1))
        few = unpacked(work.load(EXAMPLES), list(first.columns), first.about)
        check_finite_only(few, target.suffix, str(target))
        few = with_new_points(few)
        few = few.with_fields(request.fields, NONE, np.resize([np.nan, WITHIN], len(few)))
        writer = row_writer(target.suffix.lower(), few, datetime.date.fromisoformat(plan.date))
        tiles = SortedCloud(work, plan, list(first.columns), first.about)
        corners = np.concatenate([tiles.lowers, tiles.uppers])
        power = exponent([corners])
        touches.check(corners)
        given = registered(touches, tiles, report)
        touched = given.points(power)
        patch = candidates(model, alone=True).size
        unseen = Unseen.of(tiles, touched, patch, power)
        unseen.warn(new)
        fitting = unseen.first(new)
        return cls(
            model, cloud, work, target, request, tiles, writer, power, touched, given.errors(power), fitting, new
        )

    @property
    def kept(self) -> int:
        """Number of points of the input that are part of the result."""
        if not self.request.keep:
            return 0
        return self.cloud.plan.used if self.request.bad == "drop" else self.cloud.plan.count

    @property
    def written(self) -> int:
        """Number of points of the result."""
        return self.kept + self.new

    def check_room(self) -> None:
        """Check that the rest of the result has room on the disk.

        Raises:
            RunError: it has not.
        """
        rest = self.written + sum(new for tile, new in self._shares() if not self.work.has(_result(tile)))
        of_errors = BYTES * self.cloud.plan.count if "error" in self.request.fields else 0
        self.work.needed = rest * self.writer.row_size + of_errors
        check_room(self.work)

    def upsample(self, pool: WorkerPool, advance: Callable[[int, int], None]) -> None:
        """Upsample each tile that is not done yet, and save its new points.

        Args:
            pool: processes that work on the patches.
            advance: called with the number of points that are done, and of all.

        Raises:
            RunError: a process died, or the disk is full.
        """
        done, total = 0, self.cloud.plan.used
        try:
            for index, (tile, new) in enumerate(self._shares()):
                if not self.work.has(_result(tile)):
                    rows = self._filled(index, tile, new, pool, TileProgress(done, tile.count, total, advance))
                    self.work.save(_result(tile), rows)
                done += tile.count
                advance(done, total)
        except RunError as error:
            if not isinstance(error.__cause__, BrokenProcessPool):
                raise
            raise RunError(f"{error}; what is finished is kept: run the same command again") from error

    def assemble(self, advance: Callable[[int, int], None]) -> None:
        """Write the result.

        Args:
            advance: called with the number of points that are written, and of all.
        """

        def counted() -> Iterator[Rows]:
            done = 0
            for part in self._parts():
                yield part
                done += len(part)
                advance(done, self.written)
            if done != self.written:
                raise ValueError(f"it holds {done} of {self.written} rows")

        write_whole(self.target, lambda part: self.writer.write(part, self.written, counted()))

    def _shares(self) -> Iterator[tuple[Tile, int]]:
        """Yield each tile with the number of its new points, in proportion to its points."""
        rest, total = self.new - len(self.unseen.points), self.cloud.plan.used + len(self.unseen.points)
        before = 0
        for index, tile in enumerate(self.cloud.plan.tiles):
            touched = int((self.unseen.tiles == index).sum())
            after = before + tile.count + touched
            yield tile, after * rest // total - before * rest // total + touched
            before = after

    def _filled(self, index: int, tile: Tile, new: int, pool: WorkerPool, advance: TileProgress) -> Rows:
        source = candidates(self.model, alone=pool.executor is None)
        own = self.cloud.own(tile)
        margin, width = self.cloud.margin(tile, own, source.size)
        touched = self.unseen.points[self.unseen.tiles == index]
        others = self.unseen.near(tile, width, self.power, except_for=index)
        around = Cloud(
            np.concatenate([own.points, margin.points]),
            {name: np.concatenate([column, margin.columns[name]]) for name, column in own.columns.items()},
            own.about,
        )
        normals = around.normals
        if normals is not None:
            first, second = np.split(normals, [len(own)])
            normals = np.concatenate([first, np.zeros_like(touched), second, np.zeros_like(others)])
        core = len(own) + len(touched)
        count = new - len(touched)
        inner, outer = scaled(own.points, -self.power), np.concatenate([scaled(margin.points, -self.power), others])
        made = densify(
            np.concatenate([inner, touched, outer]),
            core + count if self.request.keep else count,
            source,
            touches=touches_near(self.touches, tile, width, self.power),
            normals=normals,
            keep=self.request.keep,
            core=core,
            pool=pool,
            advance=advance,
        )
        added = Generated.joined([Generated.of(touched), made])
        errors = None
        if "error" in self.request.fields:
            found = upsampled_errors(
                np.concatenate([inner, outer]),
                added,
                touches=self.touches,
                touch_errors=self.touch_errors,
                core=len(own),
                pool=pool,
            )
            save_errors(self.work, tile, scaled(found.known, self.power))
            errors = scaled(found.new, self.power)
        points = scaled(added.points, self.power)
        dense = around.with_new(points, keep=False, kinds=self.cloud.plan.column_kinds)
        sources = np.repeat([TOUCHED, MADE], [len(touched), len(made.points)])
        return self.writer.rows(dense.with_fields(self.request.fields, sources, errors))

    def _parts(self) -> Iterator[Rows]:
        """Yield the rows of the result: those of the input, then the new ones of each tile."""
        if self.request.keep:
            errors = load_errors(self.work, self.cloud.plan) if "error" in self.request.fields else None
            at = 0
            with self.work.raw_path(USED).open("rb") as file:
                for chunk in self.input.chunks():
                    used = np.fromfile(file, np.uint8, len(chunk)).astype(bool)
                    here = None if errors is None else errors[at : at + len(chunk)].astype(np.float64)
                    at += len(chunk)
                    old = chunk.with_fields(self.request.fields, NONE, here)
                    old = old.chosen(used) if self.request.bad == "drop" else old
                    if len(old):
                        yield self.writer.rows(old)
        for tile in self.cloud.plan.tiles:
            rows = self.work.load(_result(tile))
            for at in range(0, len(rows), CHUNK):
                yield rows[at : at + CHUNK]


def _result(tile: Tile) -> str:
    """Return the name of the file with the rows of a tile's new points."""
    return f"new-{tile.number:06d}"
