"""Reader of weights files: safetensors files with a card in the header. Nothing is unpickled."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from torch import Tensor

from pcsr.errors import UserError

HEADER = 16_000_000
"""Largest header of a weights file in bytes. A hundred thousand tensors need about ten million."""
CARD = 4_000_000
"""Largest card in characters."""
DEPTH = 50
"""Deepest nesting of mappings and lists in a card."""
NONSENSE = (SafetensorError, LookupError, ValueError, TypeError, AttributeError, RuntimeError)
"""Errors that safetensors, json and torch raise for an invalid header, besides `OSError`."""


@contextmanager
def open_tensors(path: Path, longest: int = HEADER) -> Iterator[Any]:
    """Open a safetensors file like `safetensors.safe_open`, if its header has at most `longest` bytes.

    Raises:
        OSError: the file cannot be read.
        ValueError: the header is too long.
        SafetensorError: the file is no safetensors file.
    """
    with path.open("rb") as raw:
        size = int.from_bytes(raw.read(8), "little")
    if longest < size < path.stat().st_size:  # a size beyond the end of the file is no header, which safe_open reports
        raise ValueError(f"its header has {size} bytes, and {longest} are the most")
    with safe_open(path, "pt") as file:
        yield file


def card_text(file: Any) -> str:
    """Return the unparsed card from the header of an open safetensors file.

    Raises:
        ValueError: the header has no card.
    """
    text = (file.metadata() or {}).get("pcsr")
    if text is None:
        raise ValueError("it is a safetensors file without a card of pcsr")
    return str(text)


def read_file(path: Path, *, tensors: bool = True) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read the tensors and the card of a weights file.

    Args:
        path: file to read.
        tensors: whether the tensors are read; otherwise the mapping is empty.

    Returns:
        The tensors in the stored precision, and the card.

    Raises:
        UserError: the file is no weights file of pcsr.
    """
    with _explained(path), open_tensors(path) as file:
        card = parse_card(card_text(file))
        return ({name: file.get_tensor(name) for name in file.keys()} if tensors else {}), card  # noqa: SIM118


def read_card(path: Path) -> dict[str, Any]:
    """Read the card of a weights file without its tensors.

    Raises:
        UserError: the file is no weights file of pcsr.

    Examples:
        >>> card = pcsr.read_card(pcsr.load("tapsr").path)
        >>> card["recipe"]["model"]["fusion"]["use"]
        'iterative'
    """
    return read_file(Path(path), tensors=False)[1]


def read_shapes(path: Path) -> dict[str, tuple[int, ...]]:
    """Read the shapes of the tensors of a weights file without the tensors.

    Raises:
        UserError: the file is no safetensors file.
    """
    with _explained(path), open_tensors(path) as file:
        return {name: tuple(file.get_slice(name).get_shape()) for name in file.keys()}  # noqa: SIM118


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Turn errors at reading a weights file into user errors.

    Raises:
        UserError: there is no such file, or reading it fails within the context.
    """
    if path.is_dir():
        raise UserError(f"{path} is a folder, not a weights file: name the file in it")
    if not path.is_file():
        raise UserError(f"{path}: there is no such weights file")
    try:
        yield
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror or error}") from error
    except NONSENSE as error:
        raise UserError(
            f"{path} is not a weights file of pcsr ({fault(error)}): get it again, or delete it, and `pcsr run` trains "
            f"it again"
        ) from error


def fault(error: Exception) -> str:
    """Return what is wrong with a weights file that raised an error, in words that are not those of a library."""
    if isinstance(error, UnicodeEncodeError):
        return "its card has surrogates, which are no characters"
    own = type(error) is ValueError  # the errors of libraries are of classes derived from it
    return " ".join(str(error).split())[:200] if own else "its header is damaged or cut off, or is that of another file"


def parse_card(written: str) -> dict[str, Any]:
    """Parse a card.

    Raises:
        ValueError: the text is no JSON mapping, is too long, or is nested too deep.
    """
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
    """Return whether plain data are nested deeper than `depth`."""
    inner = node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
    return depth < 0 or any(_deeper(one, depth - 1) for one in inner)


def tensors_hash(tensors: Mapping[str, Tensor]) -> str:
    """Return the SHA-256 hash of the names, types, shapes and bytes of tensors, in the order of their names."""
    digest = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        digest.update(json.dumps([name, str(tensor.dtype), list(tensor.shape)]).encode() + b"\n")
        digest.update(tensor.detach().cpu().reshape(-1).contiguous().view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()
