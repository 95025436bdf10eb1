"""`pcsr upsample`: the command that upsamples a cloud in a file or pipe."""

import re
from pathlib import Path
from typing import Literal

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE, PLUGIN, jobs_option
from pcsr.errors import PcsrWarning, UserError

PIPE = Path("-")


@click.command()
@click.argument("cloud", type=FILE, metavar="IN")
@click.option("-o", "--out", type=FILE, required=True, metavar="OUT", help="File of the dense cloud; - for a pipe.")
@click.option("--rate", type=float, default=None, help="Output points per input point, 1.1 to 64.  [default: 4]")
@click.option(
    "--points", "count", type=click.IntRange(1), default=None, help="Number of output points, instead of a rate."
)
@click.option("--touch", type=FILE, default=None, metavar="DIR", help="Folder of recorded touches.")
@click.option("--model", default=None, help="Weights: a name, run folder or file; or midpoint.  [default: frames]")
@click.option(
    "--mesh", type=FILE, default=None, help="Write a surface too, as PLY, OBJ, STL, OFF or GLB (extra [open3d])."
)
@click.option("--replace", is_flag=True, help="Write new points only, without the input points.")
@click.option(
    "--bad",
    type=click.Choice(["refuse", "drop"]),
    default="refuse",
    show_default=True,
    help="Refuse a cloud with points that are not finite, or drop these points.",
)
@click.option(
    "--format",
    "suffix",
    default=None,
    help="Format of IN, whatever its suffix: ply, xyz, kitti, nuscenes, colmap …; and of a pipe OUT.  "
    "[default: by the suffix; ply for pipes and files without]",
)
@click.option("--device", default="auto", show_default=True, help="Device: auto, cpu, cuda, cuda:1.")
@jobs_option("Processes.  [default: all cores from 20,000 points on]")
@click.option("--scheduler", metavar="ADDRESS", default=None, help="Use the workers of this Dask scheduler instead.")
@click.option(
    "--plugin",
    "plugins",
    multiple=True,
    type=PLUGIN,
    metavar="FILE",
    help="Load parts that the weights need from this Python file. May be repeated.",
)
@click.option("--quiet", is_flag=True, help="Print errors only.")
def upsample(
    cloud: Path,
    out: Path,
    rate: float | None,
    count: int | None,
    touch: Path | None,
    model: str | None,
    mesh: Path | None,
    replace: bool,
    bad: Literal["refuse", "drop"],
    suffix: str | None,
    device: str,
    jobs: int | None,
    scheduler: str | None,
    plugins: tuple[Path, ...],
    quiet: bool,
) -> None:
    """Make a cloud dense and write it.

    Frame and unit stay. The input points are kept. New points get colours and other columns from their neighbours.
    The suffix sets the format: PLY, PCD, XYZ, CSV, NPY, NPZ, LAS, LAZ or OBJ; E57, STL, GLB and OFF can be read too,
    and KITTI, nuScenes and COLMAP by --format.
    """
    import time
    import warnings

    from rich.console import Console

    from pcsr.clouds.formats import CLOUD_WRITERS, cloud_bytes, read_cloud, read_cloud_pipe, writable, write_cloud
    from pcsr.progress import progress_bars

    start = time.perf_counter()
    if mesh is not None:
        from pcsr.clouds.reconstruction import check_suffix, open3d, write_surface

        check_suffix(mesh)  # before the work, not after it
        open3d()
    console = Console(stderr=True, quiet=quiet)
    chosen = ".ply" if suffix is None and (cloud == PIPE or cloud.suffix == "") else suffix
    kind = f".{(suffix or 'ply').lower().lstrip('.')}"
    kind = kind if kind in CLOUD_WRITERS else ".ply"
    target = out if out != PIPE else Path(f"pipe{kind}")
    writable(target)  # before the work, not after it
    if out == PIPE:
        streams.open_output()
    given = (
        read_cloud_pipe(streams.open_input(), chosen or ".ply", "the cloud from the pipe", bad=bad)
        if cloud == PIPE
        else read_cloud(cloud, chosen, bad=bad)
    )
    writable(target, given)
    if given.about.get("dropped"):
        console.print(f"{given.about['dropped']} points are not finite and were dropped", style="yellow")
    touches, recorded = [], 0
    if touch is not None:
        from pcsr.recorded import read

        recording = read(touch)
        touches, recorded = recording.touches, len(recording.touches) + len(recording.skipped)
        for name, reason in recording.skipped.items():  # also with --quiet
            click.echo(f"touch {name} is skipped: {reason}", err=True)
    from pcsr.model import load  # imports torch, so mistakes in files are reported first

    with warnings.catch_warnings(record=True) as warned, progress_bars(console, hidden=quiet) as progress:
        warnings.simplefilter("always", PcsrWarning)
        device_name = _device(device)
        try:
            loaded = load(model, plugins=plugins, device=device_name)
        except UserError as error:
            from pcsr.validation_messages import shown

            raise UserError(f"--model {shown(model or 'frames')}: {error}") from error
        task = progress.add_task("upsampling", total=len(given.points))
        dense = loaded.upsample(
            given,
            touches,
            rate,
            count=count,
            keep=not replace,
            jobs=jobs or _jobs(len(given), device),
            scheduler=scheduler,
            advance=lambda done, total: progress.update(task, completed=done, total=total),
        )
    for one in warned:
        if issubclass(one.category, PcsrWarning):
            console.print(str(one.message), style="yellow", markup=False, soft_wrap=True)
    if out == PIPE:
        streams.put(cloud_bytes(dense, kind))
    else:
        write_cloud(out, dense)
    if mesh is not None:
        console.print(f"{write_surface(mesh, dense)} triangles: {mesh}", markup=False, soft_wrap=True)
    seconds = time.perf_counter() - start
    touched = f" and {len(touches)} of {recorded} touches" if touches else ""
    console.print(
        f"{len(given.points)} points{touched} to {len(dense.points)} by {loaded.name} in {seconds:.1f} s: {out}",
        markup=False,
        soft_wrap=True,
    )


def _device(name: str) -> str:
    import torch

    found = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if name == "auto":
        return "cuda" if found else "cpu"
    if name != "cpu" and not re.fullmatch(r"cuda(:\d{1,3})?", name):
        from pcsr.validation_messages import shown

        raise UserError(f"--device {shown(name)}: pcsr computes on auto, cpu, cuda, or cuda:1 for the second device")
    if name != "cpu" and not found:
        raise UserError(f"--device {name}: torch finds no CUDA device here; use cpu, or install torch for CUDA")
    if name != "cpu" and int(name.partition(":")[2] or 0) >= found:
        raise UserError(f"--device {name}: the last of the CUDA devices here is cuda:{found - 1}")
    return name


def _jobs(count: int, device: str) -> int:
    """Return the default number of processes: all cores for large clouds on the CPU, otherwise 1."""
    import os

    from pcsr.workers import MOST_JOBS

    return min(os.cpu_count() or 1, MOST_JOBS) if count > 20_000 and device in ("auto", "cpu") else 1
