"""`pcsr figures`: the figures of run folders as PNG files."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from safetensors.numpy import save_file

from pcsr.cli import pcsr
from pcsr.errors import UserError


@pytest.fixture
def folder(tmp_path):
    """A run folder of one object."""
    folder = tmp_path / "run"
    folder.mkdir()
    rng = np.random.default_rng(0)
    sizes = {"input": 32, "touches": 20, "truth": 128, "net": 128}
    clouds = {f"0/{key}": rng.normal(size=(size, 3)).astype(np.float32) for key, size in sizes.items()}
    save_file(clouds, folder / "examples.safetensors", {"names": '["part"]'})
    results = {
        "name": "net", "fingerprint": "ab12cd34ef56", "seed": 0, "version": "0", "recipe": {"name": "net"},
        "data": {
            "shapes": "cad-parts", "split": "test", "points": 32, "truth": 128, "rate": 4, "touches": 2,
            "sampling": "random", "normalisation": "none",
        },
        "metrics": {"cd": {"description": "distance", "scale": 1000}}, "objects": ["part"], "groups": ["part"],
        "methods": [{"name": "net", "parameters": 1, "seconds": 0.1, "values": {"cd": [0.1]}}], "created": "today",
    }  # fmt: skip
    (folder / "results.json").write_text(json.dumps(results), encoding="utf-8")
    return folder


def test_it_writes_the_figures_and_says_where(folder, tmp_path):
    done = CliRunner().invoke(pcsr, ["figures", str(folder), "-o", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    paths = [Path(line) for line in done.output.splitlines()]
    assert {path.name for path in paths} == {"closeups.png", "touches.png", "object-0.png"}
    for path in paths:
        with Image.open(path) as image:
            assert image.format == "PNG"


def test_by_default_they_go_to_figures(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert CliRunner().invoke(pcsr, ["figures", "run"]).exit_code == 0
    assert (tmp_path / "figures" / "object-0.png").is_file()


@pytest.mark.parametrize("missing", ["results.json", "examples.safetensors"])
def test_a_folder_that_lacks_a_file_is_a_mistake(folder, tmp_path, missing):
    (folder / missing).unlink()
    done = CliRunner().invoke(pcsr, ["figures", str(folder), "-o", str(tmp_path / "out")])
    assert done.exit_code == UserError.exit_code
    assert f"{folder / missing} is missing; do `pcsr run` again" in done.stderr
    assert not (tmp_path / "out").exists()
