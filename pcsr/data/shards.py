"""The data set on disk: a few dozen objects a file, each file whole or not there, read by mapping it into memory.

A folder holds `train-00000.safetensors` and so on, and `manifest.json`, which says what is in them.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from torch import Tensor

from pcsr.data.plan import FORMAT
from pcsr.data.sample import Rejected, Sample
from pcsr.errors import UserError
from pcsr.files import save_tensors, sha256, write_text

SHARD = 64
"""Objects in a file: about 9 MB at the paper's size, and at most so much work is lost by a kill."""
MANIFEST = "manifest.json"
CLOUDS = ("truth", "points", "touches")


def shard_path(folder: Path, split: str, number: int) -> Path:
    """Where shard `number` of a split lies."""
    return folder / f"{split}-{number:05d}.safetensors"


def write_shard(path: Path, results: Sequence[tuple[str, Sample | Rejected]], fingerprint: str) -> None:
    """Write some objects, and the reasons of those that could not be used.

    Args:
        path: of the file.
        results: each object's name with its sample, or the reason why there is none.
        fingerprint: of the plan that they belong to.

    Raises:
        UserError: touches of different sizes.
    """
    samples = [result for _, result in results if isinstance(result, Sample)]
    card = {
        "fingerprint": fingerprint,
        "names": [s.name for s in samples],
        "groups": [s.group for s in samples],
        "spheres": [[*map(float, s.sphere.centre), float(s.sphere.radius)] for s in samples],
        "coverage": [s.coverage for s in samples],
        "sensors": sorted({s.sensor for s in samples}),
        "rejected": {name: result.reason for name, result in results if isinstance(result, Rejected)},
        "faults": sum(isinstance(result, Rejected) and result.fault for _, result in results),
    }
    sizes = {s.touches.shape[1:] for s in samples}
    if len(sizes) > 1:
        raise UserError(f"{path}: touches of {sorted(sizes)} points: a touch source must give all alike")
    tensors = {
        name: torch.from_numpy(np.stack([getattr(s, name) for s in samples]) if samples else np.zeros(0, np.float32))
        for name in CLOUDS
    }
    save_tensors(path, tensors, {"pcsr": json.dumps(card, sort_keys=True)})


def read_card(path: Path) -> dict[str, Any]:
    """What a shard says of itself, without its clouds.

    Raises:
        UserError: the file is damaged or not a shard.
    """
    try:
        with safe_open(path, "pt") as file:
            card: dict[str, Any] = json.loads(file.metadata()["pcsr"])
            card["fingerprint"], card["names"], card["rejected"]
    except (SafetensorError, OSError, KeyError, TypeError, ValueError) as error:
        raise UserError(f"{path} is not a shard of pcsr data ({error}): delete it and build again") from error
    return card


def read_clouds(path: Path) -> dict[str, Tensor]:
    """The clouds of a shard, mapped into memory: what is not looked at is not read."""
    with safe_open(path, "pt") as file:
        return {name: file.get_tensor(name) for name in CLOUDS}


def check_sums(folder: Path, manifest: dict[str, Any]) -> None:
    """Read every shard once, to be sure that it is as it was written.

    Raises:
        UserError: one is missing, or has changed since.
    """
    for about in manifest["splits"].values():
        for shard in about["shards"]:
            path = folder / shard["file"]
            if not path.is_file() or sha256(path) != shard["sha256"]:
                raise UserError(f"{path} is missing or has changed since it was built: delete it and build again")


def write_manifest(folder: Path, manifest: dict[str, Any]) -> None:
    """Write `manifest.json` whole."""
    write_text(folder / MANIFEST, json.dumps(manifest, indent=1) + "\n")


def read_manifest(folder: Path) -> dict[str, Any]:
    """What `manifest.json` says.

    Raises:
        UserError: there is none, or it is not one of pcsr's, or of another version's format.
    """
    path = folder / MANIFEST
    try:
        manifest: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        form = manifest["format"]
        if form == FORMAT:
            manifest["fingerprint"] = str(manifest["fingerprint"])
            for key in ("splits", "data"):
                manifest[key] = dict(manifest[key])
    except FileNotFoundError as error:
        raise UserError(f"{folder} holds no {MANIFEST}: give a folder that `pcsr data make` built") from error
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise UserError(f"{path} is not a manifest of pcsr data ({type(error).__name__}: {error})") from error
    if form != FORMAT:
        raise UserError(f"{path} has format {form}, this version of pcsr reads {FORMAT}: build the data again")
    return manifest
