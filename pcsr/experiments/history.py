"""History of a training, `metrics.jsonl`: one line for each step and each validation."""

import json
from pathlib import Path
from typing import Any

from pcsr.errors import RunError
from pcsr.files import write_text


class History:
    """File of JSON lines to which training appends."""

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
        """Remove the lines after a step, from whose checkpoint training goes on, and an incomplete last line."""
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
