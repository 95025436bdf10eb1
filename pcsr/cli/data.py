"""`pcsr data`: build TSR-PD from any shapes, and say what such a folder holds."""

import functools
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pcsr.cli.options import FILE, jobs_option, plugin_option
from pcsr.errors import UserError, did_you_mean

if TYPE_CHECKING:
    from rich.console import Console

    from pcsr.data.schema import Manifest
    from pcsr.plugins.registry import Registry
    from pcsr.recipe import Recipe


@click.group()
def data() -> None:
    """Build data sets of clouds and touches, and say what they hold."""


@data.command()
@click.argument("shapes")
@click.option("-o", "--out", "folder", required=True, type=FILE, metavar="DIR", help="Where to put it.")
@click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="A key of a recipe's section `data`, or else an option of the shapes: --set count=40 --set sampling=view "
    "--set touch.object_size=30. May be repeated.",
)
@plugin_option
@jobs_option("Processes on this machine.  [default: all cores]")
@click.option("--scheduler", metavar="ADDRESS", default=None, help="Use the workers of this Dask scheduler instead.")
def make(
    shapes: str,
    folder: Path,
    overrides: tuple[str, ...],
    registry: "Registry",
    jobs: int | None,
    scheduler: str | None,
) -> None:
    """Build a data set from a folder of meshes, a part such as cad-parts, or the section data of a recipe.

    What is there already is not built again: the same command goes on where it was stopped.
    """
    from rich.console import Console

    from pcsr.data.build import build_split
    from pcsr.data.plan import Plan
    from pcsr.data.shards import read_manifest
    from pcsr.progress import progress_bars
    from pcsr.workers import worker_pool

    console = Console()
    plan = Plan.of(_recipe(shapes, overrides, registry), registry)
    for split, reason in plan.empty.items():
        console.print(f"no {split} data: {reason}", style="yellow", markup=False, soft_wrap=True)
    with progress_bars(console, hidden=False) as progress, worker_pool(jobs, scheduler) as workers:
        for split, names in plan.names.items():
            task = progress.add_task(f"building the {split} data", total=len(names))
            build_split(plan, split, folder, workers, functools.partial(progress.advance, task))
    manifest = read_manifest(folder)
    _print(console, folder, manifest)
    if not any(about.objects for about in manifest.splits.values()):
        raise UserError(f"none of the objects of '{shapes}' could be used: the reasons are above")


@data.command()
@click.argument("folder", type=FILE)
@click.option(
    "--picture",
    type=FILE,
    default=None,
    metavar="FILE",
    help="Where to write the page of pictures.  [default: DIR/info.html]",
)
@click.option("--object", "name", default=None, metavar="NAME", help="The object to show.  [default: a few]")
@click.option("--verify", is_flag=True, help="Read every file, and say which of them are not as they were built.")
def info(folder: Path, picture: Path | None, name: str | None, verify: bool) -> None:
    """Say what a data set holds, and show one of its objects as the paper's Fig. 4 does."""
    from rich.console import Console

    from pcsr.data.shards import read_manifest
    from pcsr.extras import require
    from pcsr.report.data_page import write_data_page

    require({"plotly": "the page of pictures"})
    console = Console()
    manifest = read_manifest(folder)
    _print(console, folder, manifest)
    if verify:
        _verify(console, folder, manifest)
    else:
        console.print("its files were not verified: --verify reads them all", style="dim", soft_wrap=True)
    path = picture or folder / "info.html"
    shown = write_data_page(path, folder, manifest, name)
    console.print(f"pictures of {', '.join(shown)}: {path}", markup=False, soft_wrap=True)


def _recipe(shapes: str, overrides: tuple[str, ...], registry: "Registry") -> "Recipe":
    from pcsr.recipe import for_data, load
    from pcsr.recipes import names as recipe_names

    names = registry.names("shapes")
    if shapes in names:
        return for_data(shapes, {}, registry, overrides)
    if shapes.endswith((".yaml", ".yml")) or (shapes in recipe_names() and not Path(shapes).is_dir()):
        recipes = load(Path(shapes), registry, [f"data.{override}" for override in overrides])
        if len(recipes) != 1:
            raise UserError(f"{shapes} describes {len(recipes)} runs: build the data of one, without its matrix")
        return recipes[0]
    if Path(shapes).is_dir():
        return for_data("meshes", {"folder": shapes}, registry, overrides)
    raise UserError(
        f"'{shapes}' is neither a folder nor a recipe nor shapes that pcsr knows: {did_you_mean(shapes, names)}"
    )


def _verify(console: "Console", folder: Path, manifest: "Manifest") -> None:
    """Read every shard.

    Raises:
        UserError: some are missing or damaged; each is printed.
    """
    from pcsr.data.shards import damaged
    from pcsr.progress import progress_bars

    files = sum(len(about.shards) for about in manifest.splits.values())
    with progress_bars(console, hidden=False) as progress:
        objects = sum(about.objects for about in manifest.splits.values())
        task = progress.add_task("verifying", total=objects)
        found = damaged(folder, manifest, functools.partial(progress.advance, task))
    for line in found:
        console.print(line, style="red", markup=False, soft_wrap=True)
    if found:
        raise UserError(f"{len(found)} of the {files} files of {folder} are missing or damaged: they are named above")
    console.print(f"all {files} files are as they were built", soft_wrap=True)


def _print(console: "Console", folder: Path, manifest: "Manifest") -> None:
    """What the manifest says, in a table, with the reasons of what was left out."""
    from rich.table import Table

    data = manifest.data
    touch = {key: value for key, value in data.touch.model_dump().items() if value is not None}
    console.print(
        f"{folder}: {data.points} points to {data.points * data.rate} ({data.truth}; sparse: {data.sampling}), "
        f"{data.touches} touches, seed {data.seed}, fingerprint {manifest.fingerprint[:12]}",
        markup=False,
        soft_wrap=True,
    )
    console.print(f"shapes: {_plain(data.shapes.model_dump())}; touch: {_plain(touch)}", markup=False, soft_wrap=True)
    table = Table("split", "objects", "groups", "left out", "felt by 1, 2, … touches")
    for split, about in manifest.splits.items():
        covered = "  ".join(f"{row.p50:.1%}" for row in about.coverage)
        table.add_row(split, *(str(n) for n in (about.objects, about.groups, len(about.rejected))), covered)
    console.print(table)
    console.print("felt: the share of an object's truth that its first touches cover, median over objects", style="dim")
    for split, about in manifest.splits.items():
        kinds: dict[str, list[str]] = {}
        for name, reason in about.rejected.items():
            kinds.setdefault(_kind(name, reason), []).append(reason if name in reason else f"{name}: {reason}")
        for reasons in sorted(kinds.values(), key=len, reverse=True):
            such = "" if len(reasons) == 1 else f" {len(reasons)} such as"
            console.print(f"left out of {split}:{such} {reasons[0]}", markup=False, soft_wrap=True)


def _plain(options: dict[str, Any]) -> str:
    return ", ".join(f"{value}" if key == "use" else f"{key} {value}" for key, value in options.items())


def _kind(name: str, reason: str) -> str:
    """A reason without what is only this object's: its name and numbers, so that alike ones are counted together."""
    import re

    return re.sub(r"\d[\d.,e+-]*", "…", reason.replace(name, "…"))
