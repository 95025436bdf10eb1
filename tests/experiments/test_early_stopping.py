"""Early stopping: its count, the weights that it keeps, and its state."""

import math

import pytest
import torch

from pcsr.experiments.early_stopping import EarlyStopping


def after(errors, patience=2):
    network, stopping = torch.nn.Linear(1, 1, bias=False), EarlyStopping(patience)
    for step, error in enumerate(errors, 1):
        with torch.no_grad():
            network.weight.fill_(step)
        stopping.add(error, step, network)
    return stopping, network


@pytest.mark.parametrize(
    ("errors", "due", "best"),
    [
        ([3.0], False, 1),
        ([3.0, 2.0, 2.5], False, 2),
        ([3.0, 2.0, 2.5, 2.0], True, 2),
        ([3.0, 2.0, 2.5, 1.9], False, 4),
        ([math.nan, 1.0, math.nan], False, 2),
    ],
)
def test_it_ends_after_validations_without_a_lower_error_and_keeps_the_best(errors, due, best):
    stopping, network = after(errors)
    assert (stopping.due, stopping.step, stopping.lowest) == (due, best, errors[best - 1])
    stopping.restore(network)
    assert network.weight.item() == best


def test_where_no_error_is_a_number_the_last_weights_stay():
    stopping, network = after([math.nan, math.nan])
    assert stopping.due
    stopping.restore(network)
    assert network.weight.item() == 2


@pytest.mark.parametrize("errors", [[], [1 / 3], [3.0, 0.1, 0.2]])
def test_its_state_comes_back_to_the_last_bit(errors):
    stopping, _ = after(errors)
    other = EarlyStopping(2)
    other.load_state_dict(stopping.state_dict())
    assert (other.lowest, other.step, other.since) == (stopping.lowest, stopping.step, stopping.since)
    assert other.weights.keys() == stopping.weights.keys()
    assert all(torch.equal(tensor, stopping.weights[name]) for name, tensor in other.weights.items())
