"""benchmarks/denoise.py: its shapes, its reference, and its tables."""

import importlib
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

from pcsr.metrics import point_to_surface

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    script, denoisers = map(importlib.import_module, ("denoise", "denoisers"))

BALL = trimesh.creation.icosphere(subdivisions=2, radius=7)


def shape(count=300):
    points = [np.asarray(BALL.sample(number, seed=number)) for number in (count, 4 * count)]
    return script.Shape.of(BALL, *points)


def test_a_shape_fills_the_unit_sphere_with_its_truth():
    found = shape()
    assert np.linalg.norm(found.cloud, axis=1).max() == pytest.approx(1)
    assert point_to_surface(found.truth, found.mesh.vertices, found.mesh.faces).max() < 1e-6
    assert (found.noisy(0.02) - found.cloud).std() == pytest.approx(0.02, rel=0.1)


def test_the_bilateral_filter_flattens_a_plane():
    rng = np.random.default_rng(0)
    plane = np.column_stack([rng.uniform(0, 20, (400, 2)), 0.2 * rng.normal(size=400)])
    assert denoisers.bilateral(plane, 0.2)[:, 2].std() < 0.7 * plane[:, 2].std()


def test_errors_are_means_over_the_shapes():
    shapes = [shape(), shape(200)]
    together = script.errors(shapes, lambda points, level: points)
    each = [script.errors([one], lambda points, level: points) for one in shapes]
    np.testing.assert_allclose(together, np.mean(each, axis=0))
    cd, p2f = np.reshape(together, (2, -1))
    assert (np.diff(p2f) > 0).all()
    assert cd[-1] > cd[0]


@pytest.mark.slow
def test_the_tables_have_a_row_for_each_method_and_level(monkeypatch):
    monkeypatch.setattr(script, "generated", lambda: [shape()])
    done = CliRunner().invoke(script.main, ["--only", "midpoint"])
    assert done.exit_code == 0, done.output
    lines = [line.split("|")[1].strip() for line in done.stdout.splitlines() if line.startswith("|")]
    assert lines[2:4] == ["midpoint", "bilateral filter, midpoint"]
    assert lines[-4:] == ["0", "0.5", "1", "2"]
