"""Shared by `pcsr run` and `pcsr compare`: their options, and the runs of recipes."""

import functools
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from pcsr.cli import command_line, explain, streams
from pcsr.cli.options import FILE, OUTPUT_FOLDER, jobs_option
from pcsr.errors import UserError

if TYPE_CHECKING:
    from pcsr.experiments.run_options import RunOptions
    from pcsr.plugins.registry import Registry
    from pcsr.recipe import Recipe
    from pcsr.run_files import FinishedRun

Result = TypeVar("Result")

RUN_OPTIONS = ("runs", "device", "devices", "nodes", "jobs", "data", "keep_weights", "retrain", "reevaluate")
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
        help="Use this data folder, built by pcsr data make, instead of the recipe's data. "
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
    click.option("--reevaluate", is_flag=True, help="Evaluate even if finished results exist."),
)


def run_options(command: Callable[..., Result]) -> Callable[..., Result]:
    """Add the options `RUN_OPTIONS` to a command, and pass it a `RunOptions` as `options`."""

    @functools.wraps(command)
    def with_options(*args: object, **kwargs: Any) -> Result:
        from pcsr.experiments.run_options import RunOptions

        options = RunOptions(**{name: kwargs.pop(name) for name in RUN_OPTIONS}, command=command_line())
        return command(*args, options=options, **kwargs)

    for option in reversed(_OPTIONS):
        with_options = option(with_options)
    return with_options


def prepared(recipes: "Sequence[Recipe]", registry: "Registry", options: "RunOptions") -> "list[Recipe]":
    """Return recipes with the data of `--data`, after all checks that need no computation.

    Args:
        recipes: recipes to run, at least one.
        registry: installed parts.
        options: options of the runs.

    Raises:
        UserError: options contradict each other, two runs would share a folder, or a recipe cannot be run.
    """
    from pcsr.data.built import BuiltData
    from pcsr.experiments.run import check_graft, packages
    from pcsr.experiments.run_options import run_folder
    from pcsr.extras import require
    from pcsr.recipe.pretrained import check_weights

    if options.keep_weights and options.retrain:
        raise UserError("--keep-weights trains nothing, and --retrain trains: give one of the two")
    if options.data:
        built = BuiltData.read(options.data)
        recipes = [built.replace_data(one, registry) for one in recipes]
        folders_text = " and ".join(map(str, options.data))
        note = f"the recipe's section data is replaced by {folders_text}, except for the number of touches"
        for line in (note, *built.missing()):
            streams.console(error=True).print(f"data: {line}", markup=False, soft_wrap=True)
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
    return list(recipes)


def run_each(
    recipes: "Sequence[Recipe]", registry: "Registry", options: "RunOptions", *, alone: bool
) -> "tuple[list[FinishedRun | None], list[str]]":
    """Run recipes one after another and print the result of each.

    Args:
        recipes: result of `prepared`.
        registry: installed parts.
        options: options of the runs.
        alone: there is no other run to compare. The run's whole table is printed, and its error is raised; otherwise
            the error of a run is printed, and the next one begins.

    Returns:
        The runs in the order of the recipes, None for those that failed and in all processes but the first; and for
        each that failed its name and the reason.
    """
    import torch

    from pcsr import report
    from pcsr.experiments.run import run
    from pcsr.run_files import REPORT

    console, log = streams.console(), streams.console(error=True)
    finished: list[FinishedRun | None] = []
    failed: list[str] = []
    for one in recipes:
        try:
            done = run(one, registry, options, log)
        except Exception as error:
            if alone or options.devices * options.nodes > 1:  # other processes would wait for this one
                raise
            message, _ = explain(error)
            failed.append(f"{one.name} failed: {message.removeprefix('pcsr: error: ')}")
            if click.get_current_context().find_root().params["traceback"]:
                traceback.print_exc()
            log.print(failed[-1], style="red", markup=False, soft_wrap=True)
            done = None
        finished.append(done)
        if done is not None:
            where_to = f"report: {done.folder / REPORT}"
            if alone or console.is_terminal:
                console.print(report.table(done.results))
            else:  # the table of all runs follows
                where_to = f"{report.summary(done.results)}; {where_to}"
            console.print(where_to, soft_wrap=True, markup=False, highlight=False)
            if hint := report.few_steps(done.results):
                log.print(hint, markup=False, soft_wrap=True, highlight=False)
    if torch.distributed.is_available() and torch.distributed.is_initialized():
        # If its threads still ran at the end of the process, the process would abort.
        torch.distributed.destroy_process_group()
    return finished, failed
