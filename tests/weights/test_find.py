"""Weights by name, file or run folder."""

import json
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from pcsr import weights
from pcsr.errors import UserError
from pcsr.weights.find import find
from tests.small_run import put


def test_shipped_weights_go_by_their_names(tmp_path, monkeypatch):
    assert weights.DEFAULT in weights.names()
    assert find("tapsr") == weights.shipped("tapsr")
    monkeypatch.chdir(tmp_path)
    Path("tapsr").write_text("something else")
    assert find("tapsr") == weights.shipped("tapsr")
    assert find("./tapsr") == find("tapsr", paths_first=True) == Path("tapsr")


def test_a_file_is_relative_to_the_folder_unless_it_says_all(tmp_path):
    path = tmp_path / "w.safetensors"
    path.write_bytes(b"")
    assert find("w.safetensors", tmp_path) == path
    assert find(str(path), Path("elsewhere")) == path
    with pytest.raises(
        UserError, match=r"no weights 'w.safetensors', neither shipped ones nor a file or run folder below/w.safet"
    ):
        find("w.safetensors", Path("below"))


def test_no_name_leads_out_of_the_folder_of_shipped_weights(tmp_path, monkeypatch):
    monkeypatch.setattr(weights, "HERE", tmp_path / "shipped")
    (tmp_path / "shipped").mkdir()
    (tmp_path / "outside.safetensors").write_bytes(b"")
    with pytest.raises(UserError, match=r"no weights '../outside'"):
        find("../outside")


def test_a_run_folder_stands_for_the_weights_in_it(tmp_path):
    (tmp_path / "run").mkdir()
    with pytest.raises(UserError, match=r"run is a folder, not a weights file, and holds no weights\.safetensors"):
        find("run", tmp_path)
    (tmp_path / "run" / weights.WEIGHTS).write_bytes(b"")
    assert find("run", tmp_path) == tmp_path / "run" / weights.WEIGHTS


def test_a_run_without_weights_has_those_of_the_other_run_of_its_recipe(tmp_path):
    """Rows that differ in the touches at evaluation are of one network, which the first of them trained."""

    def write(name, **card):
        (tmp_path / name).mkdir(exist_ok=True)
        save_file({"a": torch.zeros(1)}, tmp_path / name / weights.WEIGHTS, {"pcsr": json.dumps(card)})

    put(tmp_path / "row-ab12cd34")
    write("other-ab12cd34", fingerprint="ab12cd34ef1", data_fingerprint="f00")
    write("rebuilt-ab12cd34", fingerprint="ab12cd34ef0", data_fingerprint="f01")
    with pytest.raises(UserError, match=r"row-ab12cd34 holds no weights\.safetensors, and .* none of another run"):
        find("row-ab12cd34", tmp_path)
    write("trained-ab12cd34", fingerprint="ab12cd34ef0", data_fingerprint="f00")
    assert find("row-ab12cd34", tmp_path) == tmp_path / "trained-ab12cd34" / weights.WEIGHTS
    write("row-ab12cd34", fingerprint="ab12cd34ef0", data_fingerprint="f00")
    assert find("row-ab12cd34", tmp_path) == tmp_path / "row-ab12cd34" / weights.WEIGHTS
