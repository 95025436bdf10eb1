"""benchmarks/fit_far_side.py: views of known shapes, and the command."""

import importlib
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from click.testing import CliRunner

from pcsr.exploration.far_side.image import PIXELS, ViewFrame, pixel_centres
from pcsr.exploration.far_side.network import FarSideNetwork, fitted_network
from pcsr.geometry.rays import MeshRays

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    fit_far_side = importlib.import_module("fit_far_side")


@pytest.fixture
def rays():
    return MeshRays(trimesh.creation.icosphere(subdivisions=4), None, "ball")


def test_cameras_see_the_near_side(rays):
    points = fit_far_side.seen(rays, np.array([0.0, 0, 1]), np.random.default_rng(0))
    assert 100 < len(points) <= 3000
    assert np.median(points[:, 2]) > 0.3
    assert np.linalg.norm(points, axis=1) == pytest.approx(1, abs=0.05)


def test_the_far_depths_of_a_ball_are_those_of_its_lower_half(rays):
    top = np.random.default_rng(1).normal(size=(500, 3))
    top[:, 2] = np.abs(top[:, 2])
    top /= np.linalg.norm(top, axis=1, keepdims=True)
    frame = ViewFrame.along(top, np.eye(3))
    depths = fit_far_side.far_depths(rays, frame)
    met = np.isfinite(depths)
    points = frame.back(np.column_stack([pixel_centres(), depths])[met])
    assert (points[:, 2] < 0).all()
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1, atol=0.01)
    assert met.mean() == pytest.approx(np.pi / 4 / 1.15**2, abs=0.03)
    touched = fit_far_side.touched(depths, np.random.default_rng(0))
    assert np.isin(touched[:, 2], depths[met]).all()


def test_a_batch_is_turned_as_a_whole():
    torch.manual_seed(0)
    ramp = torch.arange(PIXELS**2).reshape(1, PIXELS, PIXELS)
    for _ in range(6):
        one, other = fit_far_side.turned([ramp, ramp.clone()])
        assert torch.equal(one, other)
        assert sorted(one.flatten().tolist()) == list(range(PIXELS**2))


def test_the_command_fits_and_saves(tmp_path, monkeypatch):
    monkeypatch.setattr(fit_far_side, "SHAPES", (("cad-parts", 9), ("blobs", 1)))
    monkeypatch.setattr(fit_far_side, "FILE", tmp_path / "weights.safetensors")
    result = CliRunner().invoke(fit_far_side.main, [str(tmp_path / "work"), "--views", "4", "--epochs", "2", "--save"])
    assert result.exit_code == 0, result.output
    assert [line.split()[:2] for line in result.output.splitlines() if "epoch" in line] == [
        ["epoch", "1:"],
        ["epoch", "2:"],
    ]
    made = sorted((tmp_path / "work").iterdir())
    assert len(made) >= 8
    fitted = fitted_network(tmp_path / "weights.safetensors")
    torch.manual_seed(0)
    assert not torch.equal(fitted.last.weight, FarSideNetwork().last.weight)
