"""Files of a data set: shards of a few dozen objects each, written atomically and read by memory mapping.

A folder contains `train-00000.safetensors` and so on, and `manifest.json`, which describes them.
"""

import errno
import functools
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from safetensors import SafetensorError
from torch import Tensor

from pcsr.data.plan import FORMAT
from pcsr.data.sample import Rejection, Sample
from pcsr.data.schema import Card, FormatVersion, Manifest, Settings, parsed, shard_name
from pcsr.errors import UserError
from pcsr.files import identity, save_tensors, sha256, write_text
from pcsr.geometry.frames import UnitSphere
from pcsr.weights.file import card_text, open_tensors

SHARD = 64
"""Number of objects in a shard: about 9 MB at the paper's sizes. An interrupted build loses at most this many."""
MANIFEST = "manifest.json"
CLOUDS = ("truth", "points", "touches")
"""Names of a shard's tensors."""
LONGEST_MANIFEST = 32 << 20
"""Greatest size of a manifest in bytes, enough for ten million objects."""
LONGEST_HEADER = 8 << 20
"""Greatest size of a shard's header in bytes; it holds names and reasons."""
REMEDY = "run the command that built it again, which rebuilds this file"
"""Remedy in messages about damaged files."""


def shard_path(folder: Path, split: str, number: int) -> Path:
    """Return the path of shard `number` of a split."""
    return folder / shard_name(split, number)


def write_shard(path: Path, results: Sequence[tuple[str, Sample | Rejection]], fingerprint: str) -> None:
    """Write a shard.

    Args:
        path: file to write.
        results: name of each object, with its sample or the reason for its rejection.
        fingerprint: fingerprint of the data set.

    Raises:
        UserError: touches differ in their number of points.
    """
    samples = [result for _, result in results if isinstance(result, Sample)]
    card = Card(
        fingerprint=fingerprint,
        names=tuple(s.name for s in samples),
        groups=tuple(s.group for s in samples),
        spheres=tuple(_four(s.sphere) for s in samples),
        coverage=tuple(s.coverage for s in samples),
        sensors=tuple(sorted({s.sensor for s in samples})),
        rejected={name: result.reason for name, result in results if isinstance(result, Rejection)},
        faults=sum(isinstance(result, Rejection) and result.fault for _, result in results),
    )
    sizes = {s.touches.shape[1:] for s in samples}
    if len(sizes) > 1:
        raise UserError(f"{path}: touches of {sorted(sizes)} points: a touch source must return touches of equal size")
    clouds = {
        "truth": [s.truth for s in samples],
        "points": [s.points for s in samples],
        "touches": [_padded(s.touches, len(s.coverage)) for s in samples],
    }
    tensors = {
        name: torch.from_numpy(np.stack(clouds[name]) if samples else np.zeros(0, np.float32)) for name in CLOUDS
    }
    save_tensors(path, tensors, {"pcsr": json.dumps(card.model_dump(mode="json"), sort_keys=True)})


def _padded(touches: Float[np.ndarray, "u m 3"], count: int) -> Float[np.ndarray, "a m 3"]:
    """Append touches of NaN in the place of those that could not be registered."""
    missing = np.full((count - len(touches), *touches.shape[1:]), np.nan, np.float32)
    return np.concatenate([touches, missing])


def _four(sphere: UnitSphere) -> tuple[float, float, float, float]:
    x, y, z = map(float, sphere.centre)
    return x, y, z, float(sphere.radius)


def read_card(path: Path) -> Card:
    """Read the card of a shard, without its clouds.

    Raises:
        UserError: the file is damaged, or not a shard.
    """
    try:
        _regular(path)
        with open_tensors(path, LONGEST_HEADER) as file:
            card = parsed(Card, card_text(file))
            _check_clouds(file, card)
    except KeyError as error:
        raise UserError(f"{path} is not a shard of pcsr data (it has no {error}): {REMEDY}") from error
    except (SafetensorError, OSError, ValueError) as error:
        raise UserError(f"{path} is not a shard of pcsr data ({error}): {REMEDY}") from error
    return card


def _regular(path: Path) -> None:
    """Check that a path is not a device or pipe, whose reading may never end.

    Raises:
        OSError: the path exists, but is no regular file.
    """
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "it is no regular file")


