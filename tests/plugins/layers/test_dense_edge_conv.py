"""Dense edge convolutions against the words of the papers, edge by edge."""

import pytest
import torch
from torch.nn import functional as F

from pcsr import UserError
from pcsr_plugins.layers.dense_edge_conv import DenseEdgeConv
from tests.plugins.compare import same_gradients


def literal(block: DenseEdgeConv, x: torch.Tensor) -> torch.Tensor:
    """One cloud (n c), one point and one edge at a time."""
    rows = []
    for i, own in enumerate(x):
        distance = (x - own).norm(dim=-1)
        nearest = [j for j in distance.argsort().tolist() if j != i][: block.neighbours]
        edges = []
        for j in nearest:
            y = F.relu(block.layers[0](torch.cat([own, x[j] - own])))
            dense = torch.cat([y, own])
            for layer in block.layers[1:-1]:
                dense = torch.cat([F.relu(layer(dense)), dense])
            edges.append(torch.cat([block.layers[-1](dense), dense]))
        rows.append(torch.stack(edges).amax(0))
    return torch.stack(rows)


@pytest.mark.parametrize("layers", [2, 3, 4])
def test_a_block_is_its_edges_one_by_one_forward_and_backward(layers):
    block, x = DenseEdgeConv(5, 4, layers, 6).double(), torch.randn(2, 17, 5, dtype=torch.float64, requires_grad=True)
    fast, slow = block(x), torch.stack([literal(block, cloud) for cloud in x])
    assert fast.shape == (2, 17, block.channels) == (2, 17, 5 + 4 * layers)
    torch.testing.assert_close(fast, slow)
    same_gradients(fast, slow, (x, *block.parameters()))


def test_a_block_of_one_layer_has_no_activation():
    block = DenseEdgeConv(2, 3, 1, 1)
    with torch.no_grad():
        for weight in block.parameters():
            weight.fill_(-1)
    x = torch.tensor([[[1.0, 0.0], [3.0, 0.0]]])
    # −(xᵢ + xⱼ − xᵢ) − 1, from each point to the other one.
    assert block(x)[0, :, 0].tolist() == [-4, -2]


def test_too_few_points_are_refused():
    DenseEdgeConv(3, 2, 3, 16)(torch.randn(1, 17, 3))
    with pytest.raises(UserError, match="17 neighbours were asked of 16 points"):
        DenseEdgeConv(3, 2, 3, 16)(torch.randn(1, 16, 3))
