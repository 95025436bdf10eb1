"""`edge-conv`: one edge convolution of the coordinates."""

import torch

from pcsr import Widths
from pcsr_plugins.encoders.edge_conv import EdgeConv
from tests.plugins.compare import close
from tests.plugins.slow_edges import edge, nearest


def test_the_encoder_is_an_edge_convolution_of_the_coordinates():
    encoder, points = EdgeConv(Widths(), channels=7, neighbours=4), torch.randn(1, 12, 3)
    for i, row in enumerate(nearest(points[0], 4)):
        expected = torch.stack([edge(encoder.layer, points[0, i], points[0, j]) for j in row]).max(0).values
        close(encoder(points)[0, i], expected)
