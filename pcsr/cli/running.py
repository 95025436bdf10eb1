"""Shared by `pcsr run` and `pcsr compare`: their options, and the runs of several recipes with their tables."""

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE, OUTPUT_FOLDER, jobs_option
from pcsr.errors import UserError

if TYPE_CHECKING:
    from pcsr.plugins.registry import Registry
    from pcsr.recipe import Recipe

Result = TypeVar("Result")

RUN_OPTIONS = ("runs", "device", "devices", "nodes", "jobs", "data", "keep_weights", "retrain")
"""Fields of `pcsr.experiments.run_options.RunOptions`, each of which is an option of the command line."""

_OPTIONS = (
    click.option(
        "--runs", type=OUTPUT_FOLDER, default=Path("runs"), show_default=True, help="Folder of the run folders."
    ),
    click.option(
        "--device",
        type=click.Choice(["auto", "cpu", "cuda"]),
        default="auto",
        show_default=True,
        help="Device; auto is cuda if there is one.",
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
        help="Number of machines, started by torchrun or SLURM.",
    ),
    jobs_option("Processes for data, metrics and a GPU's batches.  [default: all cores]"),
    click.option(
        "--data",
        type=FILE,
        multiple=True,
        help="Use this data folder, built by `pcsr data make`, instead of the recipe's data. "
        "May be repeated: the folders are joined.",
    ),
    click.option(
        "--keep-weights",
        is_flag=True,
        help="Evaluate weights that were trained before the code of a plugin changed, instead of training again.",
    ),
    click.option(
        "--retrain",
        is_flag=True,
        help="Train even if finished weights exist. They are replaced when training is finished.",
    ),
)


def run_options(command: Callable[..., Result]) -> Callable[..., Result]:
    """Add the options `RUN_OPTIONS` to a command, and pass it their values as `where`."""

    @functools.wraps(command)
    def with_options(*args: object, **kwargs: Any) -> Result:
        return command(*args, where={name: kwargs.pop(name) for name in RUN_OPTIONS}, **kwargs)

    for option in reversed(_OPTIONS):
        with_options = option(with_options)
    return with_options


def run_all(recipes: "Sequence[Recipe]", registry: "Registry", where: dict[str, Any], name: str) -> None:
    """Run recipes one after another. Tables of several runs are printed and written to a page at the end.

    Args:
        recipes: recipes, at least one.
        registry: installed parts.
        where: values of the options, as `run_options` passes them.
        name: name of the study and of its page.

    Raises:
        UserError: options contradict each other, two runs would share a folder, or a recipe cannot be run.
        RunError: training fails, or a file cannot be written.
    """
    import torch

    from pcsr import report
    from pcsr.data.built import BuiltData
    from pcsr.experiments.run import check_graft, packages, run
    from pcsr.experiments.run_options import RunOptions, run_folder
    from pcsr.extras import require
    from pcsr.recipe.pretrained import check_weights

    if where["keep_weights"] and where["retrain"]:
        raise UserError("--keep-weights trains nothing, and --retrain trains: give one of the two")
    console, log = streams.console(), streams.console(error=True)
    options = RunOptions(**where)
    if options.data:
        built = BuiltData.read(options.data)
        recipes = [built.replace_data(one, registry) for one in recipes]
        folders_text = " and ".join(map(str, options.data))
        note = f"the recipe's section data is replaced by {folders_text}, except for the number of touches"
        for line in (note, *built.missing()):
            log.print(f"data: {line}", markup=False, soft_wrap=True)
    require({name: user for one in recipes for name, user in packages(one, registry, options).items()})
    for one in recipes:
        check_weights(one, registry)  # all weights and grafts are checked before the first run
        check_graft(one, registry)
    folders: dict[Path, str] = {}
    for one in recipes:
        folder = run_folder(one, options)
        if folder in folders:
            raise UserError(
                f"two of the runs are '{one.name}' and would be kept in the same folder, {folder}: give one of "
                f"them another `name:`"
            )
        folders[folder] = one.name
    finished = []
    for one in recipes:
        done = run(one, registry, options, log)
        if done is not None:  # None in all processes except the first
            finished.append(done)
            where_to = f"report: {done.folder / report.REPORT}"
            if len(recipes) == 1 or console.is_terminal:
                console.print(report.table(done.results))
            else:  # the table of all runs follows
                where_to = f"{report.summary(done.results)}; {where_to}"
            console.print(where_to, soft_wrap=True, markup=False, highlight=False)
    if len(finished) > 1:
        for one_table in report.compare([done.results for done in finished], name):
            console.print(one_table)
        page = report.write_comparison(finished, name, options.runs)
        console.print(f"all runs: {page}", soft_wrap=True, markup=False)
    if torch.distributed.is_available() and torch.distributed.is_initialized():
        # If its threads still ran at the end of the process, the process would abort.
        torch.distributed.destroy_process_group()
