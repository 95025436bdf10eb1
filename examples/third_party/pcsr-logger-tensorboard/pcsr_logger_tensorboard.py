"""The logger `tensorboard`: event files for TensorBoard in the run's folder."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pcsr import Logger, Register, hookimpl

FOLDER = "tensorboard"
"""Folder of the event files within the run's folder."""


class TensorBoard(Logger):
    """Scalars by step, and the recipe as text."""

    needs = frozenset({"tensorboard"})

    def start(self, folder: Path, recipe: Mapping[str, Any], step: int) -> None:
        """Open an event file. Values of later steps, from before an interruption, are hidden."""
        from torch.utils.tensorboard import SummaryWriter

        self.writer = SummaryWriter(str(folder / FOLDER), purge_step=step + 1)
        if step == 0:
            self.writer.add_text("recipe", f"```json\n{json.dumps(recipe, indent=1)}\n```")

    def log(self, step: int, values: Mapping[str, float]) -> None:
        """Write a scalar for each value."""
        for name, value in values.items():
            self.writer.add_scalar(name, value, step)

    def finish(self, completed: bool) -> None:
        """Close the event file."""
        self.writer.close()


@hookimpl
def pcsr_register(register: Register) -> None:
    """Register the part."""
    register.logger("tensorboard", TensorBoard)
