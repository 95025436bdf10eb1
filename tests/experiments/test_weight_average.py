"""Averages of weights over the steps, against the sums written out."""

import pytest
import torch

from pcsr.experiments.weight_average import WeightAverage
from pcsr.recipe.train_section import Average


class Net(torch.nn.Module):
    def __init__(self, value=0.0):
        super().__init__()
        self.weight = torch.nn.Parameter(torch.full((2,), value))
        self.register_buffer("seen", torch.zeros((), dtype=torch.int64))


@pytest.fixture
def add(monkeypatch):
    """Averages weights of 1, 2, 3 … after steps 1, 2, 3 …"""

    def run(settings, steps, epochs=4, per_epoch=2):
        network = Net()
        average = WeightAverage(network, settings, epochs, per_epoch)
        for step in range(1, steps + 1):
            with torch.no_grad():
                network.weight.fill_(float(step))
                network.seen.fill_(step)
            average.add(network, step)
        return average

    return run


@pytest.mark.parametrize("decay", [None, 0.5])
def test_an_exponential_average_begins_with_the_first_step(add, decay):
    kept = 0.999 if decay is None else decay
    expected = 1.0
    for step in (2, 3, 4):
        expected = kept * expected + (1 - kept) * step
    network = add(Average(use="ema", decay=decay), 4).network
    assert network.weight.tolist() == pytest.approx([expected] * 2)
    assert int(network.seen) == 4


@pytest.mark.parametrize(
    ("start", "epochs", "after"), [(None, 4, 6), (None, 10, 16), (None, 1, 0), (None, 2, 2), (1, 4, 2), (0, 4, 0)]
)
def test_a_mean_is_that_of_the_steps_after_its_start(add, start, epochs, after):
    steps = 2 * epochs
    network = add(Average(use="swa", start=start), steps, epochs).network
    assert network.weight.tolist() == pytest.approx([(after + 1 + steps) / 2] * 2)


def test_before_its_start_there_is_none(add):
    assert add(Average(use="swa", start=2), 4).network is None
    assert add(Average(use="ema", start=2), 5).network.weight.tolist() == [5.0, 5.0]
