"""The data set on disk: a few dozen objects a file, each file whole or not there, read by mapping it into memory.

A folder holds `train-00000.safetensors` and so on, and `manifest.json`, which says what is in them.
"""

import errno
import functools
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError
from torch import Tensor

from pcsr.data.plan import FORMAT
from pcsr.data.sample import Rejected, Sample
from pcsr.data.schema import Card, Formatted, Manifest, Settings, parsed, shard_name
from pcsr.errors import UserError
from pcsr.files import identity, save_tensors, sha256, write_text
from pcsr.geometry.frames import UnitSphere
from pcsr.weights.file import card_text, open_tensors

SHARD = 64
"""Objects in a file: about 9 MB at the paper's size, and at most so much work is lost by a kill."""
MANIFEST = "manifest.json"
CLOUDS = ("truth", "points", "touches")
LONGEST_MANIFEST = 32 << 20
"""Bytes: the shards of some ten million objects."""
LONGEST_HEADER = 8 << 20
"""Bytes: names and reasons of the objects in one shard."""
AGAIN = "run the command that built it again, which makes it anew"
"""What to do about a file that is not as it was written."""


def shard_path(folder: Path, split: str, number: int) -> Path:
    """Where shard `number` of a split lies."""
    return folder / shard_name(split, number)


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
    card = Card(
        fingerprint=fingerprint,
        names=tuple(s.name for s in samples),
        groups=tuple(s.group for s in samples),
        spheres=tuple(_four(s.sphere) for s in samples),
        coverage=tuple(s.coverage for s in samples),
        sensors=tuple(sorted({s.sensor for s in samples})),
        rejected={name: result.reason for name, result in results if isinstance(result, Rejected)},
        faults=sum(isinstance(result, Rejected) and result.fault for _, result in results),
    )
    sizes = {s.touches.shape[1:] for s in samples}
    if len(sizes) > 1:
        raise UserError(f"{path}: touches of {sorted(sizes)} points: a touch source must give all alike")
    tensors = {
        name: torch.from_numpy(np.stack([getattr(s, name) for s in samples]) if samples else np.zeros(0, np.float32))
        for name in CLOUDS
    }
    save_tensors(path, tensors, {"pcsr": json.dumps(card.model_dump(mode="json"), sort_keys=True)})


def _four(sphere: UnitSphere) -> tuple[float, float, float, float]:
    x, y, z = map(float, sphere.centre)
    return x, y, z, float(sphere.radius)


def read_card(path: Path) -> Card:
    """What a shard says of itself, without its clouds.

    Raises:
        UserError: the file is damaged or not a shard.
    """
    try:
        _regular(path)
        with open_tensors(path, LONGEST_HEADER) as file:
            card = parsed(Card, card_text(file))
            _check_clouds(file, card)
    except KeyError as error:
        raise UserError(f"{path} is not a shard of pcsr data (it has no {error}): {AGAIN}") from error
    except (SafetensorError, OSError, ValueError) as error:
        raise UserError(f"{path} is not a shard of pcsr data ({error}): {AGAIN}") from error
    return card


def _regular(path: Path) -> None:
    """Refuse what may never end or never begin, such as a device or a pipe.

    Raises:
        OSError: it is there, but no file.
    """
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "it is no file")


def _check_clouds(file: Any, card: Card) -> None:
    """Refuse clouds that are not those of the objects on the card.

    Raises:
        KeyError, SafetensorError: some are missing.
        ValueError: they are of another type or shape.
    """
    missing = set(CLOUDS) - set(file.keys())
    if missing:
        raise KeyError(min(missing))
    touches = {len(shares) for shares in card.coverage}
    if len(touches) > 1:
        raise ValueError(f"its coverage is of {' and '.join(map(str, sorted(touches)))} touches")
    for name in CLOUDS:
        cloud = file.get_slice(name)
        kind, shape = cloud.get_dtype(), cloud.get_shape()
        wanted = [len(card.names), *touches] if name == "touches" else [len(card.names)]
        if kind != "F32":
            raise ValueError(f"its {name} are {kind}, a shard's are F32")
        if card.names and (shape[:-2] != wanted or shape[-1] != 3):
            raise ValueError(f"its {name} are of shape {tuple(shape)}, for {len(card.names)} objects")


