"""Reading a weights file: tensors, and the card that says what they are. Nothing is unpickled."""

import json
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from torch import Tensor

from pcsr.errors import UserError


def read_file(path: Path, *, tensors: bool = True) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """The tensors of a weights file as they are stored, and its card.

    Args:
        path: the file.
        tensors: False: the card alone, without reading the weights.

    Raises:
        UserError: it is no weights file of pcsr.
    """
    if path.is_dir():
        raise UserError(f"{path} is a folder, not a weights file: name the file in it")
    if not path.is_file():
        raise UserError(f"{path}: there is no such weights file")
    try:
        with safe_open(path, "pt") as file:
            written = (file.metadata() or {}).get("pcsr")
            if written is None:
                raise ValueError("it is a safetensors file of somebody else, without a card of pcsr")
            card = json.loads(written)
            if not isinstance(card, dict):
                raise ValueError(f"its card is a {type(card).__name__}, not a mapping")
            return ({name: file.get_tensor(name) for name in file.keys()} if tensors else {}), card  # noqa: SIM118
    # A nonsensical header reaches safetensors, json and torch, each with errors of its own.
    except (SafetensorError, OSError, LookupError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        said = " ".join(str(error).split()) or type(error).__name__
        raise UserError(
            f"{path} is not a weights file of pcsr ({said}): get it again, or delete it, and `pcsr run` trains it again"
        ) from error
