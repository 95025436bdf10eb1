"""Building of data sets (TAPSR, Sec. 4.1): each object is sampled and touched, and written shard by shard.

A finished, undamaged shard is never built again. A build that was interrupted, in whatever way, can therefore be
continued, and ends with the same bytes as one without interruption.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from pcsr.data.dataset import Split
from pcsr.data.jobs import results
from pcsr.data.plan import FORMAT, Plan
from pcsr.data.schema import Coverage, Manifest, Settings, Shard, Summary
from pcsr.data.shards import (
    MANIFEST,
    SHARD,
    read_card,
    read_manifest,
    shard_path,
    shard_sum,
    write_manifest,
    write_shard,
)
from pcsr.errors import UserError
from pcsr.version import __version__
from pcsr.workers import WorkerPool


def load_or_build(
    plan: Plan, split: str, folder: Path, pool: WorkerPool, advance: Callable[[int], None] = lambda count: None
) -> Split:
    """Load a split from a folder, after building what is missing of it.

    Args:
        plan: objects and settings of the data set.
        split: "train", "validation" or "test".
        folder: folder of this data set alone; it need not exist.
        pool: processes that build.
        advance: called with the number of objects that were just built, or found to be built.

    Raises:
        UserError: the folder holds other data, the split is empty, or none of its objects could be used.
        RunError: as for `build_split`.
    """
    build_split(plan, split, folder, pool, advance)
    return Split.load(folder, split)


def build_split(
    plan: Plan, split: str, folder: Path, pool: WorkerPool, advance: Callable[[int], None] = lambda count: None
) -> None:
    """Build what is missing of a split. The files' bytes depend neither on the pool nor on interruptions.

    Args:
        plan: objects and settings of the data set.
        split: "train", "validation" or "test".
        folder: folder of this data set alone; it need not exist.
        pool: processes that build.
        advance: called with the number of objects that were just built, or found to be built.

    Raises:
        UserError: the folder holds other data, the split is empty, or touches differ in their number of points.
        RunError: a process died, the cluster is lost, or the disk is full. Finished shards are kept.
    """
    names = plan.split(split)
    done = _manifest(plan, folder).splits.get(split)
    sums = {shard.file: shard.sha256 for shard in done.shards} if done else {}
    shards = [names[i : i + SHARD] for i in range(0, len(names), SHARD)]
    missing = []
    for number, objects in enumerate(shards):
        path = shard_path(folder, split, number)
        if path.is_file() and _finished(path, plan.fingerprint, objects, sums.get(path.name)):
            advance(len(objects))
        else:
            missing.append(number)
    # One stream over all missing shards, so that no process waits at the end of a shard.
    stream = results(plan, [name for number in missing for name in shards[number]], pool)
    for number in missing:
        shard = []
        for _ in shards[number]:
            shard.append(next(stream))
            advance(1)
        write_shard(shard_path(folder, split, number), shard, plan.fingerprint)
    summary = _summary(folder, split, len(shards))
    if summary == done:
        return
    # The manifest is read again, since another process may have added a split in the meantime.
    manifest = _manifest(plan, folder)
    splits = {**manifest.splits, split: summary}
    ordered = {name: splits[name] for name in plan.names if name in splits}
    write_manifest(folder, manifest.model_copy(update={"splits": ordered}))


def _finished(path: Path, fingerprint: str, names: Sequence[str], known: str | None) -> bool:
    """Return whether a shard is finished: undamaged, with these objects of this data set, and without faults.

    Args:
        path: file of the shard.
        fingerprint: fingerprint of the data set.
        names: names of the shard's objects.
        known: hash of the file in the manifest. None: the split is not listed there yet, and only the card is checked.
    """
    try:
        card = read_card(path)
    except UserError:
        return False
    same_objects = card.fingerprint == fingerprint and {*card.names, *card.rejected} == set(names)
    return same_objects and not card.faults and known in (None, shard_sum(path))


def _manifest(plan: Plan, folder: Path) -> Manifest:
    """Return the folder's manifest, or write and return a new one.

    Raises:
        UserError: the folder holds other data.
    """
    if (folder / MANIFEST).exists():
        manifest = read_manifest(folder)
        if manifest.fingerprint != plan.fingerprint:
            raise UserError(
                f"{folder} holds other data (fingerprint {manifest.fingerprint[:12]}, not {plan.fingerprint[:12]}): "
                f"its objects or settings differ; choose another folder, or delete this one"
            )
        return manifest
    for path in sorted(folder.glob("*-[0-9][0-9][0-9][0-9][0-9].safetensors")):
        # Shards of this data set, whose manifest was lost, are kept and used; others must not be overwritten.
        if read_card(path).fingerprint != plan.fingerprint:
            raise UserError(f"{path} belongs to other data: choose another folder, or delete this one")
    recipe = plan.recipe
    data = recipe.resolved()["data"] | {"touches": recipe.most_touches, "seed": recipe.data_seed}
    manifest = Manifest(
        format=FORMAT,
        made_by=f"pcsr {__version__}",
        fingerprint=plan.fingerprint,
        data=Settings(**data),
        empty=plan.empty,
        splits={},
    )
    write_manifest(folder, manifest)
    return manifest


def _summary(folder: Path, split: str, count: int) -> Summary:
    """Summarize the shards of a split for the manifest."""
    paths = [shard_path(folder, split, number) for number in range(count)]
    cards = [read_card(path) for path in paths]
    shares = np.array([row for card in cards for row in card.coverage])
    return Summary(
        objects=len(shares),
        groups=len({group for card in cards for group in card.groups}),
        sensors=tuple(sorted({sensor for card in cards for sensor in card.sensors})),
        coverage=tuple(_coverage(k + 1, column) for k, column in enumerate(shares.T)) if shares.size else (),
        rejected={name: reason for card in cards for name, reason in card.rejected.items()},
        faults=sum(card.faults for card in cards),
        shards=tuple(
            Shard(file=path.name, objects=len(card.names), sha256=shard_sum(path))
            for path, card in zip(paths, cards, strict=True)
        ),
    )


def _coverage(touches: int, shares: np.ndarray) -> Coverage:
    p10, p50, p90 = map(float, np.percentile(shares, (10, 50, 90)))
    return Coverage(touches=touches, mean=float(shares.mean()), p10=p10, p50=p50, p90=p90)
