"""`pcsr compare`: train and evaluate recipes or parts on the same data, seeds and budget, in one table."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pcsr.cli import streams
from pcsr.cli.comparing import check_failed, read_runs, show, table_files, table_options
from pcsr.cli.options import FILE, complete_part, plugin_option, set_option
from pcsr.cli.running import prepared, run_each, run_options
from pcsr.errors import UserError, did_you_mean

if TYPE_CHECKING:
    from pcsr.experiments.run_options import RunOptions
    from pcsr.plugins.registry import Registry

NAME = r"[a-z0-9][a-z0-9.-]{0,99}"
"""Pattern of the page's name, which must be valid as a file name on every system."""
KINDS = ("encoder", "fusion", "backbone", "upsampler", "objective")
"""Kinds of parts that have an option of their own."""


def _part_options(command: Any) -> Any:
    for kind in reversed(KINDS):
        command = click.option(
            f"--{kind}",
            kind,
            multiple=True,
            metavar="NAME",
            shell_complete=complete_part(kind),
            help=f"Compare this {kind}. May be repeated.",
        )(command)
    return command


@click.command()
@click.argument("compared", nargs=-1, required=True, type=FILE, metavar="RECIPE|RUN...")
@_part_options
@click.option(
    "--seeds",
    type=click.IntRange(1, 1000),
    default=1,
    show_default=True,
    metavar="N",
    help="Train each N times, with seeds 0 to N-1, on the same data.",
)
@click.option("--name", default="compare", show_default=True, metavar="NAME", help="Name of the page with the tables.")
@table_options
@set_option
@plugin_option
@run_options
def compare(
    compared: tuple[Path, ...],
    seeds: int,
    name: str,
    overrides: tuple[str, ...],
    registry: Any,
    options: "RunOptions",
    **others: Any,
) -> None:
    """Compare recipes, parts or finished runs under equal conditions.

    Each RECIPE is trained and evaluated with every combination of the parts that the options name. A RUN is a run
    folder, whose results are read. All must have the same test data; --seeds varies the training only. Differences
    and wins are counted against the first row of the table.

    \b
    pcsr compare smoke --fusion concat --fusion iterative --seeds 3
    pcsr compare tapsr pu-transformer --set train.epochs=5
    pcsr compare runs/a-* runs/b-* --latex table.tex
    """  # noqa: D301 (click's mark is the letter itself)
    from pcsr.recipe import load
    from pcsr.report.tables.same_clouds import check_same_clouds, check_same_settings

    if not re.fullmatch(NAME, name):
        raise UserError(
            f"--name {name!r}: it must have 1 to 100 characters of a-z, 0-9, . and -, and begin with a letter or digit"
        )
    tables = table_files(others)
    folders, files = _sorted_out(compared)
    axes = _axes({kind: others[kind] for kind in KINDS}, seeds, registry)
    if not files and (axes or overrides):
        raise UserError("parts, --seeds and --set change recipes, and only run folders are named: name a recipe too")
    runs, left_out = read_runs(folders)
    by_folder = dict(zip(folders, runs, strict=True))
    of_file = {file: load(file, registry, overrides, axes) for file in files}
    recipes = prepared([one for file in files for one in of_file[file]], registry, options) if files else []
    if recipes:
        known = [(str(one.folder), one.results.recipe) for one in runs if one is not None]
        check_same_settings([*known, *((one.name, one.resolved()) for one in recipes)])
    trained, failed = run_each(recipes, registry, options, alone=len(recipes) == len(compared) == 1)
    made = iter(trained)
    every = [
        one
        for path in compared
        for one in ([by_folder[path]] if path in by_folder else [next(made) for _ in of_file.get(path, ())])
    ]
    done = [one for one in every if one is not None]
    check_same_clouds([(str(one.folder), one.results) for one in done])
    if left_out and not recipes and not done:
        raise UserError("no run is left to compare: name one that is finished")
    if done and (len(every) > 1 or folders):
        show(done, [*left_out, *failed], name, options.runs, tables)
    check_failed(failed, len(recipes))


def _sorted_out(compared: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Return the run folders and the recipes among the arguments.

    The page of a study, which a pattern such as `runs/study-*` may match, is neither.

    Raises:
        UserError: an argument is neither, or none is left.
    """
    from pcsr import recipes
    from pcsr.run_files import is_run_folder

    folders, files = [], []
    for path in compared:
        named = path.as_posix().removeprefix("recipes/").removesuffix(".yaml") in recipes.names()
        if path.is_dir() and (is_run_folder(path) or not named):
            folders.append(path)
        elif path.suffix == ".html" and path.is_file():
            streams.console(error=True).print(f"left out: {path} is a page", markup=False, soft_wrap=True)
        elif named or path.is_file() or path.suffix in (".yaml", ".yml"):
            files.append(path)
        else:
            hint = did_you_mean(str(path), recipes.names())
            if not hint.startswith("did"):  # all recipes
                hint = "pcsr runs lists the run folders"
            raise UserError(f"'{path}' is neither a run folder nor a recipe: {hint}")
    if not folders and not files:
        raise UserError("no run folder or recipe is named: name at least one")
    return folders, files


def _axes(parts: dict[str, tuple[str, ...]], seeds: int, registry: "Registry") -> dict[str, list[Any]]:
    """Return the values that the options vary, by dotted key.

    A fusion that uses no touch features is run without the touch encoder, which would have no effect.
    """
    axes: dict[str, list[Any]] = {}
    for kind, named in parts.items():
        if named:
            axes[f"{'train' if kind == 'objective' else 'model'}.{kind}"] = list(named)
    plain = [name for name in axes.get("model.fusion", ()) if _is_plain(name, registry)]
    if plain:
        axes["model.fusion"] = [
            {"model.fusion": name, "model.touch_encoder": None} if name in plain else name
            for name in axes["model.fusion"]
        ]
        for name in plain:
            text = f"fusion '{name}' uses no touch features: it is compared without a touch encoder"
            streams.console(error=True).print(text, markup=False, soft_wrap=True, highlight=False)
    if seeds > 1:
        axes["seed"] = list(range(seeds))
    return axes


def _is_plain(name: str, registry: "Registry") -> bool:
    """Whether a fusion is installed and uses no touch features. Names that are not known are the recipe's mistake."""
    return ("fusion", name) in registry.entries and not registry.get("fusion", name).uses_touch_features
