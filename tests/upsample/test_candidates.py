"""Where candidates come from: interpolation, a network in memory, and the same network from its file."""

import numpy as np
import pytest
import torch
from torch import nn

from pcsr import RunError
from pcsr.network.load import load_weights
from pcsr.plugins.loading import load_plugins
from pcsr.upsample.candidates import Midpoints, Networked, Stored
from pcsr.weights import shipped


def ball(count=64, seed=0):
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


class Echo(nn.Module):
    """Makes each point twice, and remembers what it was asked. It thins nothing, and has no `forward`."""

    def __init__(self, factor=1.0, errors=None):
        super().__init__()
        self.errors = errors
        self.factor = nn.Parameter(torch.tensor(factor))
        self.asked = []

    def candidates(self, points, rate, touches=None):
        self.asked.append(None if touches is None else touches.points)
        return points.repeat_interleave(rate, dim=1) * self.factor, self.errors


def networked(network, **changes):
    settings = {"size": 64, "rate": 2, "any_rate": True, "most_touches": 3, "touch_points": 10, **changes}
    made = object.__new__(Networked)
    for name, value in {"network": network, **settings}.items():
        object.__setattr__(made, name, value)
    return made


def test_a_network_gives_its_rate_of_candidates_in_double_precision():
    made = networked(Echo())(ball(), [], 2)
    assert made.points.dtype == made.errors.dtype == np.float64
    np.testing.assert_allclose(made.points, np.repeat(ball(), 2, axis=0), atol=1e-6)
    assert not made.errors.any(), "it predicts none"


def test_predicted_errors_are_those_of_the_network_and_finite():
    errors = torch.rand(1, 128)
    np.testing.assert_allclose(networked(Echo(errors=errors))(ball(), [], 2).errors, errors[0].numpy())
    with pytest.raises(RunError, match="its weights are damaged"):
        networked(Echo(errors=errors / 0))(ball(), [], 2)


def test_touches_become_as_many_points_as_the_network_knows():
    echo = Echo()
    networked(echo)(ball(), [ball(4, 1), ball(10, 2), ball(300, 3)], 2)
    (given,) = echo.asked
    assert given.shape == (1, 3, 10, 3)
    different = sorted(len({tuple(point) for point in touch.numpy().round(5)}) for touch in given[0])
    assert different == [4, 10, 10], "a touch of four points has each of them two or three times"


def test_of_more_touches_than_it_knows_the_nearest_are_used():
    echo = Echo()
    touches = [np.full((10, 3), place) for place in (0.9, 0.1, 0.5, 0.3, 0.7)]
    networked(echo)(ball(), touches, 2)
    assert sorted(echo.asked[0][0, :, 0, 0].tolist()) == pytest.approx([0.1, 0.3, 0.5])


def test_the_order_of_a_touchs_points_does_not_matter():
    echo = Echo()
    touch = ball(50, 1)
    for one in (touch, touch[::-1]):
        networked(echo)(ball(), [one], 2)
    assert torch.equal(*echo.asked)


def test_a_network_that_gives_nonsense_is_said():
    with pytest.raises(RunError, match="its weights are damaged"):
        networked(Echo(float("nan")))(ball(), [], 2)


def test_a_stored_network_is_the_one_in_memory():
    network, recipe, _ = load_weights(shipped("tapsr"), load_plugins())
    memory = Networked.of(network, recipe)
    stored = Stored(shipped("tapsr"), (), recipe.data.points, recipe.data.rate, any_rate=False)
    of = "size", "rate", "any_rate"
    assert [getattr(stored, name) for name in of] == [getattr(memory, name) for name in of] == [512, 16, False]
    touches = [ball(40, 1) * 0.2]
    np.testing.assert_array_equal(stored(ball(80), touches, 16).points, memory(ball(80), touches, 16).points)


@pytest.mark.parametrize(("rate", "made"), [(4, 4), (8, 16)])
def test_interpolation_gives_as_many_for_each_as_are_asked_for_or_more(rate, made):
    assert Midpoints()(ball(), [], rate).points.shape == (64 * made, 3)
