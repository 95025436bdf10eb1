"""Building TSR-PD (TAPSR, Sec. 4.1): every object sampled and touched, shard by shard, and kept.

A shard that is finished and undamaged is never made again. So a build that was stopped, in whatever way, goes on where
it was, and ends with the same bytes as one that was not.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

import pcsr
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
from pcsr.workers import WorkerPool


def load_or_build(
    plan: Plan, split: str, folder: Path, pool: WorkerPool, advance: Callable[[int], None] = lambda count: None
) -> Split:
    """A split from `folder`, where it is built first as far as it isn't there yet.

    Args:
        plan: what the data is.
        split: "train", "validation" or "test".
        folder: of this data and no other.
        pool: who builds.
        advance: called with the number of objects that were just finished, or found finished.

    Raises:
        UserError: the folder holds other data, the split is empty, or no object of it could be used.
    """
    build_split(plan, split, folder, pool, advance)
    return Split.load(folder, split)


def build_split(
    plan: Plan, split: str, folder: Path, pool: WorkerPool, advance: Callable[[int], None] = lambda count: None
) -> None:
    """Build what is missing of a split. The bytes depend neither on the pool nor on stops in between.

    Raises:
        UserError: the folder holds other data, the split is empty, or touches of different sizes.
        RunError: a process died, the cluster is lost, or the disk is full; what is finished is kept.
    """
    names = plan.split(split)
    done = _manifest(plan, folder).splits.get(split)
    sums = {shard.file: shard.sha256 for shard in done.shards} if done else {}
    shards = [names[i : i + SHARD] for i in range(0, len(names), SHARD)]
    missing = []
    for number, some in enumerate(shards):
        path = shard_path(folder, split, number)
        if path.is_file() and _finished(path, plan.fingerprint, some, sums.get(path.name)):
            advance(len(some))
        else:
            missing.append(number)
    # All that is missing is one stream of work, so that no process waits at the end of a shard.
    stream = results(plan, [name for number in missing for name in shards[number]], pool)
    for number in missing:
        made = []
        for _ in shards[number]:
            made.append(next(stream))
            advance(1)
        write_shard(shard_path(folder, split, number), made, plan.fingerprint)
    summary = _summary(folder, split, len(shards))
    if summary == done:
        return
    # Another process may have built another split in the meantime.
    manifest = _manifest(plan, folder)
    splits = {**manifest.splits, split: summary}
    ordered = {name: splits[name] for name in plan.names if name in splits}
    write_manifest(folder, manifest.model_copy(update={"splits": ordered}))


def _finished(path: Path, fingerprint: str, names: Sequence[str], known: str | None) -> bool:
    """Whether a shard holds these objects of this data, is undamaged and needs no other try.

    Args:
        path: of the shard.
        fingerprint: of the data.
        names: what its objects are called.
        known: its hash in the manifest; None where the split isn't in there yet, and the shard's card has to do.
    """
    try:
        card = read_card(path)
    except UserError:
        return False
    mine = card.fingerprint == fingerprint and {*card.names, *card.rejected} == set(names)
    return mine and not card.faults and known in (None, shard_sum(path))


def _manifest(plan: Plan, folder: Path) -> Manifest:
    """The folder's manifest, a new one if it has none.

    Raises:
        UserError: it is of other data.
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
        # A shard of this data, whose manifest was lost, is of use; anything else is somebody's.
        if read_card(path).fingerprint != plan.fingerprint:
            raise UserError(f"{path} belongs to other data: choose another folder, or delete this one")
    recipe = plan.recipe
    data = recipe.resolved()["data"] | {"touches": recipe.most_touches, "seed": recipe.data_seed}
    manifest = Manifest(
        format=FORMAT,
        made_by=f"pcsr {pcsr.__version__}",
        fingerprint=plan.fingerprint,
        data=Settings(**data),
        empty=plan.empty,
        splits={},
    )
    write_manifest(folder, manifest)
    return manifest


def _summary(folder: Path, split: str, count: int) -> Summary:
    """What the shards of a split hold, for its place in the manifest."""
    paths = [shard_path(folder, split, number) for number in range(count)]
    cards = [read_card(path) for path in paths]
    shares = np.array([row for card in cards for row in card.coverage])
    return Summary(
        objects=len(shares),
        groups=len({group for card in cards for group in card.groups}),
        sensors=tuple(sorted({sensor for card in cards for sensor in card.sensors})),
        coverage=tuple(_coverage(k + 1, of) for k, of in enumerate(shares.T)) if shares.size else (),
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
