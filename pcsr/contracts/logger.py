"""The kind of part that records a training while it runs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pcsr.contracts.part import Part


class Logger(Part):
    """Records the values of a training, such as its losses.

    With several processes only the first one has loggers. An error of a logger does not end the training: it is
    reported once for each logger, and the training continues.

    Examples:
        >>> class Printed(pcsr.Logger):
        ...     def log(self, step, values):
        ...         print(step, values["loss"])
        >>> Printed().log(1, {"loss": 0.5})
        1 0.5
    """

    def start(self, folder: Path, recipe: Mapping[str, Any], step: int) -> None:
        """Begin before the first step of a process. By default this does nothing.

        Args:
            folder: run folder, for the files of the logger.
            recipe: resolved recipe, as plain data.
            step: number of steps already done: 0, or more if an interrupted training is resumed. Values of later
                steps that were logged before the interruption are logged again.
        """

    def log(self, step: int, values: Mapping[str, int | float]) -> None:
        """Record values after a step.

        Args:
            step: number of steps done, from 1.
            values: after each step `loss`, `loss/NAME` for each loss of the objective, `learning_rate`,
                `gradient_norm` if gradients are clipped, `epoch`, `seconds` and `threads`; after each validation
                `validation/cd` and `epoch`.
        """
        raise NotImplementedError

    def finish(self, completed: bool) -> None:
        """End after the last step of a process. By default this does nothing.

        Args:
            completed: False if the training was interrupted or failed.
        """
