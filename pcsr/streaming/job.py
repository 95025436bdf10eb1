"""Work on a sorted cloud: upsampling of each tile, and the result of all."""

import datetime
from collections.abc import Callable, Iterator
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path

import numpy as np

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
from pcsr.streaming.examples import with_new_points
from pcsr.streaming.filling import SortedCloud, touches_near
from pcsr.streaming.registered import registered
from pcsr.streaming.sorting import EXAMPLES, USED, Plan, Tile
from pcsr.streaming.stored import unpacked
from pcsr.streaming.touched import Unseen
from pcsr.streaming.work_folder import WorkFolder, check_room
from pcsr.tensors import CloudArray
from pcsr.touches import GivenTouches
from pcsr.upsample.dense import densify
from pcsr.workers import WorkerPool


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
        few = few.with_source(np.zeros(0, np.int64)) if "source" in request.fields else few
        writer = row_writer(target.suffix.lower(), few, datetime.date.fromisoformat(plan.date))
        tiles = SortedCloud(work, plan, list(first.columns), first.about)
        corners = np.concatenate([tiles.lowers, tiles.uppers])
        power = exponent([corners])
        touches.check(corners)
        touched = registered(touches, tiles, report).points(power)
        patch = candidates(model, alone=True).size
        unseen = Unseen.of(tiles, touched, patch, power)
        unseen.warn(new)
        return cls(model, cloud, work, target, request, tiles, writer, power, touched, unseen.first(new), new)

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
        self.work.needed = rest * self.writer.row_size
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
                    rows = self._filled(index, tile, new, pool, _Part(done, tile.count, total, advance))
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

    def _filled(self, index: int, tile: Tile, new: int, pool: WorkerPool, advance: "_Part") -> Rows:
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
            inner, outer = np.split(normals, [len(own)])
            normals = np.concatenate([inner, np.zeros_like(touched), outer, np.zeros_like(others)])
        core = len(own) + len(touched)
        count = new - len(touched)
        made = densify(
            np.concatenate([scaled(own.points, -self.power), touched, scaled(margin.points, -self.power), others]),
            core + count if self.request.keep else count,
            source,
            touches=touches_near(self.touches, tile, width, self.power),
            normals=normals,
            keep=self.request.keep,
            core=core,
            pool=pool,
            advance=advance,
        ).points
        points = scaled(np.concatenate([touched, made]), self.power)
        dense = around.with_new(points, keep=False, kinds=self.cloud.plan.column_kinds)
        if "source" in self.request.fields:
            dense = dense.with_source(np.repeat([TOUCHED, MADE], [len(touched), len(made)]))
        return self.writer.rows(dense)

    def _parts(self) -> Iterator[Rows]:
        """Yield the rows of the result: those of the input, then the new ones of each tile."""
        if self.request.keep:
            with self.work.raw_path(USED).open("rb") as file:
                for chunk in self.input.chunks():
                    used = np.fromfile(file, np.uint8, len(chunk)).astype(bool)
                    old = chunk.chosen(used) if self.request.bad == "drop" else chunk
                    if "source" in self.request.fields:
                        old = old.with_source(np.zeros(0, np.int64))
                    if len(old):
                        yield self.writer.rows(old)
        for tile in self.cloud.plan.tiles:
            rows = self.work.load(_result(tile))
            for at in range(0, len(rows), CHUNK):
                yield rows[at : at + CHUNK]


@dataclass(frozen=True)
class _Part:
    """Progress of one tile among the progress of all."""

    before: int
    count: int
    total: int
    advance: Callable[[int, int], None]

    def __call__(self, done: int, total: int) -> None:
        """Report the progress."""
        self.advance(self.before + done * self.count // total, self.total)


def _result(tile: Tile) -> str:
    """Return the name of the file with the rows of a tile's new points."""
    return f"new-{tile.number:06d}"
