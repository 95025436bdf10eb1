"""`pcsr runs show`: everything that a run folder holds, and how to repeat the run."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE
from pcsr.errors import UserError

if TYPE_CHECKING:
    from pcsr.run_folders import RunFolder


@click.command()
@click.argument("run", type=FILE)
@click.pass_obj
def show(runs: Path, run: Path) -> None:
    """Show what a run folder holds, and how to repeat the run.

    RUN is a run folder, its name, or the beginning of its name.
    """
    from pcsr import report
    from pcsr.run_folders import RunFolder, find_run

    found = RunFolder.read(find_run(run, runs))
    console = streams.console()
    width = max(map(len, _HEADS)) + 2
    for head, text in _facts(found):
        console.print(f"{head:{width}}{text}", markup=False, highlight=False, soft_wrap=True)
    if found.results is not None:
        console.print()
        console.print(report.table(found.results))


_HEADS = ("folder", "state", "recipe", "part", "training", "made by", "git", "command", "repeat", "file")


def _facts(run: "RunFolder") -> list[tuple[str, str]]:
    from pcsr.limits import gigabytes
    from pcsr.run_files import read_environment

    facts = [("folder", f"{run.folder}, {gigabytes(run.size)}")]
    facts.append(("state", run.state + (f": {run.remark}" if run.remark else "")))
    if run.recipe:
        fingerprint = "" if run.results is None else f", fingerprint {run.results.fingerprint[:12]}"
        facts.append(("recipe", f"{run.recipe.get('name')}, seed {run.recipe.get('seed')}{fingerprint}"))
    facts += [("part", f"{key}: {name}") for key, name in run.parts.items()]
    if run.results is not None:
        facts.append(("training", ", ".join([run.results.training.source, *run.results.budget])))
    try:
        stages = read_environment(run.folder)
    except UserError as error:
        facts.append(("made by", str(error)))
        stages = {}
    facts += [(head, f"{text}; {stage}") for stage, about in stages.items() for head, text in _environment(about)]
    if command := repeat(run, stages):
        facts.append(("repeat", command))
    for path in sorted(run.folder.rglob("*")):
        if path.is_file():
            facts.append(("file", f"{path.relative_to(run.folder)}, {gigabytes(path.stat().st_size)}"))
    return facts


def _environment(about: dict[str, Any]) -> list[tuple[str, str]]:
    """Facts of the environment of a stage, which another program may have written."""
    packages = about.get("packages")
    torch = packages.get("torch") if isinstance(packages, dict) else None
    versions = f"pcsr {about.get('pcsr')}, torch {torch}, Python {about.get('python')}, {about.get('system')}"
    facts = [("made by", f"{versions}, {about.get('time')}")]
    for one in about.get("git", ()):
        changed = ", with changes" if one.get("changed") else ""
        facts.append(("git", f"{one.get('repository')} {one.get('commit')}{changed}"))
    if about.get("command"):
        facts.append(("command", str(about["command"])))
    return facts


def repeat(run: "RunFolder", stages: dict[str, dict[str, Any]]) -> str:
    """Command that repeats a run from the files of its folder; empty if it has no recipe file."""
    from pcsr.run_files import RECIPE

    if not (run.folder / RECIPE).exists():
        return ""
    words = ["pcsr", "run", str(run.folder / RECIPE)]
    copies = dict.fromkeys(copy for about in stages.values() for copy in about.get("plugins", {}))
    for copy in copies:
        words += ["--plugin", str(run.folder / copy)]
    return shlex.join([*words, "--runs", "repeated"])
