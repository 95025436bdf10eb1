"""The state of a training run, to a file and back."""

import json

import pytest
import torch

from pcsr.experiments.train_state import load_training, save_training
from pcsr.weights.file import read_card


@pytest.mark.parametrize("kind", [torch.optim.Adam, torch.optim.AdamW])
def test_training_goes_on_as_if_never_saved(tmp_path, kind):
    def step(network, optimizer):
        optimizer.zero_grad()
        network(torch.arange(6.0).view(2, 3)).square().sum().backward()
        optimizer.step()

    torch.manual_seed(0)
    network = torch.nn.Linear(3, 2)
    optimizer = kind(network.parameters(), lr=0.1)
    step(network, optimizer)
    path, about = tmp_path / "checkpoint.safetensors", {"step": 1, "seconds": 0.5}
    save_training(path, network, optimizer, about)
    other = torch.nn.Linear(3, 2)
    restored = kind(other.parameters(), lr=0.1)
    assert load_training(path, other, restored) == about
    for _ in range(3):
        step(network, optimizer)
        step(other, restored)
    assert torch.equal(network.weight, other.weight)
    assert json.dumps(about) in json.dumps(read_card(path))
