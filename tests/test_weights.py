"""Weights by name or file, and what is read of a file."""

from pathlib import Path

import pytest
import torch

from pcsr import weights
from pcsr.errors import UserError
from pcsr.files import save_tensors, sha256
from pcsr.weights.file import read_file


def test_shipped_weights_go_by_their_names(tmp_path, monkeypatch):
    assert weights.DEFAULT in weights.names()
    assert weights.found("tapsr") == weights.shipped("tapsr")
    monkeypatch.chdir(tmp_path)
    Path("tapsr").write_text("something else")
    assert weights.found("tapsr") == weights.shipped("tapsr")
    assert weights.found("./tapsr") == Path("tapsr")


def test_a_file_is_relative_to_the_folder_unless_it_says_all(tmp_path):
    path = tmp_path / "w.safetensors"
    path.write_bytes(b"")
    assert weights.found("w.safetensors", tmp_path) == path
    assert weights.found(str(path), Path("elsewhere")) == path
    with pytest.raises(UserError, match=r"no weights 'w.safetensors', neither shipped ones nor a file below/w.safet"):
        weights.found("w.safetensors", Path("below"))


def test_no_name_leads_out_of_the_folder_of_shipped_weights(tmp_path, monkeypatch):
    monkeypatch.setattr(weights, "HERE", tmp_path / "shipped")
    (tmp_path / "shipped").mkdir()
    (tmp_path / "outside.safetensors").write_bytes(b"")
    with pytest.raises(UserError, match=r"no weights '../outside'"):
        weights.found("../outside")


def test_tensors_come_as_they_are_stored_or_not_at_all(tmp_path):
    path = tmp_path / "w.safetensors"
    save_tensors(path, {"a": torch.ones(2, dtype=torch.half)}, {"pcsr": '{"b": 1}'})
    tensors, card = read_file(path)
    assert (card, tensors["a"].dtype) == ({"b": 1}, torch.half)
    assert read_file(path, tensors=False) == ({}, {"b": 1})


def test_the_hash_of_a_file_is_that_of_its_bytes(tmp_path):
    (tmp_path / "abc").write_bytes(b"abc")
    assert sha256(tmp_path / "abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
