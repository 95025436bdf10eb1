"""Run folders as they are on disk: finished, unfinished or damaged, with their recipe, results, age and size."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import Any

from pcsr.errors import UserError
from pcsr.recipe.part_keys import NETWORK_KEYS, PARTS
from pcsr.results import Results, read_object, read_results, read_text
from pcsr.run_files import EXAMPLES, HISTORY, RECIPE, REPORT, RESULTS, check_run_folder, is_run_folder
from pcsr.weights import WEIGHTS

FINISHED, UNFINISHED, DAMAGED = "finished", "unfinished", "damaged"
SHORT_KEYS = {str(keys[-1]): ".".join(map(str, keys)) for keys in PARTS if len(keys) == 2}
"""Short names of the keys of parts, such as `fusion` for `model.fusion`."""


@dataclass(frozen=True)
class RunFolder:
    """Run folder, whatever its state."""

    folder: Path
    state: str
    """`FINISHED`, `UNFINISHED` or `DAMAGED`."""
    remark: str
    """How far an unfinished run is, or what is damaged; empty for a finished run."""
    recipe: dict[str, Any]
    """Resolved recipe; empty if it cannot be read."""
    results: Results | None
    """Results of a run that was evaluated."""

    @classmethod
    def read(cls, folder: Path) -> "RunFolder":
        """Read a run folder. What cannot be read is described in `remark`.

        Raises:
            UserError: the folder is no run folder.
        """
        check_run_folder(folder)
        try:
            if (folder / RESULTS).exists():
                results = read_results(folder / RESULTS)
                whole = (folder / EXAMPLES).exists()
                remark = "" if whole else f"{EXAMPLES} is missing"
                return cls(folder, FINISHED if whole else DAMAGED, remark, results.recipe, results)
            return cls(folder, UNFINISHED, _progress(folder), _recipe(folder), None)
        except UserError as error:
            return cls(folder, DAMAGED, str(error), {}, None)

    @cached_property
    def size(self) -> int:
        """Size of all files in bytes."""
        return sum(path.lstat().st_size for path in self.folder.rglob("*") if not path.is_dir())

    @cached_property
    def changed(self) -> float:
        """Time of the last change of a file other than the report, in seconds since 1970."""
        files = [path for path in self.folder.iterdir() if path.is_file() and path.name != REPORT]
        times = [path.lstat().st_mtime for path in files]
        return max(times, default=self.folder.stat().st_mtime)

    @property
    def parts(self) -> dict[str, str]:
        """Names of the parts and of a foreign network by dotted key.

        Third-party ones have the hash of their code: ``nearest#1f0c8e2b7a90``.
        """
        code = self.recipe.get("code", {})
        named = {}
        for key in (".".join(map(str, keys)) for keys in (*PARTS, NETWORK_KEYS)):
            part = self.value(key)
            if isinstance(part, str):
                mark = code.get(key) if isinstance(code, dict) else None
                named[key] = part if mark is None or str(mark).startswith("version") else f"{part}#{mark}"
        return named

    @property
    def means(self) -> dict[str, float]:
        """Mean of each metric of the run's own network, multiplied by the metric's scale."""
        if self.results is None:
            return {}
        values = self.results.methods[0].values
        return {
            metric: note.scale * sum(values[metric]) / len(values[metric])
            for metric, note in self.results.metrics.items()
        }

    def value(self, key: str) -> Any:
        """Return a fact by name, a metric, or a setting of the recipe by its dotted key; None if there is none.

        The value of a part is its name.
        """
        match key:
            case "name":
                return self.folder.name
            case "state":
                return self.state
            case "age":
                return -self.changed
            case "size":
                return self.size
            case "version":
                return self.results and self.results.version
        if key in self.means:
            return self.means[key]
        found: Any = self.recipe
        for step in SHORT_KEYS.get(key, key).split("."):
            found = found.get(step) if isinstance(found, dict) else None
        return found.get("use") if isinstance(found, dict) and "use" in found else found

    def matches(self, key: str, pattern: str) -> bool:
        """Whether the text of a value matches a pattern of the shell, such as `smoke-*`.

        A name is that of the folder or of the recipe; a part may be written with the hash of its code, as in `parts`.
        """
        value = self.value(key)
        text = "" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
        other = self.recipe.get("name") if key == "name" else self.parts.get(SHORT_KEYS.get(key, key))
        return fnmatchcase(text, pattern) or (isinstance(other, str) and fnmatchcase(other, pattern))


def run_folders(runs: Path) -> list[RunFolder]:
    """Read the run folders of a folder, in the order of their names.

    Raises:
        UserError: the folder does not exist or cannot be read.
    """
    try:
        inside = sorted(path for path in runs.iterdir() if path.is_dir() and path.name[0] != ".")
    except OSError as error:
        raise UserError(f"the folder of runs, {runs}, cannot be read: {error.strerror}; name it with --runs") from error
    return [RunFolder.read(path) for path in inside if is_run_folder(path)]


def find_runs(named: Path, runs: Path) -> list[Path]:
    """Return the run folders that a pattern of the shell matches, such as `smoke-*`, or that of `find_run`.

    Raises:
        UserError: there is none, or several begin like that.
    """
    if not set(str(named)) & set("*?[") or named.is_dir() or (runs / named).is_dir():
        return [find_run(named, runs)]
    inside = sorted(path for path in runs.iterdir() if is_run_folder(path)) if runs.is_dir() else []
    found = [path for path in inside if fnmatchcase(path.name, str(named)) or fnmatchcase(str(path), str(named))]
    if not found:
        raise UserError(f"no run in {runs} matches '{named}': pcsr runs lists the runs")
    return found


def find_run(named: Path, runs: Path) -> Path:
    """Return the run folder that is named by its path, by its name in a folder of runs, or by the name's beginning.

    Raises:
        UserError: there is none, or several begin like that.
    """
    for path in (named, runs / named):
        if path.is_dir():
            return path
    inside = [path.name for path in runs.iterdir() if is_run_folder(path)] if runs.is_dir() else []
    found = sorted(name for name in inside if name.startswith(str(named)))
    if len(found) > 1:
        raise UserError(f"{len(found)} runs begin with '{named}', such as {found[0]} and {found[1]}: name one")
    if not found:
        close = get_close_matches(str(named), inside, n=1)
        hint = f"did you mean '{close[0]}'?" if close else "pcsr runs lists the runs"
        raise UserError(f"there is no run '{named}', here or in {runs}: {hint}")
    return runs / found[0]


def _recipe(folder: Path) -> dict[str, Any]:
    """Return the resolved recipe of an unfinished run; empty in folders of pcsr before 0.3 that were not trained."""
    return read_object(folder / RECIPE) if (folder / RECIPE).exists() else {}


def _progress(folder: Path) -> str:
    """Describe how far an unfinished run is."""
    if (folder / WEIGHTS).exists():
        return "trained, not evaluated"
    last = next((line for line in _lines(folder / HISTORY) if "loss" in line), None)
    return "training has not begun" if last is None else f"training stopped after step {last.get('step')}"


def _lines(history: Path) -> Iterator[dict[str, Any]]:
    """Yield the lines of a history from the last one; lines that are cut off are left out."""
    if not history.exists():
        return
    for text in reversed(read_text(history).splitlines()):
        try:
            line = json.loads(text)
        except (ValueError, RecursionError):
            continue
        if isinstance(line, dict):
            yield line
