"""The logger `jsonl`: history of a training in `metrics.jsonl`, a line for each step and each validation."""

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from pcsr.contracts import Logger
from pcsr.errors import RunError
from pcsr.files import write_text
from pcsr.run_files import HISTORY

LOSS, VALIDATION = "loss/", "validation/"
"""Prefixes of the values that a line groups under `losses` and `validation`."""


class JsonLines(Logger):
    """JSON lines in `metrics.jsonl`, from which reports and figures show the training."""

    def start(self, folder: Path, recipe: Mapping[str, Any], step: int) -> None:
        """Remove the lines of later steps and an incomplete last line."""
        self.path = folder / HISTORY
        if not self.path.exists():
            return
        kept = []
        for line in self.path.read_text(encoding="utf-8", errors="replace").splitlines():
            try:
                if json.loads(line)["step"] <= step:
                    kept.append(line + "\n")
            except (ValueError, KeyError, TypeError, RecursionError):
                break
        write_text(self.path, "".join(kept))

    def log(self, step: int, values: Mapping[str, int | float]) -> None:
        """Append a line.

        Raises:
            RunError: the disk is full, or the file cannot be written. The file then ends with its last whole line.
        """
        line = json.dumps(_line(step, values)) + "\n"
        size = self.path.stat().st_size if self.path.exists() else 0
        try:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(line)
        except OSError as error:
            with suppress(OSError):
                os.truncate(self.path, size)
            raise RunError(f"{self.path} could not be written: {error.strerror}") from error


def _line(step: int, values: Mapping[str, int | float]) -> dict[str, Any]:
    """Return a line in the form that `pcsr.run_files.read_history` reads."""
    if errors := _group(values, VALIDATION):
        return {"epoch": values["epoch"], "step": step, "validation": errors}
    clipped = {key: values[key] for key in ("gradient_norm",) if key in values}
    return {
        "step": step,
        "epoch": values["epoch"],
        "loss": values["loss"],
        "losses": _group(values, LOSS),
        "rate": values["learning_rate"],
        **clipped,
        "seconds": values["seconds"],
        "threads": values["threads"],
    }


def _group(values: Mapping[str, int | float], prefix: str) -> dict[str, int | float]:
    """Return the values whose names begin with a prefix, without it."""
    return {name.removeprefix(prefix): value for name, value in values.items() if name.startswith(prefix)}
