"""Values of the options of `pcsr upsample`: model, device and number of processes."""

import re
from pathlib import Path
from typing import TYPE_CHECKING

from pcsr.errors import UserError

if TYPE_CHECKING:
    from pcsr.model import Model


def load_model(model: str | None, plugins: tuple[Path, ...], device: str) -> "Model":
    """Load a model.

    Raises:
        UserError: the model or the device cannot be used; the message names the option.
    """
    from pcsr.model import load  # imports torch, so mistakes in files are reported first

    name = checked_device(device)
    try:
        return load(model, plugins=plugins, device=name)
    except UserError as error:
        from pcsr.validation_messages import shown
        from pcsr.weights import DEFAULT

        raise UserError(f"--model {shown(model or DEFAULT)}: {error}") from error


def checked_device(name: str) -> str:
    """Return the device that `--device` names, `auto` resolved.

    Raises:
        UserError: there is no such device.
    """
    import torch

    found = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if name == "auto":
        return "cuda" if found else "cpu"
    if name != "cpu" and not re.fullmatch(r"cuda(:\d{1,3})?", name):
        from pcsr.validation_messages import shown

        raise UserError(f"--device {shown(name)}: pcsr computes on auto, cpu, cuda, or cuda:1 for the second device")
    if name != "cpu" and not found:
        raise UserError(f"--device {name}: torch finds no CUDA device here; use cpu, or install torch for CUDA")
    if name != "cpu" and int(name.partition(":")[2] or 0) >= found:
        raise UserError(f"--device {name}: the last of the CUDA devices here is cuda:{found - 1}")
    return name


def default_jobs(count: int | None, device: str) -> int:
    """Return the default number of processes: all cores for large clouds on the CPU, otherwise 1.

    Args:
        count: number of points; None for a cloud that is read in parts.
        device: value of `--device`.
    """
    import os

    from pcsr.workers import MOST_JOBS

    return min(os.cpu_count() or 1, MOST_JOBS) if (count is None or count > 20_000) and device in ("auto", "cpu") else 1
