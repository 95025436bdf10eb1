"""`pcsr data`: build data sets in the manner of the paper's TSR-PD, and inspect them."""

import functools
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE, OUTPUT_FOLDER, jobs_option, plugin_option
from pcsr.cli.reasons import kinds
from pcsr.errors import UserError, did_you_mean

if TYPE_CHECKING:
    from rich.console import Console

    from pcsr.data.schema import Manifest
    from pcsr.plugins.registry import Registry
    from pcsr.recipe import Recipe


@click.group()
def data() -> None:
    """Build and inspect data sets of clouds and touches."""


@data.command()
@click.argument("shapes")
@click.option("-o", "--out", "folder", required=True, type=OUTPUT_FOLDER, metavar="DIR", help="Folder to write to.")
@click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Set a key of the recipe's section data, such as sampling=view or touch.object_size=30, or an option of "
    "the shapes, such as count=40. The value is YAML. May be repeated.",
)
@plugin_option
@jobs_option("Number of processes.  [default: all cores]")
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    default=None,
    help="Use the workers of the Dask scheduler at this address instead of local processes.",
)
def make(
    shapes: str,
    folder: Path,
    overrides: tuple[str, ...],
    registry: "Registry",
    jobs: int | None,
    scheduler: str | None,
) -> None:
    """Build a data set.

    SHAPES is a folder of meshes, the name of a shape source such as cad-parts, or a recipe, whose section data is
    used. Finished parts of the data set are not built again: after an interruption the same command goes on.
    """
    from pcsr.data.build import build_split
    from pcsr.data.plan import Plan
    from pcsr.data.shards import read_manifest
    from pcsr.progress import progress_bars
    from pcsr.workers import worker_pool

    console = streams.console()
    plan = Plan.of(_recipe(shapes, overrides, registry), registry)
    for split, reason in plan.empty.items():
        console.print(f"no {split} data: {reason}", style="yellow", markup=False, soft_wrap=True)
    with progress_bars(streams.console(error=True), hidden=False) as progress, worker_pool(jobs, scheduler) as workers:
        for split, names in plan.names.items():
            task = progress.add_task(f"building the {split} data", total=len(names))
            build_split(plan, split, folder, workers, functools.partial(progress.advance, task))
    manifest = read_manifest(folder)
    _print(console, folder, manifest)
    if not any(about.objects for about in manifest.splits.values()):
        raise UserError(f"none of the objects of '{shapes}' could be used: the reasons are listed above")


@data.command()
@click.argument("folder", type=FILE, metavar="DIR")
@click.option(
    "--picture",
    type=FILE,
    default=None,
    metavar="FILE",
    help="HTML page to write the pictures to.  [default: DIR/info.html]",
)
@click.option("--object", "name", default=None, metavar="NAME", help="Show this object.  [default: a few]")
@click.option("--verify", is_flag=True, help="Check the hash of every file, and list damaged files.")
def info(folder: Path, picture: Path | None, name: str | None, verify: bool) -> None:
    """Show what a data set contains.

    Prints the settings and the objects of each split, and writes a page of pictures as in the paper's Fig. 4.
    """
    from pcsr.data.shards import read_manifest
    from pcsr.extras import require
    from pcsr.report.web.data_page import write_data_page

    require({"plotly": "the page of pictures"})
    console = streams.console()
    manifest = read_manifest(folder)
    _print(console, folder, manifest)
    if verify:
        _verify(console, folder, manifest)
    else:
        console.print("files not verified; use --verify to check their hashes", style="dim", soft_wrap=True)
    path = picture or folder / "info.html"
    shown = write_data_page(path, folder, manifest, name)
    console.print(f"pictures of {', '.join(shown)}: {path}", markup=False, soft_wrap=True)


def _recipe(shapes: str, overrides: tuple[str, ...], registry: "Registry") -> "Recipe":
    from pcsr.recipe import for_data, load
    from pcsr.recipes import names as recipe_names

    if not shapes:
        raise UserError("SHAPES is empty: name a folder of meshes, a recipe or a shape source such as cad-parts")
    names = registry.names("shapes")
    if shapes in names:
        return for_data(shapes, {}, registry, overrides)
    if shapes.endswith((".yaml", ".yml")) or (shapes in recipe_names() and not Path(shapes).is_dir()):
        recipes = load(Path(shapes), registry, [f"data.{override}" for override in overrides])
        if len(recipes) != 1:
            raise UserError(f"{shapes} describes {len(recipes)} runs: use a recipe of one run, without a matrix")
        return recipes[0]
    if Path(shapes).is_dir():
        return for_data("meshes", {"folder": shapes}, registry, overrides)
    raise UserError(f"'{shapes}' is neither a folder, nor a recipe, nor a shape source: {did_you_mean(shapes, names)}")


def _verify(console: "Console", folder: Path, manifest: "Manifest") -> None:
    """Check the hash of every shard, and print a line for each that is missing or damaged.

    Raises:
        UserError: a shard is missing or damaged.
    """
    from pcsr.data.shards import damaged
    from pcsr.progress import progress_bars

    files = sum(len(about.shards) for about in manifest.splits.values())
    with progress_bars(streams.console(error=True), hidden=False) as progress:
        objects = sum(about.objects for about in manifest.splits.values())
        task = progress.add_task("verifying", total=objects)
        found = damaged(folder, manifest, functools.partial(progress.advance, task))
    for line in found:
        console.print(line, style="red", markup=False, soft_wrap=True)
    if found:
        raise UserError(f"{len(found)} of the {files} files of {folder} are missing or damaged: they are listed above")
    console.print(f"all {files} files are intact", soft_wrap=True)


def _print(console: "Console", folder: Path, manifest: "Manifest") -> None:
    """Print the settings of the data set, a table of its splits, and the reasons for rejected objects."""
    from rich.table import Column, Table

    data = manifest.data
    touch = {key: value for key, value in data.touch.model_dump().items() if value is not None}
    console.print(
        f"{folder}: {data.points} points to {data.points * data.rate} ({data.truth}; sparse: {data.sampling}), "
        f"{data.touches} touches, seed {data.seed}, fingerprint {manifest.fingerprint[:12]}",
        markup=False,
        soft_wrap=True,
    )
    console.print(f"shapes: {_plain(data.shapes.model_dump())}; touch: {_plain(touch)}", markup=False, soft_wrap=True)
    heads = ("split", "objects", "groups", "rejected", "coverage by 1, 2, … touches")
    table = Table(*(Column(head, overflow="fold") for head in heads))
    for split, about in manifest.splits.items():
        covered = "  ".join(f"{row.p50:.1%}" for row in about.coverage)
        table.add_row(split, *(str(n) for n in (about.objects, about.groups, len(about.rejected))), covered)
    console.print(table)
    console.print("coverage: the share of the truth's points near a touched point, median over objects", style="dim")
    for split, about in manifest.splits.items():
        for alike in sorted(kinds(about.rejected), key=len, reverse=True):
            name, reason = next(iter(alike.items()))
            number = "" if len(alike) == 1 else f" {len(alike)} objects, such as"
            shown = reason if name in reason else f"{name}: {reason}"
            console.print(f"rejected from {split}:{number} {shown}", markup=False, soft_wrap=True)


def _plain(options: dict[str, Any]) -> str:
    return ", ".join(f"{value}" if key == "use" else f"{key} {value}" for key, value in options.items())
