"""benchmarks/expected_errors.py and fit_errors.py: bins, clouds, the fit, and the table."""

import importlib
import json
from pathlib import Path

import numpy as np
import pytest
import torch
from click.testing import CliRunner

from pcsr.plugins.loading import load_plugins
from pcsr.uncertainty.fitted import fitted_networks
from pcsr.uncertainty.quantile_network import RESOLUTION, QuantileNetwork

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    script, scans, clouds, fit, chart = map(
        importlib.import_module,
        ("expected_errors", "error_scans", "error_clouds", "fit_errors", "reliability_chart"),
    )


def normal(count, factor=1.0, seed=0):
    """Errors of one shape, normal with the standard deviation that is expected, or a factor of it."""
    rng = np.random.default_rng(seed)
    expected = np.exp(rng.normal(size=count))
    return scans.Errors(expected, factor * np.abs(rng.normal(size=count)) * expected)


def test_errors_of_the_expected_deviation_are_within_in_68_percent_in_each_bin():
    rows = script.bins([normal(5000), normal(5000, seed=1)])
    assert len(rows) == 10
    assert [row[0] for row in rows] == ["1000"] * 10
    assert all(64 <= float(row[3]) <= 72 for row in rows)
    medians = [float(row[1]) for row in rows]
    assert medians == sorted(medians)
    for row in rows[1:-1]:
        assert float(row[2]) == pytest.approx(float(row[1]), rel=0.15)


def test_expectations_that_are_too_small_show_and_so_do_shapes_that_differ():
    rows = script.bins([normal(5000, 2.0)])
    assert all(float(row[3]) < 50 for row in rows)
    assert all(float(row[4]) == 0 for row in rows), "one shape has no spread"
    differing = script.bins([normal(5000, 0.3), normal(5000, 2.0, 1)])
    assert all(float(row[4]) > 10 for row in differing)


def test_training_clouds_are_the_same_each_time_and_of_all_families():
    shapes = {name: load_plugins().get("shapes", name)() for name in set(clouds.SHAPES)}
    one, other = (clouds.training_case(7, shapes)[0] for _ in range(2))
    np.testing.assert_array_equal(one.points, other.points)
    made = {name: [] for name in shapes}

    def taken(name):
        def item(label):
            made[name].append(label)
            raise LookupError

        return item

    for name, source in shapes.items():
        source.item = taken(name)
    for number in range(144):
        with pytest.raises(LookupError):
            clouds.training_case(number, shapes)
    for name, items in made.items():
        assert len(set(items)) == len(items), "no object is taken twice"
        assert {item.split("/")[0] for item in items} == {"train"}
        assert {item.split("/")[1] for item in items} == set(shapes[name].families)


@pytest.mark.parametrize("sampling", clouds.SAMPLINGS)
def test_points_of_a_sampling_lie_on_the_surface(sampling):
    mesh = load_plugins().get("shapes", "cad-parts")().item("train/plate/0000").mesh
    points = clouds.sampled(mesh, sampling, 200, np.random.default_rng(0), "plate")
    assert points.shape == (200, 3)
    size = np.ptp(mesh.vertices, axis=0).max()
    assert clouds.distances(points, mesh).max() < 1e-6 * size
    moved = clouds.noisy(points, 0.01, np.random.default_rng(0)) - points
    assert moved.std() == pytest.approx(0.01 * clouds.radius(points), rel=0.1)


def test_the_fit_finds_the_quantile_of_errors_that_depend_on_a_feature(monkeypatch):
    monkeypatch.setattr(fit, "EPOCHS", 6)
    rng = torch.Generator().manual_seed(0)
    inputs = torch.randn((20_000, 2), generator=rng)
    errors = torch.randn(20_000, generator=rng).abs() * torch.exp(inputs[:, 0])
    fitted = fit.Fit(inputs, torch.log(errors + RESOLUTION), "test")
    network = QuantileNetwork.of(("a", "b"), fitted.tensors())
    a = np.linspace(-1.5, 1.5, 7)
    found = network({"a": a, "b": np.zeros(7)})
    np.testing.assert_allclose(found, 0.994 * np.exp(a), rtol=0.15)  # 68 % of a normal distribution


@pytest.mark.slow
def test_a_fit_goes_on_where_it_was_and_is_saved(tmp_path, monkeypatch):
    monkeypatch.setattr(fit, "FILE", tmp_path / "fitted.safetensors")
    monkeypatch.setattr(fit, "EPOCHS", 1)
    monkeypatch.setattr(clouds, "COUNTS", (180, 200))
    monkeypatch.setattr(fit.error_clouds, "OTHERS", ("midpoint",))
    done = CliRunner().invoke(fit.main, [str(tmp_path / "work"), "--clouds", "10"])
    assert done.exit_code == 0, done.output
    assert not (tmp_path / "fitted.safetensors").exists()
    files = {file: file.stat().st_mtime_ns for file in (tmp_path / "work").iterdir()}
    assert {file.name[6] for file in files} == {"0", "1", "2"}
    assert {int(file.name[:5]) for file in files if file.name[6] == "2"} == {0, 4, 8}
    gone = sorted(files)[-1]
    gone.unlink()
    done = CliRunner().invoke(fit.main, [str(tmp_path / "work"), "--clouds", "10", "--save"])
    assert "rated: loss" in done.output
    networks = fitted_networks(tmp_path / "fitted.safetensors")
    assert len(networks.rated.names) == len(networks.plain.names) + 1
    assert gone.exists()
    assert all(file.stat().st_mtime_ns == time for file, time in files.items() if file.name[:5] != gone.name[:5])


@pytest.mark.slow
def test_the_table_has_the_bins_of_each_kind_and_model_and_there_is_a_picture(tmp_path, monkeypatch):
    monkeypatch.setattr(script, "PARTS", dict(list(scans.PARTS.items())[:2]))
    saved = []
    monkeypatch.setattr(script, "save", lambda *arguments: saved.append(arguments))
    monkeypatch.setattr(script, "NUMBERS", tmp_path / "numbers")
    (tmp_path / "pictures").mkdir()
    done = CliRunner().invoke(script.main, ["--parts", "2", "--models", "midpoint", "--save"])
    assert done.exit_code == 0, done.output
    ((name, command, columns, rows),) = saved
    assert (name, command) == ("expected-errors", "python benchmarks/expected_errors.py --save")
    kinds = ["parts, random", "parts, random, 1 % noise", scans.TOGETHER, scans.TOUCHED]
    assert [row[0] for row in rows[::10]] == kinds
    assert [int(row[2]) for row in rows] == list(range(1, 11)) * 4
    points = [sum(int(row[3]) for row in rows if row[0] == kind) for kind in kinds[:3]]
    assert points[2] == points[0] + points[1]
    assert len(columns) == len(rows[0])
    assert (tmp_path / "pictures" / "reliability.png").read_bytes().startswith(b"\x89PNG")


def test_the_page_has_what_was_measured():
    numbers = Path(__file__).parents[2] / "docs" / "numbers" / "expected-errors.json"
    if not numbers.exists():
        pytest.skip("nothing was measured yet")
    assert tuple(json.loads(numbers.read_text(encoding="utf-8"))["columns"]) == chart.COLUMNS
