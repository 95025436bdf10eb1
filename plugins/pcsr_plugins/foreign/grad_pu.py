"""The published weights of Grad-PU (He et al., CVPR 2023; Apache-2.0) in our parts, by name.

Their network is encoder `mlp` with a batch norm, backbone `grad-pu` and upsampler `descent`, all at their defaults:
`recipes/grad-pu.yaml`. `benchmarks/grad_pu.py` makes a weights file of them.
"""

import re
from collections.abc import Mapping

from torch import Tensor

from pcsr import UserError

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
PLACES = {"0": "linear", "1": "norm"}
"""What stands at a place in a layer of theirs."""


def convert(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Their tensors by our names: the state of the network of `recipes/grad-pu.yaml`.

    Their layers are convolutions of width 1; ours are linear ones, whose weights lack the axes of length 1.

    Raises:
        UserError: a tensor that their network has not.
    """
    return {_renamed(name): tensor.flatten(1) if tensor.ndim > 2 else tensor for name, tensor in tensors.items()}


def _renamed(name: str) -> str:
    for theirs, ours in NAMES.items():
        if begins := re.match(theirs, name):
            rest = name[begins.end() :]
            return begins.expand(ours) + re.sub(r"^\d", lambda place: PLACES[place[0]], rest)
    raise UserError(f"'{name}' is no tensor of Grad-PU: hand in the published weights, nothing else")