def read_clouds(path: Path) -> dict[str, Tensor]:
    """The clouds of a shard, mapped into memory: what is not looked at is not read."""
    with open_tensors(path) as file:
        return {name: file.get_tensor(name) for name in CLOUDS}


def shard_sum(path: Path) -> str:
    """SHA-256 of a file; in one process it is read once, unless it changes."""
    return _sum(path.resolve(), identity(path))


@functools.cache
def _sum(path: Path, _identity: tuple[int, ...] | None) -> str:
    return sha256(path)


def checked_shard(folder: Path, manifest: Manifest, split: str, number: int) -> tuple[Card, dict[str, Tensor]]:
    """One shard of a split, held against the manifest: it is read whole, once in a process.

    Returns:
        Its card, and its clouds as `read_clouds` gives them.

    Raises:
        UserError: it is missing, belongs to other data, or is not as it was when it was built.
    """
    shard = manifest.splits[split].shards[number]
    path = folder / shard.file
    if not path.is_file():
        raise UserError(f"{path} is missing: {AGAIN}")
    card = read_card(path)
    if card.fingerprint != manifest.fingerprint:
        raise UserError(f"{path} belongs to other data than {folder / MANIFEST}: {AGAIN}")
    if shard_sum(path) != shard.sha256:
        raise UserError(f"{path} has changed since it was built, its hash is not that in {MANIFEST}: {AGAIN}")
    clouds = read_clouds(path)
    if len(card.names) != shard.objects:
        raise UserError(f"{path} holds {len(card.names)} objects, {MANIFEST} says {shard.objects}: {AGAIN}")
    if card.names:
        _check_sizes(path, clouds, manifest.data)
    return card, clouds


def _check_sizes(path: Path, clouds: dict[str, Tensor], data: Settings) -> None:
    wanted = {"truth": data.points * data.rate, "points": data.points, "touches": data.touches}
    for name, cloud in clouds.items():
        if cloud.shape[1] != wanted[name]:
            raise UserError(
                f"{path}: its {name} are {cloud.shape[1]} an object, {MANIFEST} says {wanted[name]}: {AGAIN}"
            )
        if cloud.numel() and not torch.stack(torch.aminmax(cloud)).isfinite().all():
            raise UserError(f"{path}: its {name} have a coordinate that is not finite: {AGAIN}")


def damaged(folder: Path, manifest: Manifest, advance: Callable[[int], None] = lambda count: None) -> tuple[str, ...]:
    """What is wrong with the shards of a folder, a line for each that is missing or not as it was built.

    Args:
        folder: the data set.
        manifest: what its manifest says.
        advance: called with the number of objects in a shard that was read.
    """
    found = []
    for split, about in manifest.splits.items():
        for number, shard in enumerate(about.shards):
            try:
                checked_shard(folder, manifest, split, number)
            except UserError as error:
                found.append(str(error))
            advance(shard.objects)
    return tuple(found)


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write `manifest.json` whole."""
    write_text(folder / MANIFEST, json.dumps(manifest.model_dump(mode="json"), indent=1) + "\n")


def read_manifest(folder: Path) -> Manifest:
    """What `manifest.json` says.

    Raises:
        UserError: there is none, or it is not one of pcsr's, or of another version's format.
    """
    path = folder / MANIFEST
    again = "delete it and build again, which keeps the shards that are finished"
    try:
        _regular(path)
        with path.open("rb") as file:
            text = file.read(LONGEST_MANIFEST + 1)
        if len(text) > LONGEST_MANIFEST:
            raise ValueError(f"it has more than {LONGEST_MANIFEST} bytes")
        form = parsed(Formatted, text).format
        manifest = parsed(Manifest, text) if form == FORMAT else None
    except FileNotFoundError as error:
        raise UserError(f"{folder} holds no {MANIFEST}: give a folder that `pcsr data make` built") from error
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise UserError(f"{path} is not a manifest of pcsr data: {error}; {again}") from error
    if manifest is None:
        raise UserError(f"{path} has format {form}, this version of pcsr reads {FORMAT}: build the data again")
    return manifest
