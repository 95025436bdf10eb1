"""`set-abstraction`: PU-Net's first level."""

import torch

from pcsr import Widths
from pcsr_plugins.encoders.set_abstraction import BallEncoder
from tests.plugins.compare import close


def test_the_encoder_sees_differences_of_places_alone():
    encoder, points = BallEncoder(Widths(), radius=0.5).double(), torch.rand(2, 40, 3, dtype=torch.float64)
    features = encoder(points)
    assert features.shape == (2, 40, 64)
    assert features.std(1).amax() > 1e-3
    close(encoder(points + torch.tensor([3.0, -1, 2])), features, 1e-9)
