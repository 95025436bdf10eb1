"""`pcsr upsample`: the command that upsamples a cloud in a file or pipe."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pcsr.cli import streams
from pcsr.cli.denoising import DENOISE, DenoisingCommand, denoised
from pcsr.cli.options import FILE, PLUGIN, columns_option, jobs_option
from pcsr.cli.registered import RegistrationOutput
from pcsr.cli.streaming import PIPE, is_streamed, stages
from pcsr.cli.touch_options import TouchOptions, touch_options
from pcsr.cli.upsample_options import default_jobs, load_model
from pcsr.cli.warnings_shown import yellow_warnings, yellow_warnings_at_once

if TYPE_CHECKING:
    from pcsr.clouds.faults import Bad


@click.command(cls=DenoisingCommand)
@click.argument("cloud", type=FILE, metavar="IN")
@click.option("-o", "--out", type=FILE, required=True, metavar="OUT", help="File of the dense cloud; - for a pipe.")
@click.option("--rate", type=float, default=None, help="Output points per input point, 1.1 to 64.  [default: 4]")
@click.option(
    "--points", "count", type=click.IntRange(1), default=None, help="Number of output points, instead of a rate."
)
@DENOISE
@touch_options
@click.option("--model", default=None, help="Weights: a name, run folder or file; or midpoint.  [default: field]")
@click.option(
    "--mesh",
    type=FILE,
    default=None,
    metavar="FILE",
    help="Write a surface through the dense cloud too, as PLY, OBJ, STL, OFF or GLB (extra [open3d]).",
)
@click.option(
    "--fields",
    type=click.Choice(["source", "error"]),
    multiple=True,
    help="Add a column: source is 0 for scanned points, 1 for made ones, 2 for touched ones of unseen regions; error "
    "is the expected distance of each point from the true surface, one standard deviation. May be repeated.",
)
@click.option("--replace", is_flag=True, help="Write new points only, without the input points.")
@click.option(
    "--bad",
    type=click.Choice(["refuse", "drop", "keep"]),
    default="refuse",
    show_default=True,
    help="Treatment of points that are not finite, of sentinels such as many points at 0 0 0, and of far outliers. "
    "refuse: write nothing; drop: remove them, and copies of exact duplicates; keep: write them as they are, unused.",
)
@columns_option
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
@click.option(
    "--stream/--no-stream",
    default=None,
    help="Go through the cloud in parts, from disk to disk, whatever its size; or hold it in memory.  "
    "[default: in parts above 2,000,000 points, if IN and OUT are PLY, NPY, LAS or LAZ]",
)
@click.option("--quiet", is_flag=True, help="Print errors only.")
def upsample(
    cloud: Path,
    out: Path,
    rate: float | None,
    count: int | None,
    denoise: bool | float | None,
    touch: TouchOptions,
    model: str | None,
    mesh: Path | None,
    fields: tuple[str, ...],
    replace: bool,
    bad: "Bad",
    columns: str | None,
    suffix: str | None,
    device: str,
    jobs: int | None,
    scheduler: str | None,
    plugins: tuple[Path, ...],
    stream: bool | None,
    quiet: bool,
) -> None:
    """Make a cloud dense and write it.

    Frame and unit stay. The input points are kept, where they are unless --denoise is given. New points get colours and
    other columns from their neighbours. The suffix sets the format: PLY, PCD, XYZ, CSV, NPY, NPZ, LAS, LAZ or OBJ; E57,
    STL, GLB and OFF can be read too, and KITTI, nuScenes and COLMAP by --format.
    """
    import time

    import numpy as np

    from pcsr.clouds.faults import screen
    from pcsr.clouds.formats import CLOUD_WRITERS, cloud_bytes, read_cloud, read_cloud_pipe, writable, write_cloud
    from pcsr.clouds.formats.format_table import without_suffix
    from pcsr.progress import progress_bars

    start = time.perf_counter()
    if mesh is not None:
        from pcsr.clouds.reconstruction import check_suffix, open3d, write_surface

        check_suffix(mesh)  # before the work, not after it
        open3d()
    console = streams.console(error=True, quiet=quiet)
    chosen = ".ply" if suffix is None and without_suffix(cloud) else suffix
    kind = f".{(suffix or 'ply').lower().lstrip('.')}"
    kind = kind if kind in CLOUD_WRITERS else ".ply"
    target = out if out != PIPE else Path(f"pipe{kind}")
    writable(target)  # before the work, not after it

    def report(given: int, written: int, model_name: str, touches: RegistrationOutput) -> None:
        touched = f" and {touches.used} of {touches.all} touches" if touches.all else ""
        seconds = time.perf_counter() - start
        console.print(
            f"{given} points{touched} to {written} by {model_name} in {seconds:.1f} s: {out}",
            markup=False,
            soft_wrap=True,
        )

    if is_streamed(cloud, chosen, out, stream, mesh=mesh, columns=columns, denoise=denoise is not None):
        from pcsr.streaming import upsample_file

        recording = touch.read()
        touches = RegistrationOutput(recording, console, touch.report)
        with yellow_warnings_at_once(console), progress_bars(console, hidden=quiet) as progress:
            loaded = load_model(model, plugins, device)
            streamed = upsample_file(
                loaded,
                cloud,
                out,
                recording.touches,
                rate,
                count=count,
                keep=not replace,
                fields=fields,
                bad=bad,
                pose_error=recording.pose_error,
                touch_as_is=touch.as_is,
                suffix=chosen,
                jobs=jobs or default_jobs(None, device),
                scheduler=scheduler,
                registered=touches,
                advance=stages(progress),
            )
        report(streamed.given, streamed.written, loaded.name, touches)
        return
    if out == PIPE:
        streams.open_output()
    name = "the cloud from the pipe" if cloud == PIPE else str(cloud)
    with yellow_warnings(console):
        read = (
            read_cloud_pipe(streams.open_input(), chosen or ".ply", name, bad="keep", columns=columns)
            if cloud == PIPE
            else read_cloud(cloud, chosen, bad="keep", columns=columns)
        )
        given = screen(read, bad, name)
    trial = given.cloud.with_fields(fields, np.zeros(0, np.int64), np.full(len(given.cloud), np.nan))
    writable(target, trial, bad=bad)
    touches = RegistrationOutput(touch.read(), console, touch.report)
    if denoise is not None:
        jobs_then = jobs or default_jobs(len(given.points), device)
        given = denoised(given, denoise, jobs=jobs_then, scheduler=scheduler, console=console, quiet=quiet)
    with yellow_warnings(console), progress_bars(console, hidden=quiet) as progress:
        loaded = load_model(model, plugins, device)
        used = touches.register(given.points, progress, as_is=touch.as_is)
        task = progress.add_task("upsampling", total=int(given.used.sum()))
        dense = loaded.upsample(
            given,
            used,
            rate,
            count=count,
            keep=not replace,
            fields=fields,
            touch_as_is=touch.as_is,
            jobs=jobs or default_jobs(len(given.points), device),
            scheduler=scheduler,
            advance=lambda done, total: progress.update(task, completed=done, total=total),
        )
    written = len(dense)
    if out == PIPE:
        streams.put(cloud_bytes(dense, kind, bad=bad))
    else:
        write_cloud(out, dense, bad=bad)
    if mesh is not None:
        dense = dense if replace else given.without_kept(dense)
        console.print(f"{write_surface(mesh, dense)} triangles: {mesh}", markup=False, soft_wrap=True)
    report(len(given.cloud), written, loaded.name, touches)
