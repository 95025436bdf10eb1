"""Building TSR-PD (TAPSR, Sec. 4.1): every object sampled and touched, shard by shard, and kept.

A shard that is finished is never made again. So a build that was stopped, in whatever way, goes on where it was, and
ends with the same bytes as one that was not.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import pcsr
from pcsr.data.dataset import Split
from pcsr.data.jobs import results
from pcsr.data.plan import FORMAT, Plan
from pcsr.data.shards import MANIFEST, SHARD, read_card, read_manifest, shard_path, write_manifest, write_shard
from pcsr.errors import UserError
from pcsr.files import sha256
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
    manifest = _manifest(plan, folder)
    done = manifest["splits"].get(split)
    if done and all(_finished(folder / shard["file"], plan.fingerprint) for shard in done["shards"]):
        advance(len(names))
        return
    shards = [names[i : i + SHARD] for i in range(0, len(names), SHARD)]
    missing = []
    for number, some in enumerate(shards):
        path = shard_path(folder, split, number)
        if path.exists() and _finished(path, plan.fingerprint):
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
    # Another process may have built another split in the meantime.
    manifest = _manifest(plan, folder)
    manifest["splits"][split] = _summary(folder, split, len(shards))
    manifest["splits"] = {name: manifest["splits"][name] for name in plan.names if name in manifest["splits"]}
    write_manifest(folder, manifest)


def _finished(path: Path, fingerprint: str) -> bool:
    """Whether a shard is of this data and needs no other try. A file that was damaged is made again."""
    try:
        card = read_card(path)
    except UserError:
        return False
    return bool(card["fingerprint"] == fingerprint and not card["faults"])


def _manifest(plan: Plan, folder: Path) -> dict[str, Any]:
    """The folder's manifest, a new one if it has none.

    Raises:
        UserError: it is of other data.
    """
    if (folder / MANIFEST).exists():
        manifest = read_manifest(folder)
        if manifest["fingerprint"] != plan.fingerprint:
            raise UserError(
                f"{folder} holds other data (fingerprint {manifest['fingerprint'][:12]}, not {plan.fingerprint[:12]}): "
                f"its objects or settings differ; choose another folder, or delete this one"
            )
        return manifest
    for path in sorted(folder.glob("*-[0-9][0-9][0-9][0-9][0-9].safetensors")):
        # A shard of this data, whose manifest was lost, is of use; anything else is somebody's.
        if read_card(path)["fingerprint"] != plan.fingerprint:
            raise UserError(f"{path} belongs to other data: choose another folder, or delete this one")
    recipe = plan.recipe
    data = recipe.resolved()["data"] | {"touches": recipe.most_touches, "seed": recipe.data_seed}
    manifest = {
        "format": FORMAT,
        "made_by": f"pcsr {pcsr.__version__}",
        "fingerprint": plan.fingerprint,
        "data": data,
        "empty": plan.empty,
        "splits": {},
    }
    write_manifest(folder, manifest)
    return manifest


def _summary(folder: Path, split: str, count: int) -> dict[str, Any]:
    """What the shards of a split hold, for its place in the manifest."""
    shards: list[dict[str, Any]] = []
    rejected: dict[str, str] = {}
    groups: set[str] = set()
    sensors: set[str] = set()
    coverage: list[list[float]] = []
    faults = 0
    for number in range(count):
        path = shard_path(folder, split, number)
        card = read_card(path)
        rejected |= card["rejected"]
        faults += card["faults"]
        groups |= set(card["groups"])
        sensors |= set(card["sensors"])
        coverage += card["coverage"]
        shards.append({"file": path.name, "objects": len(card["names"]), "sha256": sha256(path)})
    shares = np.array(coverage)
    return {
        "objects": len(coverage),
        "groups": len(groups),
        "sensors": sorted(sensors),
        # For 1, 2, … touches: the share of an object that they felt, in the mean and at 10, 50 and 90 % of objects.
        "coverage": [{"touches": k + 1, "mean": float(of.mean()), **_quantiles(of)} for k, of in enumerate(shares.T)]
        if shares.size
        else [],
        "rejected": rejected,
        # Of the rejected, those that are not the objects' doing; they are tried again by the next build.
        "faults": faults,
        "shards": shards,
    }


def _quantiles(shares: np.ndarray) -> dict[str, float]:
    return {f"p{at}": float(value) for at, value in zip((10, 50, 90), np.percentile(shares, (10, 50, 90)), strict=True)}
