"""Upsamplers with a learned distance."""

import pytest
import torch

from pcsr import Upsampler
from pcsr_plugins.layers.distance_regressor import DistanceRegressor
from pcsr_plugins.upsamplers.descent import Descent


def test_descent_is_one_and_the_base_class_predicts_nothing():
    assert issubclass(Descent, DistanceRegressor)
    assert issubclass(DistanceRegressor, Upsampler)
    with pytest.raises(NotImplementedError):
        DistanceRegressor().distance(torch.zeros(1, 2, 3), torch.zeros(1, 5, 3), torch.zeros(1, 5, 4))
