"""What is read of a weights file."""

import torch

from pcsr.files import save_tensors
from pcsr.weights.file import read_file


def test_tensors_come_as_they_are_stored_or_not_at_all(tmp_path):
    path = tmp_path / "w.safetensors"
    save_tensors(path, {"a": torch.ones(2, dtype=torch.half)}, {"pcsr": '{"b": 1}'})
    tensors, card = read_file(path)
    assert (card, tensors["a"].dtype) == ({"b": 1}, torch.half)
    assert read_file(path, tensors=False) == ({}, {"b": 1})