def _check_clouds(file: Any, card: Card) -> None:
    """Check that the tensors of a shard match its card.

    Raises:
        KeyError, SafetensorError: a tensor is missing.
        ValueError: a tensor has the wrong type or shape.
    """
    missing = set(CLOUDS) - set(file.keys())
    if missing:
        raise KeyError(min(missing))
    touches = {len(shares) for shares in card.coverage}
    if len(touches) > 1:
        raise ValueError(f"its coverage lists {' and '.join(map(str, sorted(touches)))} touches")
    for name in CLOUDS:
        cloud = file.get_slice(name)
        kind, shape = cloud.get_dtype(), cloud.get_shape()
        wanted = [len(card.names), *touches] if name == "touches" else [len(card.names)]
        if kind != "F32":
            raise ValueError(f"its {name} are {kind} instead of F32")
        if card.names and (shape[:-2] != wanted or shape[-1] != 3):
            raise ValueError(f"its {name} have shape {tuple(shape)}, for {len(card.names)} objects")


def read_clouds(path: Path) -> dict[str, Tensor]:
    """Read the clouds of a shard. The file is mapped into memory, so unused clouds are not read."""
    with open_tensors(path) as file:
        return {name: file.get_tensor(name) for name in CLOUDS}


def shard_sum(path: Path) -> str:
    """Return the SHA-256 hash of a file. A process reads the file once, unless it changes."""
    return _sum(path.resolve(), identity(path))


@functools.cache
def _sum(path: Path, _identity: tuple[int, ...] | None) -> str:
    return sha256(path)


def checked_shard(folder: Path, manifest: Manifest, split: str, number: int) -> tuple[Card, dict[str, Tensor]]:
    """Read a shard and check it against the manifest, including its hash.

    Returns:
        The card, and the memory-mapped clouds.

    Raises:
        UserError: the shard is missing, belongs to another data set, or has changed since it was built.
    """
    shard = manifest.splits[split].shards[number]
    path = folder / shard.file
    if not path.is_file():
        raise UserError(f"{path} is missing: {REMEDY}")
    card = read_card(path)
    if card.fingerprint != manifest.fingerprint:
        raise UserError(f"{path} belongs to other data than {folder / MANIFEST}: {REMEDY}")
    if shard_sum(path) != shard.sha256:
        raise UserError(f"{path} has changed since it was built, its hash differs from {MANIFEST}: {REMEDY}")
    clouds = read_clouds(path)
    if len(card.names) != shard.objects:
        raise UserError(f"{path} holds {len(card.names)} objects, but {MANIFEST} lists {shard.objects}: {REMEDY}")
    if card.names:
        _check_sizes(path, clouds, manifest.data)
    return card, clouds


def _check_sizes(path: Path, clouds: dict[str, Tensor], data: Settings) -> None:
    wanted = {"truth": data.points * data.rate, "points": data.points, "touches": data.touches}
    for name, cloud in clouds.items():
        if cloud.shape[1] != wanted[name]:
            raise UserError(
                f"{path}: '{name}' has {cloud.shape[1]} rows for each object, but {MANIFEST} lists {wanted[name]}: "
                f"{REMEDY}"
            )
        if name == "touches" and data.registered:
            cloud = torch.cat([present(touches) for touches in cloud])
        if cloud.numel() and not torch.stack(torch.aminmax(cloud)).isfinite().all():
            raise UserError(f"{path}: its {name} have a coordinate that is not finite: {REMEDY}")


def present(touches: Float[Tensor, "a m 3"]) -> Float[Tensor, "u m 3"]:
    """Return the touches of an object without those that could not be registered: the last ones, of NaN alone."""
    return touches[: int((~touches.isnan().flatten(1).all(1)).sum())]


def damaged(folder: Path, manifest: Manifest, advance: Callable[[int], None] = lambda count: None) -> tuple[str, ...]:
    """Check all shards of a data set, and return a message for each that is missing or damaged.

    Args:
        folder: folder of the data set.
        manifest: its manifest.
        advance: called with the number of objects of each shard that was checked.
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
    """Write `manifest.json` atomically."""
    write_text(folder / MANIFEST, json.dumps(manifest.model_dump(mode="json"), indent=1) + "\n")


def read_manifest(folder: Path) -> Manifest:
    """Read `manifest.json`.

    Raises:
        UserError: the file does not exist, is not a manifest of pcsr, or has the format of another version.
    """
    path = folder / MANIFEST
    remedy = "delete it and build again, which keeps finished shards"
    try:
        _regular(path)
        with path.open("rb") as file:
            text = file.read(LONGEST_MANIFEST + 1)
        if len(text) > LONGEST_MANIFEST:
            raise ValueError(f"it has more than {LONGEST_MANIFEST} bytes")
        form = parsed(FormatVersion, text).format
        manifest = parsed(Manifest, text) if form == FORMAT else None
    except FileNotFoundError as error:
        raise UserError(f"{folder} holds no {MANIFEST}: give a folder that `pcsr data make` built") from error
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise UserError(f"{path} is not a manifest of pcsr data: {error}; {remedy}") from error
    if manifest is None:
        raise UserError(f"{path} has format {form}, and this version of pcsr reads {FORMAT}: build the data again")
    return manifest
