"""A metric and a baseline that a plugin file brings, in Python, in recipes and on the command line."""

import numpy as np
import pytest
from click.testing import CliRunner

import pcsr
from pcsr.cli import pcsr as command
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import RecipeError, load

PLUGIN = """
import numpy as np
from pcsr import Baseline, Metric, hookimpl


class Extent(Metric):
    description = "difference of the extents along x"
    scale = 10

    def measure(self, prediction, target, mesh=None):
        return abs(float((prediction[:, 0].max() - target[:, 0].max())))


class Copies(Baseline):
    def upsample(self, points, rate, mesh, rng):
        return np.repeat(points, rate, axis=0)


@hookimpl
def pcsr_register(register):
    register.metric("extent", Extent)
    register.baseline("copies", Copies)
"""


@pytest.fixture
def plugin(tmp_path):
    path = tmp_path / "extent.py"
    path.write_text(PLUGIN)
    return path


def test_without_the_plugin_the_name_is_a_mistake_with_its_place(tmp_path):
    path = tmp_path / "recipe.yaml"
    path.write_text("name: x\nevaluate: {metrics: [cd, extent], baselines: [copy]}\n")
    with pytest.raises(RecipeError) as mistakes:
        load(path, load_plugins())
    first, second = str(mistakes.value).splitlines()
    assert first.startswith(f"{path}:2:26: evaluate.metrics.1: there is no metric 'extent'")
    assert second == f"{path}:2:47: evaluate.baselines.0: there is no baseline 'copy': known: floor, midpoint"


def test_python_and_the_command_measure_by_it(plugin, tmp_path):
    cloud = np.random.default_rng(0).normal(size=(20, 3))
    other = cloud + np.array([1.0, 0.0, 0.0])
    values = pcsr.evaluate(cloud, other, metrics=["cd", "extent"], frame="none", plugins=[plugin])
    assert values["extent"] == pytest.approx(1)
    assert pcsr.evaluate(cloud, other, metrics="cd", frame="none") == {"cd": values["cd"]}
    with pytest.raises(pcsr.UserError, match="there is no metric 'extent'"):
        pcsr.evaluate(cloud, other, metrics="extent")
    for name, points in (("a", cloud), ("b", other)):
        np.savetxt(tmp_path / f"{name}.xyz", points)
    arguments = ["evaluate", str(tmp_path / "a.xyz"), str(tmp_path / "b.xyz"), "--frame", "none", "--metric", "extent"]
    done = CliRunner().invoke(command, [*arguments, "--plugin", str(plugin)])
    assert done.exit_code == 0, done.output
    assert "difference of the extents along x" in done.output
