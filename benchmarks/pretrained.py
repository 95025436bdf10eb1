"""The table of `make run`: the shipped weights and the baselines on the same test parts.

python benchmarks/pretrained.py RUNS [--save [--name pretrained]]
"""

import json
from pathlib import Path
from typing import Any

import click
import numpy as np
from saved import save, show

from pcsr.metrics.touch_effect import EFFICIENCY, efficiency

NETWORKS = ("field", "frames", "tapsr", "pu-transformer")


def row(run: dict[str, Any], method: dict[str, Any], name: str) -> list[str]:
    """Mean ± sample standard deviation of each metric over the objects; of a network its touch efficiency."""
    cells = [f"`{name}`"]
    for metric, about in run["metrics"].items():
        values = about["scale"] * np.array(method["values"][metric])
        digits = 3 if metric == "cd" else 1
        cells.append(f"{values.mean():.{digits}f} ± {values.std(ddof=1):.{digits}f}")
    if name not in NETWORKS:
        return [*cells, ""]
    effect = run["touch"]
    share = efficiency(effect["touched"], effect["plain"], effect["replaced"]) if effect else None
    return [*cells, "–" if share is None else f"{share:.2f}"]


@click.command()
@click.argument("runs", type=click.Path(path_type=Path, exists=True))
@click.option("--save", "saving", is_flag=True, help="Write docs/numbers/NAME.json.")
@click.option("--name", default="pretrained", show_default=True, help="Name of the file: real-parts for other data.")
def main(runs: Path, saving: bool, name: str) -> None:
    """Print the table of the runs `pretrained-…` in RUNS."""
    found = {network: list(runs.glob(f"pretrained-{network}-*/results.json")) for network in NETWORKS}
    if any(len(paths) != 1 for paths in found.values()):
        raise click.ClickException(f"{runs} must hold one run of each of {', '.join(NETWORKS)}: `make run` makes them")
    results = {name: json.loads(path.read_text(encoding="utf-8")) for name, (path,) in found.items()}
    rows = [row(run, run["methods"][0], name) for name, run in results.items()]
    first = results[NETWORKS[0]]
    rows += [row(first, method, method["name"]) for method in first["methods"][1:]]
    columns = ["method", *first["metrics"], EFFICIENCY]
    show(columns, rows)
    if saving:
        own = "make run; python benchmarks/pretrained.py runs --save"
        save(
            name,
            own if name == "pretrained" else f"python benchmarks/pretrained.py {runs} --save --name {name}",
            columns,
            rows,
        )


if __name__ == "__main__":
    main()
