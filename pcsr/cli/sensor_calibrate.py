"""`pcsr sensor calibrate`: calibrate a tactile sensor from images of a ball that is pressed into its gel."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE, MILLIMETRES
from pcsr.cli.sensor_images import check_distinct, echo_reasons, name_of
from pcsr.cli.sensor_presses import background_of, balls_of_tests, read_presses, with_balls
from pcsr.errors import UserError

if TYPE_CHECKING:
    from pcsr.sensors import Calibrated, Gel


class _Dome(click.ParamType[tuple[float, float] | str]):
    """Click type of the radii of a domed gel, or "flat"."""

    name = "l,s"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return two radii, or "flat"."""
        if value == "flat" or isinstance(value, tuple):
            return value
        words = str(value).split(",")
        if len(words) != 2:
            self.fail(f"'{str(value)[:40]}': it must be two radii in mm, as in 50,23, or flat", param, ctx)
        return tuple(MILLIMETRES.convert(word, param, ctx) for word in words)


@click.command()
@click.argument("presses", nargs=-1, type=FILE, metavar="[PRESS]...")
@click.option(
    "--ball",
    "balls",
    multiple=True,
    required=True,
    type=MILLIMETRES,
    metavar="MM",
    help="Diameter of the ball. May be repeated, once for PRESS and for each --press.",
)
@click.option(
    "--mm-per-pixel", required=True, type=MILLIMETRES, metavar="MM", help="Side of a pixel on the gel, as measured."
)
@click.option(
    "--sensor",
    required=True,
    metavar="NAME",
    help="Sensor: digit, gelsight-mini, or any other name. It sets the shape of the gel, which is flat by default.",
)
@click.option("-o", "--out", type=FILE, required=True, metavar="FILE", help="Calibration to write, as JSON.")
@click.option(
    "--background", type=FILE, metavar="FILE", help="Image of the untouched gel.  [default: median of the presses]"
)
@click.option(
    "--press",
    "more",
    multiple=True,
    type=FILE,
    metavar="PATH",
    help="Presses of a further ball, a folder or a file, with a --ball of their own. May be repeated.",
)
@click.option(
    "--test",
    "tests",
    multiple=True,
    type=FILE,
    metavar="PATH",
    help="Presses to measure the errors on, a folder or a file. May be repeated.",
)
@click.option(
    "--test-ball",
    "test_balls",
    multiple=True,
    type=MILLIMETRES,
    metavar="MM",
    help="Diameter of the ball of --test. May be repeated, once for each.  [default: that of --ball]",
)
@click.option(
    "--presses",
    "count",
    type=click.IntRange(5),
    metavar="N",
    help="Number of presses to fit, spread over the gel; the errors are measured on the others.  [default: all]",
)
@click.option(
    "--dome",
    type=_Dome(),
    metavar="L,S",
    help="Radii of a domed gel along the longer and the shorter side of the image, in mm; or flat.  "
    "[default: the sensor's]",
)
@click.option("--page", type=FILE, metavar="FILE", help="Write an HTML page with pictures of the presses.")
@click.option("--overwrite", is_flag=True, help="Replace files of -o and --page that exist.")
def calibrate(
    presses: tuple[Path, ...],
    balls: tuple[float, ...],
    mm_per_pixel: float,
    sensor: str,
    out: Path,
    background: Path | None,
    more: tuple[Path, ...],
    tests: tuple[Path, ...],
    test_balls: tuple[float, ...],
    count: int | None,
    dome: tuple[float, float] | str | None,
    page: Path | None,
    overwrite: bool,
) -> None:
    """Calibrate a tactile sensor from images of a pressed ball.

    PRESS is an image of a ball that is pressed into the gel, or a folder of them: 12 to 20, at places spread over the
    gel. The table has the errors on presses that were not used in the fit.

    \b
    pcsr sensor calibrate presses/ --ball 6.31 --mm-per-pixel 0.0634 --sensor gelsight-mini -o mini.json
    """  # noqa: D301 (click's mark is the letter itself)
    from pcsr.progress import progress_bars
    from pcsr.sensors import calibrate as calibrated

    _check_target("-o", out, (".json",), overwrite=overwrite)
    _check_target("--page", page, (".html", ".htm"), overwrite=overwrite)
    gel = _gel(sensor, dome)
    groups = [(list(presses), "PRESS")] if presses else []
    groups += [([path], "--press") for path in more]
    if not groups:
        raise UserError("PRESS is missing: name images of a pressed ball, or a folder of them")
    without = [] if background is None else [background]
    fitted = with_balls(groups, balls, "--ball", "PRESS and each --press", without)
    judged = with_balls(
        [([path], "--test") for path in tests],
        balls_of_tests(tests, test_balls, balls),
        "--test-ball",
        "each --test",
        without,
    )
    check_distinct([file for files, _ in (*fitted, *judged) for file in files])
    unreadable: dict[str, str] = {}
    images, test = read_presses(fitted, unreadable), read_presses(judged, unreadable)
    try:
        rest = background_of(background, images)
        with progress_bars(streams.console(error=True), hidden=False) as progress:
            task = progress.add_task("calibrating", total=None)
            made = calibrated(
                images,
                rest,
                mm_per_pixel=mm_per_pixel,
                sensor=sensor,
                gel=gel,
                test=test,
                count=count,
                progress=lambda done, total: progress.update(task, completed=done, total=total),
            )
    except UserError:
        echo_reasons(unreadable, "is refused")
        raise
    reasons = {**unreadable, **made.refused}
    order = [name_of(file) for files, _ in (*fitted, *judged) for file in files]
    made = replace(made, refused={name: reasons[name] for name in order if name in reasons})
    made.calibration.save(out)
    if page is not None:
        from pcsr.files import write_text
        from pcsr.report.web.calibration_page import calibration_page

        write_text(page, calibration_page(made, [*images, *test], rest))
    echo_reasons(made.refused, "is refused")
    # The report imports torch: mistakes are reported first.
    from pcsr.report.sensors.calibration_remarks import calibration_remarks
    from pcsr.report.tables.calibration_table import calibration_table

    console = streams.console()
    console.print(calibration_table(made))
    for line in calibration_remarks(made):
        console.print(line, style="yellow", markup=False, highlight=False, soft_wrap=True)
    for line in _summary(made, out, page):
        console.print(line, markup=False, highlight=False, soft_wrap=True)


