"""Coverage of the 95 % intervals of `pcsr compare`: how often they hold the true mean, beside plain percentiles.

python benchmarks/intervals.py [--trials 1000] [--save]
"""

from collections.abc import Callable

import click
import numpy as np
from rich.progress import track
from saved import save, show

from pcsr.report.tables.significance import CONFIDENCE, RESAMPLES, interval

Draw = Callable[[np.random.Generator, int], np.ndarray]
DISTRIBUTIONS: dict[str, Draw] = {
    "normal": lambda rng, count: rng.normal(size=count),
    "exponential, shifted to mean 0": lambda rng, count: rng.exponential(size=count) - 1,
    "log-normal, shifted to mean 0": lambda rng, count: rng.lognormal(size=count) - np.exp(0.5),
}
"""Distributions of the differences, all of mean 0."""
OBJECTS = (6, 8, 12, 24, 48)


def percentiles(differences: np.ndarray, rng: np.random.Generator) -> tuple[float, float]:
    """Plain percentiles of bootstrap means."""
    means = differences[rng.integers(len(differences), size=(RESAMPLES, len(differences)))].mean(1)
    low, high = np.quantile(means, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return float(low), float(high)


@click.command()
@click.option("--trials", type=click.IntRange(10), default=1000, show_default=True)
@click.option("--save", "saving", is_flag=True, help="Write docs/numbers/intervals.json.")
def main(trials: int, saving: bool) -> None:
    """Print the coverage for each distribution and number of objects."""
    columns, rows = ("differences", "interval", *(f"{count} objects" for count in OBJECTS)), []
    for name, draw in DISTRIBUTIONS.items():
        held = np.zeros((2, len(OBJECTS)))
        for k, count in enumerate(OBJECTS):
            rng = np.random.default_rng(count)
            for _ in track(range(trials), f"{name}, {count} objects", transient=True):
                differences = draw(rng, count)
                ends = interval(differences), percentiles(differences, rng)
                held[:, k] += [pair is not None and pair[0] <= 0 <= pair[1] for pair in ends]
        for kind, shares in zip(("of `pcsr compare`", "plain percentiles"), held / trials, strict=True):
            rows.append([name, kind, *(f"{share:.1%}" for share in shares)])
    show(columns, rows)
    if saving:
        save("intervals", f"python benchmarks/intervals.py --trials {trials} --save", columns, rows)


if __name__ == "__main__":
    main()
