"""How much a network's result depends on the features that its encoder gives: its error with those of another cloud.

pcsr data make tapsr -o data/ --set seed=0
python benchmarks/exchanged_features.py data/ tapsr pu-transformer runs/NAME-HASH [--save]

The networks get the test clouds, or patches of them, without touch and in the training's frame. Within each batch the
encoder's features are moved on by one cloud; coordinates stay.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import torch
from saved import save, show

from pcsr.data.batches import Batches
from pcsr.data.dataset import Split
from pcsr.errors import PcsrError, UserError
from pcsr.metrics.chamfer import chamfer
from pcsr.network.kinds import AnyNetwork
from pcsr.network.load import load_weights
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import Recipe
from pcsr.weights.find import find

BATCH = 8
"""Clouds, or patches, that exchange their features."""
COLUMNS = ("network", "clouds", "cd", "with another cloud's features", "change")


def measure(network: AnyNetwork, recipe: Recipe, split: Split) -> tuple[int, float, float]:
    """Measure a network with its own features and with those of another cloud.

    Returns:
        The number of clouds, and the mean Chamfer distance of both, in the frame of the training.

    Raises:
        UserError: there is one cloud alone.
    """
    if len(split) < 2:
        raise UserError("the test split has one object, and none to exchange features with: build more objects")
    batches = Batches(split, min(BATCH, len(split)), (0, 0), (), seed=0, patches=recipe.patches)
    errors: dict[int, list[torch.Tensor]] = {0: [], 1: []}
    for number in range(batches.per_epoch):
        batch = batches.at(number)
        for shift, found in errors.items():
            with torch.inference_mode(), network.encoder.register_forward_hook(_moved_on(shift)):
                found.append(chamfer(network(batch.points, recipe.network_rate), batch.truth))
    own, exchanged = (torch.cat(found).double() for found in errors.values())
    return len(own), float(own.mean()), float(exchanged.mean())


def _moved_on(shift: int) -> Any:
    """Hook of the encoder: its features, moved on along the batch."""
    return lambda module, given, made: made.roll(shift, 0)


def row(name: str, network: AnyNetwork, recipe: Recipe, split: Split) -> list[str]:
    """A line of the table; distances ×10³."""
    count, own, exchanged = measure(network, recipe, split)
    kind = "patches" if recipe.patches else "clouds"
    change = f"{100 * (exchanged / own - 1):+.1f} %"
    return [f"`{name}`", f"{count} {kind}", f"{1e3 * own:.3f}", f"{1e3 * exchanged:.3f}", change]


def table(weights: Sequence[str], split: Split) -> list[list[str]]:
    """A line for each network."""
    registry, rows = load_plugins(), []
    for use in weights:
        network, recipe, _ = load_weights(find(use), registry)
        name = use if Path(use).name == use else recipe.name
        rows.append(row(name, network, recipe, split))
    return rows


@click.command()
@click.argument("data", type=click.Path(path_type=Path, exists=True, file_okay=False))
@click.argument("weights", nargs=-1, required=True)
@click.option("--save", "saving", is_flag=True, help="Write docs/numbers/exchanged-features.json.")
def main(data: Path, weights: Sequence[str], saving: bool) -> None:
    """Print the table of WEIGHTS, names or run folders, on the test split of the built data set DATA."""
    torch.set_num_threads(1)
    try:
        rows = table(weights, Split.load(data, "test"))
        show(COLUMNS, rows)
        if saving:
            used = " ".join(use if Path(use).name == use else f"runs/{Path(use).name}" for use in weights)
            command = f"python benchmarks/exchanged_features.py data/ {used} --save"
            save("exchanged-features", f"pcsr data make tapsr -o data/ --set seed=0; {command}", COLUMNS, rows)
    except PcsrError as error:
        raise click.ClickException(str(error)) from error


if __name__ == "__main__":
    main()
