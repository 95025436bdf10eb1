"""Weights of another network are named, and not put in."""

from pathlib import Path

import pytest
import torch

from pcsr.errors import UserError
from pcsr.weights.fit import fill


def test_missing_and_unknown_weights_are_named_and_nothing_is_changed():
    network = torch.nn.Linear(2, 1)
    before = network.weight.clone()
    tensors = {"weight": torch.zeros(1, 2), "bias2": torch.zeros(1)}
    with pytest.raises(UserError, match=r"in here do not fit .*: the file has no bias; the network has no bias2\."):
        fill(network, tensors, Path("here"))
    assert torch.equal(network.weight, before)


def test_of_many_misfits_three_are_named():
    with pytest.raises(
        UserError, match=r"the network has no 0; the network has no 1; the network has no 2 and 4 more\."
    ):
        fill(torch.nn.Identity(), {str(i): torch.zeros(1) for i in range(7)}, Path("here"))
