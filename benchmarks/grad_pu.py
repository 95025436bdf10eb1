"""Grad-PU's published weights as a weights file of this project, which `pcsr upsample --model FILE` takes.

python benchmarks/grad_pu.py published.safetensors grad-pu.safetensors

The first file holds the tensors of the authors' `ckpt-epoch-60.pth`, by their names; nothing is unpickled here.
Their network is encoder `mlp` with a batch norm, backbone `grad-pu` and upsampler `descent`, all at their defaults.
"""

import re
import sys
from collections.abc import Mapping
from pathlib import Path

from safetensors.torch import load_file
from torch import Tensor

import pcsr
from pcsr import UserError
from pcsr.network.build import build
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr.weights.fit import fill

RECIPE = Path(__file__).parents[1] / "pcsr/recipes" / "grad-pu.yaml"
SOURCE = "He et al., Grad-PU, CVPR 2023; github.com/yunhe20/Grad-PU, Apache-2.0"

LAYER = r"feature_extractor\.dense_blocks\.(\d)\.0\.dense_layers\.(\d)\."
NAMES = {
    r"feature_extractor\.conv_init\.": r"encoder.layer.",
    LAYER + r"conv_bottle\.": r"backbone.blocks.\1.layers.\2.bottleneck.",
    LAYER + r"point_conv\.conv_delta\.": r"backbone.blocks.\1.layers.\2.convolution.way.",
    LAYER + r"point_conv\.conv_feats\.": r"backbone.blocks.\1.layers.\2.convolution.feature.",
    LAYER + r"point_conv\.post_conv\.": r"backbone.blocks.\1.layers.\2.convolution.post.",
    r"feature_extractor\.dense_blocks\.(\d)\.1\.trans\.": r"backbone.blocks.\1.transition.",
    r"p2p_regressor\.mlp_(\d)\.": r"upsampler.layers.\1.",
}
"""How their names begin, and ours."""
LAYERS = {"0": "linear", "1": "norm"}
"""Our names of the layers of a block, by the number in theirs."""


def convert(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Their tensors by our names: the state of the network of `pcsr/recipes/grad-pu.yaml`.

    Their layers are convolutions of width 1; ours are linear ones, whose weights lack the axes of length 1.

    Raises:
        UserError: a tensor that their network has not.
    """
    return {_renamed(name): tensor.flatten(1) if tensor.ndim > 2 else tensor for name, tensor in tensors.items()}


def _renamed(name: str) -> str:
    for theirs, ours in NAMES.items():
        if begins := re.match(theirs, name):
            rest = name[begins.end() :]
            return begins.expand(ours) + re.sub(r"^\d", lambda number: LAYERS[number[0]], rest)
    raise UserError(f"'{name}' is no tensor of Grad-PU: hand in the published weights, nothing else")


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
