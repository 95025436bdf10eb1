"""Are expected errors calibrated? The share of new points that lie within their expected error, in ten bins of it.

python benchmarks/expected_errors.py [pugan21.npz] [--parts 24] [--models field,midpoint,tapsr] [--save]

The parts are those of pcsr/recipes/touch/parts.yaml, the test split, scaled to 30 mm: 512 points, at random or as depth
cameras see them, 4x. Noise is Gaussian, in percent of the radius of the cloud: on each axis, or along the rays of
cameras. All kinds of clouds of parts are also measured together. With FILE, PU-GAN's shapes too: 2048 points, 4x,
scaled to a radius of 1. The last rows are of touched points after their registration, four touches of a DIGIT for each
part. Bins have equal numbers of points. The standard error of a share is that over the shapes, by 200 resamplings. The
networks that predict the errors were fitted to other shapes (benchmarks/fit_errors.py).
"""

from collections.abc import Sequence
from pathlib import Path

import click
import numpy as np
from error_scans import (
    PARTS,
    SHAPES,
    TOGETHER,
    TOUCHED,
    Errors,
    joined,
    scans_of_parts,
    scans_of_shapes,
    touched,
    upsampled,
)
from reliability_chart import BINS, COLUMNS, draw
from rich.console import Console
from rich.progress import track
from saved import NUMBERS, save, show

import pcsr
from pcsr.errors import PcsrError

QUANTILE = 0.68
RESAMPLINGS = 200


def bins(shapes: Sequence[Errors]) -> list[list[str]]:
    """Cells of each bin: points, expected error, the true one at the same quantile, share within, standard error."""
    expected, true = (np.concatenate([getattr(one, name) for one in shapes]) for name in ("expected", "true"))
    of_shape = np.repeat(np.arange(len(shapes)), [len(one.true) for one in shapes])
    rng, rows = np.random.default_rng(0), []
    for members in np.array_split(np.argsort(expected, kind="stable"), BINS):
        within = true[members] <= expected[members]
        hits = np.bincount(of_shape[members], within, len(shapes))
        counts = np.bincount(of_shape[members], minlength=len(shapes))
        drawn = rng.integers(len(shapes), size=(RESAMPLINGS, len(shapes)))
        spread = (hits[drawn].sum(1) / np.maximum(counts[drawn].sum(1), 1)).std()
        actual = np.quantile(true[members], QUANTILE)
        values = (np.median(expected[members]), actual, 100 * within.mean(), 100 * spread)
        rows.append([str(len(members)), f"{values[0]:.3g}", f"{values[1]:.3g}", f"{values[2]:.0f}", f"{values[3]:.1f}"])
    return rows


@click.command()
@click.argument("file", required=False, type=click.Path(path_type=Path, exists=True, dir_okay=False))
@click.option("--parts", "count", type=click.IntRange(1, 24), default=24, show_default=True)
@click.option("--models", default="field,midpoint,tapsr", show_default=True)
@click.option("--save", "saving", is_flag=True, help="Write docs/numbers/expected-errors.json and the picture.")
def main(file: Path | None, count: int, models: str, saving: bool) -> None:
    """Print the bins of each kind of cloud and model, and the picture of them."""
    rows: list[list[str]] = []

    def measured(kind: str, name: str, shapes: Sequence[Errors]) -> None:
        found = bins(shapes)
        rows.extend([kind, name, str(number), *cells] for number, cells in enumerate(found, 1))
        shares = [int(cells[3]) for cells in found]
        click.echo(f"{kind}, {name}: {' '.join(map(str, shares))}, mean {np.mean(shares):.0f} %", err=True)

    try:
        loaded = [pcsr.load(name) for name in models.split(",")]
        of_parts: dict[str, list[list[Errors]]] = {model.name: [] for model in loaded}
        for kind in track([*PARTS, *(SHAPES if file else ())], "kinds", console=Console(stderr=True), transient=True):
            scans = list(scans_of_parts(kind, count) if kind in PARTS or file is None else scans_of_shapes(file, kind))
            for model in loaded:
                found = [upsampled(model, scan) for scan in scans]
                measured(kind, model.name, found)
                if kind in PARTS:
                    of_parts[model.name].append(found)
        for name, kinds in of_parts.items():
            measured(TOGETHER, name, [joined(of_part) for of_part in zip(*kinds, strict=True)])
        measured(TOUCHED, "registration", list(touched(count)))
    except PcsrError as error:
        raise click.ClickException(str(error)) from error
    show(COLUMNS, rows)
    if saving:
        command = " ".join(["python benchmarks/expected_errors.py", *([file.name] if file else []), "--save"])
        save("expected-errors", command, COLUMNS, rows)
        draw(rows, NUMBERS.parent / "pictures" / "reliability.png")


if __name__ == "__main__":
    main()
