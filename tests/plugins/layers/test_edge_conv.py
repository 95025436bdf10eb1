"""Edge convolutions and the graph of the nearest, edge by edge."""

import torch

from pcsr_plugins.layers.edge_conv import EdgeConv, graph
from tests.plugins.compare import close
from tests.plugins.slow_edges import edge, nearest


def test_the_graph_has_the_nearest_others():
    x = torch.randn(2, 15, 6)
    assert graph(x, 4).tolist() == [nearest(x[0], 4), nearest(x[1], 4)]


def test_edge_convolution_is_the_edges_and_their_maximum():
    x = torch.randn(2, 15, 6)
    layer, near = EdgeConv(6, 5), graph(x, 4)
    for b in range(2):
        for i in range(15):
            expected = torch.stack([edge(layer, x[b, i], x[b, j]) for j in near[b, i]]).max(0).values
            close(layer(x, near)[b, i], expected)
