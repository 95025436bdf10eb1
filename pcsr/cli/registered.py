"""Output about the registration of touches: the table, the refused touches, and the file of `--touch-report`."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pcsr.cli import streams

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float
    from rich.console import Console
    from rich.progress import Progress

    from pcsr.recorded import Recording
    from pcsr.registration import Registration

MOST_ROWS = 20
"""Most touches in the table of a command whose result is another."""


class RegistrationOutput:
    """Output about the touches of a recording, once they are registered.

    Args:
        recording: the recording.
        console: console for the table.
        report: file of the report; None for none.
        most: most rows of the table; None for all.
    """

    def __init__(
        self, recording: "Recording", console: "Console", report: Path | None, most: int | None = MOST_ROWS
    ) -> None:
        self.recording, self.console, self.report, self.most = recording, console, report, most
        self.used = len(recording.touches)
        """Number of touches that are not refused."""
        self.all = len(recording.touches) + len(recording.skipped)
        """Number of touches of the recording."""

    def register(
        self, cloud: "Float[np.ndarray, 'n 3']", progress: "Progress", *, as_is: bool
    ) -> "Registration | Sequence[object]":
        """Register the touches to a cloud, print the output, and return what `Model.upsample` takes."""
        from pcsr.touches import GivenTouches

        touches = self.recording.touches
        if not touches:
            return touches
        given = GivenTouches(list(touches), list(self.recording.names), self.recording.pose_error, as_is=False)
        given = given.in_frame(cloud)
        self.used = len(given.touches)
        self.recording = replace(self.recording, touches=given.to_register, names=given.names)
        if as_is:
            return given.touches
        task = progress.add_task("registering touches", total=None)
        registration = given.registration(cloud)
        progress.remove_task(task)
        assert registration is not None
        self(registration)
        return registration

    def __call__(self, registration: "Registration") -> None:
        """Print the table and the refused touches, and write the report."""
        from pcsr.registration.report import document, table

        names, touches = self.recording.names, self.recording.touches
        self._print(table(names, touches, registration))
        for name, one in zip(names, registration.touches, strict=True):
            if one.verdict == "refused":  # also with --quiet
                click.echo(f"touch {name} is refused: {one.reason}", err=True)
                self.used -= 1
        if self.report is not None:
            from pcsr.files import write_text

            plain = document(names, touches, registration)
            write_text(self.report, json.dumps(plain, indent=1, allow_nan=False, ensure_ascii=False) + "\n")

    def _print(self, rows: "list[tuple[str, ...]]") -> None:
        from pcsr.registration.report import HEADS, NUMBERS

        if self.console.quiet:
            return
        shown = rows[: self.most]
        caption = f"and {len(rows) - len(shown)} more touches" if len(rows) > len(shown) else None
        streams.print_table(self.console, HEADS, shown, NUMBERS, caption)
