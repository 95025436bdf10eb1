"""The convolution over frames, edge by edge."""

import torch

from pcsr_plugins.layers.local_frame_conv import LocalFrameConv
from pcsr_plugins.layers.local_frames import LocalFrames
from tests.plugins.compare import close
from tests.plugins.slow_frames import curved


def test_a_convolution_is_its_formula_edge_by_edge():
    points, features = curved(2, 20), torch.randn(2, 20, 3, dtype=torch.float64)
    conv, frames = LocalFrameConv(3, 7).double(), LocalFrames.of(points, 6)
    edges, convolved = frames.edges, conv(features, frames, frames.edges)
    assert convolved.shape == (2, 20, 7)
    for b in range(2):
        for i in range(20):
            messages = []
            for edge, j in zip(edges[b, i], frames.index[b, i], strict=True):
                here, there = conv.here.weight @ features[b, i] + conv.here.bias, conv.there.weight @ features[b, j]
                messages.append(torch.relu(here + there + conv.edge.weight @ edge))
            both = torch.cat([torch.stack(messages).max(0).values, torch.stack(messages).mean(0)])
            close(convolved[b, i], conv.out.weight @ both + conv.out.bias, 1e-9)
