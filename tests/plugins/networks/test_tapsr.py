"""TAPSR's network, with the weights that come with pcsr, beside its plain twin."""

import pytest
import torch
from torch import nn
from torch.nn import functional as F

import pcsr
from pcsr import TouchBatch
from pcsr_plugins.backbones.pu_transformer import PUTransformer
from pcsr_plugins.encoders.unet import UNet
from pcsr_plugins.fusions.concat import Concat
from pcsr_plugins.fusions.iterative import Iterative
from pcsr_plugins.fusions.none import NoFusion
from pcsr_plugins.upsamplers.shuffle import Shuffle
from tests.plugins.compare import close
from tests.plugins.plain import plain
from tests.plugins.small_touches import WIDTHS


def example(counts: tuple[int, int], dtype: torch.dtype) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Two clouds of TAPSR's own size, with touches."""
    generator = torch.Generator().manual_seed(0)
    points = F.normalize(torch.randn(2, 512, 3, generator=generator), dim=-1).to(dtype)
    touches = torch.randn(2, 4, 512, 3, generator=generator).to(dtype) / 4
    return points, touches, torch.arange(4) < torch.tensor(counts)[:, None]


@pytest.mark.parametrize("counts", [(0, 0), (4, 4), (1, 3)])
@torch.no_grad()
def test_the_network_is_its_plain_twin(counts):
    """Of TAPSR's own size and weights: 512 points, rate 16, single precision."""
    network = pcsr.load("tapsr").network
    points, touches, mask = example(counts, torch.float32)
    close(network(points, 16, TouchBatch.of(touches, mask)), plain(network)(points, 16, TouchBatch.of(touches, mask)))


@pytest.mark.slow
@pytest.mark.parametrize("counts", [(0, 0), (4, 4), (1, 3)])
def test_the_network_has_the_gradients_of_its_plain_twin(counts):
    """In double precision. In single some of the millions of maxima are tied but for rounding, and each processor
    breaks ties in its own way: the gradients of single precision are held part by part, where ties can be left out.
    """
    network = pcsr.load("tapsr").network.double()
    twin = plain(network)
    points, touches, mask = example(counts, torch.float64)
    dense, expected = network(points, 16, TouchBatch.of(touches, mask)), twin(points, 16, TouchBatch.of(touches, mask))
    towards = torch.randn(dense.shape, generator=torch.Generator().manual_seed(1), dtype=dense.dtype)
    for output in (dense, expected):
        (output * towards).sum().backward()
    for (name, ours), wanted in zip(network.named_parameters(), twin.parameters(), strict=True):
        if wanted.grad is None:
            assert ours.grad is None, name
        elif not name.endswith("key.bias"):  # softmax does not depend on it: its gradient is rounding alone
            assert (ours.grad - wanted.grad).norm() <= 1e-9 * wanted.grad.norm(), name


def test_every_part_is_a_module_with_weights_or_none_at_all():
    trained = (UNet(WIDTHS, channels=8), Iterative(WIDTHS), Concat(WIDTHS), PUTransformer(WIDTHS), Shuffle(WIDTHS))
    assert all(isinstance(part, nn.Module) and list(part.parameters()) for part in trained)
    assert not list(NoFusion(WIDTHS).parameters())
