"""Upsampling from file to file, tile by tile."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import get_args

import numpy as np

from pcsr.clouds.faults import Bad
from pcsr.clouds.formats import writable
from pcsr.clouds.formats.chunks import CHUNKED, open_chunks
from pcsr.clouds.pose_error import PoseError
from pcsr.errors import UserError
from pcsr.model import Model, check_fields, output_count
from pcsr.registration import Registration
from pcsr.streaming.fingerprint import command_of
from pcsr.streaming.job import Job, Request
from pcsr.streaming.sorting import Plan, sort
from pcsr.streaming.stored import packed
from pcsr.streaming.work_folder import (
    WorkFolder,
    check_room,
    damage_explained,
    full_disk_explained,
    refused_without_trace,
)
from pcsr.touches import GivenTouches, TouchesLike
from pcsr.workers import worker_pool

RATE = 4
"""Output points for each input point by default."""
TILE = 200_000
"""Largest number of points of a tile, about."""
MOST_NEW = 1_000_000
"""Largest number of new points of a tile, about."""

Advance = Callable[[str, int, int], None]
"""Called with what is done, and how much of how much is done."""


@dataclass(frozen=True)
class Streamed:
    """Outcome of `upsample_file`."""

    given: int
    """Number of points of the input."""
    written: int
    """Number of points of the result."""


def upsample_file(
    model: Model,
    source: Path,
    target: Path,
    touches: TouchesLike = (),
    rate: float | int | None = None,
    *,
    count: int | None = None,
    keep: bool = True,
    fields: Sequence[str] = (),
    bad: Bad = "refuse",
    pose_error: PoseError | None = None,
    touch_as_is: bool = False,
    suffix: str | None = None,
    jobs: int = 1,
    scheduler: str | None = None,
    tile: int = TILE,
    registered: Callable[[Registration], None] | None = None,
    advance: Advance = lambda what, done, total: None,
) -> Streamed:
    """Upsample a cloud from file to file. Memory does not grow with the size of the cloud.

    All that is finished is kept in the folder `target`.parts. After an interruption, the same call continues where it
    was, and the result has the same bytes. The folder is removed at the end. It takes about as much space as the input
    and the result together.

    The result has as many points as that of `Model.upsample`; they differ near the borders of the tiles. The points of
    the input come first, in their order.

    Args:
        model: model, as `pcsr.load` returns it.
        source: PLY (binary, without lists), NPY, LAS or LAZ file.
        target: file of the result, of one of these formats.
        touches: as of `Model.upsample`. They are registered to the points near them.
        rate: as of `Model.upsample`.
        count: as of `Model.upsample`.
        keep: as of `Model.upsample`.
        fields: as of `Model.upsample`.
        bad: as of `Model.upsample`.
        pose_error: as of `Model.upsample`.
        touch_as_is: as of `Model.upsample`.
        suffix: suffix of the format of `source`; by default that of its name.
        jobs: number of processes. The result does not depend on it.
        scheduler: address of a Dask scheduler, as of `Model.upsample`.
        tile: number of points that are in memory at once, about. The result depends on it.
        registered: called with the registration of the touches, if there is one, before the tiles are upsampled. By
            default a warning names the refused touches.
        advance: called with a word for the work, the number of points that are done, and the number of all points.

    Raises:
        UserError: as of `Model.upsample`; or a format cannot be read or written in parts, or the folder holds the
            unfinished work of another command.
        RunError: the disk is full, or a process died. What is finished is kept.

    Warns:
        PcsrWarning: points were dropped or not used, touches are refused, or touched points lie where the cloud has no
            points.

    Examples:
        >>> from pcsr.streaming import upsample_file
        >>> np.save("scan.npy", np.random.default_rng(0).normal(size=(1000, 3)))
        >>> upsample_file(pcsr.load("midpoint"), Path("scan.npy"), Path("dense.npy"), rate=2, tile=600)
        Streamed(given=1000, written=2000)
    """
    check_fields(fields)
    if bad not in get_args(Bad):
        raise UserError(f"bad is '{bad}': it must be refuse, drop or keep")
    writable(target)
    cloud = open_chunks(source, suffix)
    output_count(cloud.count, 0, rate, count)  # before the work, not after it
    if target.suffix.lower() not in CHUNKED:
        raise UserError(
            f"{target}: a {target.suffix} file cannot be written in parts: name a {', '.join(CHUNKED)} file"
        )
    if target.exists() and source.samefile(target):
        raise UserError(f"{target} is the cloud itself, which is read until the end: name another file as OUT")
    growth = rate or (count or RATE * cloud.count) / cloud.count
    given = GivenTouches.of(touches, pose_error, as_is=touch_as_is)
    command = command_of(model, source, given, rate=rate, count=count, keep=keep, fields=fields, bad=bad, tile=tile)
    work = WorkFolder(target)
    with damage_explained(work), work.opened(command), full_disk_explained(work):
        with refused_without_trace(work):
            saved = work.plan()
            if saved is None:
                work.needed = cloud.count * packed(next(cloud.chunks(1)), np.zeros(1, np.int64)).itemsize
                check_room(work)
                plan = sort(cloud, work, max(1, min(tile, int(MOST_NEW / growth))), bad, partial(advance, "sorting"))
            else:
                plan = Plan.of(saved)
            request = Request(rate, count, keep, tuple(fields), bad)
            job = Job.of(model, cloud, work, plan, target, request, given, registered)
            job.check_room()
        with worker_pool(jobs, scheduler) as pool, refused_without_trace(work):
            job.upsample(pool, partial(advance, "upsampling"))
        job.assemble(partial(advance, "writing"))
    work.remove()
    return Streamed(cloud.count, job.written)