def _check_target(option: str, path: Path | None, suffixes: tuple[str, ...], *, overwrite: bool) -> None:
    """Check that a file can be written, before the work.

    Raises:
        UserError: it has another suffix, exists, or cannot be a file.
    """
    from pcsr.files import check_target

    if path is None:
        return
    if path.suffix.lower() not in suffixes:
        raise UserError(f"{option} {path}: name a file with the suffix {suffixes[0]}")
    check_target(path)
    above = next(one for one in (path, *path.parents, Path()) if one.exists())
    if above != path and not above.is_dir():
        raise UserError(f"{option} {path}: {above} is a file: name a folder that exists, or can be made")
    if path.exists() and not overwrite:
        raise UserError(f"{option} {path} exists already: choose another file, or replace it (--overwrite)")


def _gel(sensor: str, dome: tuple[float, float] | str | None) -> "Gel":
    from pcsr.sensors import gel

    known = gel(sensor)
    if dome is None:
        return known
    return replace(known, dome=None if isinstance(dome, str) else dome)


def _summary(made: "Calibrated", out: Path, page: Path | None) -> list[str]:
    """Return what was written."""
    calibration = made.calibration
    dome = calibration.gel.dome
    shape = "flat" if dome is None else f"a dome of radii {dome[0]:g} and {dome[1]:g} mm"
    lines = [
        f"{out}: {calibration.sensor}, {calibration.columns} x {calibration.rows} pixels of "
        f"{calibration.mm_per_pixel:g} mm, the gel {shape}; fitted to {len(made.places)} presses, "
        f"{len(made.refused)} refused"
    ]
    return lines if page is None else [*lines, f"pictures: {page}"]
