"""The file `metrics.jsonl` of a run: a line of JSON for each step and each validation."""

import json
from pathlib import Path
from typing import Any

from pcsr.errors import RunError
from pcsr.files import write_text


class History:
    """The lines of the file. Lines are only appended, except that resuming from a checkpoint removes later ones."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def add(self, line: dict[str, Any]) -> None:
        """Append a line.

        Raises:
            RunError: the disk is full, or the file cannot be written.
        """
        try:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
        except OSError as error:
            raise RunError(f"{self.path} could not be written: {error.strerror}; free some space, run again") from error

    def cut(self, step: int) -> None:
        """Remove the lines after a step, from which training is resumed, and an incomplete last line."""
        if not self.path.exists():
            return
        kept = []
        for line in self.path.read_text(encoding="utf-8", errors="replace").splitlines():
            try:
                if json.loads(line)["step"] <= step:
                    kept.append(line + "\n")
            except ValueError:
                break
        write_text(self.path, "".join(kept))
