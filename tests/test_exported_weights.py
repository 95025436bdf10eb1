"""Weights that are exported: whole, in half precision, or refused."""

import pytest
import torch
from click.testing import CliRunner

import pcsr.cli
from pcsr.cli.export import export
from pcsr.errors import UserError
from pcsr.export import export_weights
from pcsr.model import load
from tests.small_model import clouds, tiny_model


@pytest.fixture
def tiny():
    return tiny_model()


@pytest.fixture(scope="module")
def shipped():
    return load("tapsr")


@pytest.mark.parametrize("half", [False, True])
def test_exported_weights_are_loaded_again_with_their_card(shipped, tmp_path, half):
    path = tmp_path / "folder" / "out.safetensors"
    export_weights(shipped, path, half=half)
    again = load(path)
    assert again.recipe.resolved() == shipped.recipe.resolved()
    assert {**again.card, "sha256": ""} == {**shipped.card, "sha256": ""}
    for one, other in zip(again.network.parameters(), shipped.network.parameters(), strict=True):
        assert torch.equal(one, other.half().float() if half else other)
    if half:
        assert path.stat().st_size < 0.52 * 4 * shipped.network.parameter_count
    points = clouds(1, 0)[0]
    with torch.inference_mode():
        made, expected = (model.network(points, 16) for model in (again, shipped))
    assert (made - expected).abs().max() < (0.02 if half else 1e-6)


def test_a_network_in_memory_is_exported_with_its_recipe(tiny, tmp_path):
    export_weights(tiny, tmp_path / "t.safetensors")
    again = load(tmp_path / "t.safetensors")
    assert again.recipe.resolved() == tiny.recipe.resolved()
    assert again.card["metrics"] == tiny.card["metrics"]


def test_a_weights_file_may_be_halved_in_its_place(tiny, tmp_path):
    path = tmp_path / "t.safetensors"
    export_weights(tiny, path)
    before = path.stat().st_size
    result = CliRunner().invoke(export, [str(path), "-o", str(path), "--half"])
    assert result.exit_code == 0, result.output
    assert f"{path}: weights in half precision, " in result.output
    assert path.stat().st_size < before
    assert load(path).recipe.resolved() == tiny.recipe.resolved()


def test_what_is_no_network_and_where_no_file_can_be_is_said_of_weights_too(tiny, tmp_path):
    with pytest.raises(UserError, match="'midpoint' has no network"):
        export_weights(load("midpoint"), tmp_path / "m.safetensors")
    with pytest.raises(UserError, match=f"{tmp_path} is a folder: name the file to write, such as .*/weights.safetens"):
        export_weights(tiny, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["w.safetensors", "--touches", "2"], "--touches applies to ONNX graphs"),
        (["w.safetensors", "--points", "64"], "--points applies to ONNX graphs"),
        (["w.safetensors", "--touch-points", "64"], "--touch-points applies to ONNX graphs"),
        (["w.safetensors", "--batch", "dynamic"], "--batch applies to ONNX graphs"),
        (
            ["m.onnx", "--half"],
            "--half applies to weights, and m.onnx is no .safetensors file: change its suffix, or leave --half out",
        ),
    ],
)
def test_options_that_mean_nothing_to_the_file_are_refused(tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(pcsr.cli.pcsr, ["export", "tapsr", "-o", *words])
    assert result.exit_code == UserError.exit_code
    assert said in result.output
    assert not list(tmp_path.iterdir())
