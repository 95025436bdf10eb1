"""The logger `wandb`: trainings in Weights & Biases."""

import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pcsr import Logger, Register, hookimpl

ID = "wandb-id.txt"
"""File in the run's folder with the identifier of the run in Weights & Biases."""


class WandB(Logger):
    """A run of Weights & Biases, which goes on where the training does."""

    needs = frozenset({"wandb"})

    def __init__(
        self,
        *,
        project: str = "pcsr",
        entity: str | None = None,
        mode: Literal["online", "offline", "disabled"] = "online",
    ) -> None:
        """Create the logger.

        Args:
            project: project of the run.
            entity: user or team; None: the default of the account.
            mode: "offline" writes files, which `wandb sync` sends later.
        """
        self.project, self.entity, self.mode = project, entity, mode

    def start(self, folder: Path, recipe: Mapping[str, Any], step: int) -> None:
        """Begin a run, or go on with that of an interrupted training.

        Values of the steps that are trained again are the same, and Weights & Biases ignores them.
        """
        import wandb

        file = folder / ID
        identifier = file.read_text().strip() if step and file.exists() else uuid.uuid4().hex[:16]
        file.write_text(identifier + "\n")
        self.run = wandb.init(
            project=self.project,
            entity=self.entity,
            name=recipe["name"],
            id=identifier,
            resume="allow",
            dir=str(folder),
            config=dict(recipe),
            mode=self.mode,
        )

    def log(self, step: int, values: Mapping[str, float]) -> None:
        """Send the values."""
        self.run.log(dict(values), step=step)

    def finish(self, completed: bool) -> None:
        """End the run, as failed if the training was interrupted."""
        self.run.finish(exit_code=0 if completed else 1)


@hookimpl
def pcsr_register(register: Register) -> None:
    """Register the part."""
    register.logger("wandb", WandB)
