"""Grad-PU's published weights as a weights file of this project, which `pcsr upsample --model FILE` takes.

python benchmarks/grad_pu.py published.safetensors grad-pu.safetensors

The first file holds the tensors of the authors' `ckpt-epoch-60.pth`, by their names; nothing is unpickled here.
"""

import sys
from pathlib import Path

from safetensors.torch import load_file

import pcsr
from pcsr.network.build import build
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr.weights.fit import fill
from pcsr_plugins.foreign.grad_pu import convert

RECIPE = Path(__file__).parents[1] / "recipes" / "grad-pu.yaml"
SOURCE = "He et al., Grad-PU, CVPR 2023; github.com/yunhe20/Grad-PU, Apache-2.0"


def main(published: Path, file: Path) -> None:
    """Read the one, write the other."""
    registry = load_plugins()
    (recipe,) = load(RECIPE, registry)
    network = build(recipe, registry)
    fill(network, convert(load_file(published)), published, remedy="Hand in Grad-PU's, whole")
    card = {
        "name": recipe.name,
        "recipe": recipe.resolved(),
        "version": pcsr.__version__,
        "training": {"source": SOURCE},
    }
    save_weights(file, network, card, registry)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:3]))
