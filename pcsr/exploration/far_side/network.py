"""Network that guesses the far side of an object from an image of its seen side.

It is a U-Net (Ronneberger et al., MICCAI 2015). benchmarks/fit_far_side.py fits it to generated parts.
"""

import functools
from pathlib import Path

import torch
from safetensors.torch import load_file
from torch import Tensor, nn
from torch.nn.functional import interpolate, max_pool2d

FILE = Path(__file__).with_name("far_side.safetensors")
WIDTH = 16
"""Channels of the first layer."""


class FarSideNetwork(nn.Module):
    """Maps images (b 4 rows columns) to occupancy, depth of the far side, and its uncertainty."""

    def __init__(self, width: int = WIDTH) -> None:
        super().__init__()
        self.down = nn.ModuleList([_block(4, width), *(_block(k * width, (k + 1) * width) for k in (1, 2, 3))])
        self.up = nn.ModuleList([_block((2 * k + 1) * width, k * width) for k in (3, 2, 1)])
        self.last = nn.Conv2d(width, 3, 1)

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Guess the far side.

        Args:
            images: images of `pcsr.exploration.far_side.image`, (b 4 rows columns).

        Returns:
            For each pixel, (b rows columns): the logit that its line of sight meets the object; the depth of the last
            surface on it; and the logarithm of the mean absolute error of that depth.
        """
        levels = [self.down[0](images)]
        for block in self.down[1:]:
            levels.append(block(max_pool2d(levels[-1], 2)))
        features = levels.pop()
        for block in self.up:
            wider = interpolate(features, scale_factor=2.0, mode="bilinear", align_corners=False)
            features = block(torch.cat([wider, levels.pop()], 1))
        occupied, depth, error = self.last(features).unbind(1)
        return occupied, depth, error.clamp(-5, 2)


def _block(inputs: int, outputs: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for first in (inputs, outputs):
        layers += [nn.Conv2d(first, outputs, 3, padding=1), nn.GroupNorm(4, outputs), nn.SiLU()]
    return nn.Sequential(*layers)


@functools.cache
def fitted_network(path: Path = FILE) -> FarSideNetwork:
    """Read the network that pcsr ships; each process reads the file once."""
    network = FarSideNetwork()
    network.load_state_dict({name: tensor.float() for name, tensor in load_file(path).items()})
    return network.eval()
