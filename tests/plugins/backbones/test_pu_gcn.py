"""`pu-gcn`: Inception DenseGCN, neighbour by neighbour."""

import torch

from pcsr import Widths
from pcsr_plugins.backbones.pu_gcn import PUGCN, DensePath
from tests.plugins.compare import close
from tests.plugins.slow_edges import edge, nearest


def dense_slowly(path: DensePath, x: torch.Tensor, near: list[list[int]]) -> torch.Tensor:
    rows = []
    for i, row in enumerate(near):
        edges = []
        for j in row:
            first = edge(path.edge, x[i], x[j])
            second = torch.relu(path.twice(torch.relu(path.twice(first))))
            third = torch.relu(path.last(torch.cat([first, second])))
            edges.append(torch.cat([first, second, third]))
        rows.append(torch.stack(edges).max(0).values)
    return torch.stack(rows)


def backbone_slowly(backbone: PUGCN, x: torch.Tensor) -> torch.Tensor:
    """Of one cloud's features (n c): neighbour by neighbour."""
    given = []
    for block in backbone.blocks:
        near = nearest(x, block.neighbours * block.dilation)
        reduced = torch.relu(block.reduce(x))
        y = torch.cat(
            [
                dense_slowly(block.near, reduced, [row[: block.neighbours] for row in near]),
                dense_slowly(block.far, reduced, [row[:: block.dilation] for row in near]),
                torch.stack([row.max() for row in x])[:, None],
            ],
            dim=1,
        )
        x = y + x if x.shape == y.shape else y
        given.append(x)
    return sum(given[1:], given[0]) / len(given)


@torch.no_grad()
def test_the_backbone_is_its_slow_form():
    backbone, features = PUGCN(Widths(visual=8), blocks=3, growth=4, neighbours=3).double(), torch.randn(2, 14, 8)
    refined = backbone(torch.randn(2, 14, 3), features.double())
    assert refined.shape == (2, 14, backbone.channels) == (2, 14, 25)
    for b in range(2):
        close(refined[b], backbone_slowly(backbone, features[b].double()), 1e-9)
