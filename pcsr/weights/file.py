"""Reading a weights file: tensors, and the card that says what they are. Nothing is unpickled."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from torch import Tensor

from pcsr.errors import UserError

HEADER = 16_000_000
"""Most bytes of a safetensors header: a hundred thousand weights have about ten million."""
CARD = 4_000_000
"""Most characters of a card."""
DEPTH = 50
"""Mappings and lists inside of each other in a card."""


def read_file(path: Path, *, tensors: bool = True) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """The tensors of a weights file as they are stored, and its card.

    Args:
        path: the file.
        tensors: False: the card alone, without reading the weights.

    Raises:
        UserError: it is no weights file of pcsr.
    """
    with _opened(path) as file:
        card = _card((file.metadata() or {}).get("pcsr"))
        return ({name: file.get_tensor(name) for name in file.keys()} if tensors else {}), card  # noqa: SIM118


def read_shapes(path: Path) -> dict[str, tuple[int, ...]]:
    """The shapes of the tensors in a weights file, without reading them.

    Raises:
        UserError: it is no safetensors file.
    """
    with _opened(path) as file:
        return {name: tuple(file.get_slice(name).get_shape()) for name in file.keys()}  # noqa: SIM118


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """A safetensors file whose header is of a reasonable size.

    Raises:
        UserError: it is none, or what is done with it fails.
    """
    if path.is_dir():
        raise UserError(f"{path} is a folder, not a weights file: name the file in it")
    if not path.is_file():
        raise UserError(f"{path}: there is no such weights file")
    try:
        with path.open("rb") as raw:
            size = int.from_bytes(raw.read(8), "little")
        if HEADER < size < path.stat().st_size:  # one that is longer than the file is no header at all
            raise ValueError(f"its header has {size} bytes, and {HEADER} are the most")
        with safe_open(path, "pt") as file:
            yield file
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror or error}") from error
    # A nonsensical header reaches safetensors, json and torch, each with errors of its own.
    except (SafetensorError, LookupError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        said = " ".join(str(error).split())[:200] or type(error).__name__
        raise UserError(
            f"{path} is not a weights file of pcsr ({said}): get it again, or delete it, and `pcsr run` trains it again"
        ) from error


def _card(written: str | None) -> dict[str, Any]:
    """The card that a header holds.

    Raises:
        ValueError: there is none, or it is no plain data of reasonable size.
    """
    if written is None:
        raise ValueError("it is a safetensors file of somebody else, without a card of pcsr")
    if len(written) > CARD:
        raise ValueError(f"its card has {len(written)} characters, and {CARD} are the most")
    try:
        card = json.loads(written, parse_constant=_refuse)
        json.dumps(card, ensure_ascii=False).encode()  # half of a surrogate pair cannot be written or shown
    except RecursionError:
        card = None
    if card is None or _deeper(card, DEPTH):
        raise ValueError(f"its card is nested more than {DEPTH} deep")
    if not isinstance(card, dict):
        raise ValueError(f"its card is a {type(card).__name__}, not a mapping")
    return card


def _refuse(constant: str) -> None:
    raise ValueError(f"its card holds {constant}, which is no number")


def _deeper(node: Any, depth: int) -> bool:
    """Whether plain data are nested deeper than that."""
    inner = node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
    return depth < 0 or any(_deeper(one, depth - 1) for one in inner)
