"""What `pcsr run` and `pcsr compare` share: where to compute, and one run after another to the tables."""

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from pcsr.cli.options import FILE, OUTPUT_FOLDER, jobs_option
from pcsr.errors import UserError

if TYPE_CHECKING:
    from pcsr.plugins.registry import Registry
    from pcsr.recipe import Recipe

Result = TypeVar("Result")

RUN_OPTIONS = ("runs", "device", "devices", "nodes", "jobs", "data", "keep_weights", "retrain")
"""The fields of `pcsr.experiments.run_options.RunOptions`, each an option."""
WIDTH = 140
"""Columns of a table that goes into a file or a pipe."""

_OPTIONS = (
    click.option("--runs", type=OUTPUT_FOLDER, default=Path("runs"), show_default=True, help="Where run folders go."),
    click.option(
        "--device",
        type=click.Choice(["auto", "cpu", "cuda"]),
        default="auto",
        show_default=True,
        help="Where to compute; auto is cuda where there is one.",
    ),
    click.option(
        "--devices",
        type=click.IntRange(1, 256),
        default=1,
        show_default=True,
        help="Processes on this machine, one for each GPU.",
    ),
    click.option(
        "--nodes",
        type=click.IntRange(1, 4096),
        default=1,
        show_default=True,
        help="Machines, as torchrun or SLURM started them.",
    ),
    jobs_option("Processes for data, metrics and a GPU's batches.  [default: all cores]"),
    click.option(
        "--data",
        type=FILE,
        multiple=True,
        help="Use the data in this folder, which `pcsr data make` built, instead of the recipe's own. "
        "May be repeated: the folders are joined.",
    ),
    click.option(
        "--keep-weights",
        is_flag=True,
        help="Measure the weights that were trained before the code of a plugin changed, instead of training again.",
    ),
    click.option(
        "--retrain",
        is_flag=True,
        help="Train anew, even where finished weights are. They are replaced when the new ones are finished.",
    ),
)


def run_options(command: Callable[..., Result]) -> Callable[..., Result]:
    """Give a command the options of `pcsr.experiments.run_options.RunOptions`, and hand it their values as `where`."""

    @functools.wraps(command)
    def with_options(*args: object, **kwargs: Any) -> Result:
        return command(*args, where={name: kwargs.pop(name) for name in RUN_OPTIONS}, **kwargs)

    for option in reversed(_OPTIONS):
        with_options = option(with_options)
    return with_options


def run_all(recipes: "Sequence[Recipe]", registry: "Registry", where: dict[str, Any], name: str) -> None:
    """Run recipes one after another; of several, end in their common tables, on the screen and as a page.

    Args:
        recipes: at least one.
        registry: gives their parts.
        where: as `run_options` hands it over.
        name: of the study, and of its page.
    """
    import torch
    from rich.console import Console

    from pcsr import report
    from pcsr.data.built import BuiltData
    from pcsr.experiments.run import packages, run
    from pcsr.experiments.run_options import RunOptions, run_folder
    from pcsr.extras import require
    from pcsr.recipe.pretrained import check_weights

    if where["keep_weights"] and where["retrain"]:
        raise UserError("--keep-weights trains nothing, and --retrain trains: give one of the two")
    console = Console()
    options = RunOptions(**where)
    if options.data:
        built = BuiltData.read(options.data)
        recipes = [built.replace_data(one, registry) for one in recipes]
        where_from = " and ".join(map(str, options.data))
        said = f"all but the number of touches is as {where_from} says, whatever the recipe's section data does"
        for line in (said, *built.missing()):
            console.print(f"data: {line}", markup=False, soft_wrap=True)
    require({name: user for one in recipes for name, user in packages(one, registry, options).items()})
    for one in recipes:
        check_weights(one, registry)  # of all of them, before the first runs
    folders: dict[Path, str] = {}
    for one in recipes:
        folder = run_folder(one, options)
        if folder in folders:
            raise UserError(
                f"two of the runs are '{one.name}' and would be kept in one folder, {folder}, the second in the "
                f"place of the first: give one of them a `name:` of its own"
            )
        folders[folder] = one.name
    finished = []
    for one in recipes:
        done = run(one, registry, options, console)
        if done is not None:  # None in all processes but the first
            finished.append(done)
            console.print(report.table(done.results))
            console.print(f"report: {done.folder / report.REPORT}", soft_wrap=True, markup=False)
    if len(finished) > 1:
        wide = console if console.is_terminal else Console(width=WIDTH)
        for one_table in report.compare([done.results for done in finished], name):
            wide.print(one_table)
        page = report.write_comparison(finished, name, options.runs)
        console.print(f"all of them: {page}", soft_wrap=True, markup=False)
    if torch.distributed.is_available() and torch.distributed.is_initialized():
        # Left to the end of the process, its threads may still run then, and it would abort.
        torch.distributed.destroy_process_group()
