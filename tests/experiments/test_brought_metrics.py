"""A metric and a baseline that a plugin file brings, in Python, in recipes and on the command line."""

import numpy as np
import pytest
from click.testing import CliRunner

import pcsr
from pcsr.cli import pcsr as command
from pcsr.experiments.methods import upsampled
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


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("prediction[:] = 0; return 0.0", None),
        ("return 'none'", "metric 'mine' gave 'none', not a finite number: mend it, or leave it out"),
        ("return float('nan')", "metric 'mine' gave nan, not a finite number"),
        ("return prediction.sum()", "metric 'mine' gave .*, not a finite number"),
    ],
)
def test_a_metric_of_a_plugin_is_not_trusted(tmp_path, body, message):
    path = tmp_path / "mine.py"
    path.write_text(
        "from pcsr import Metric, hookimpl\nclass Mine(Metric):\n    description = 'mine'\n"
        f"    def measure(self, prediction, target, mesh=None):\n        {body}\n"
        "@hookimpl\ndef pcsr_register(register): register.metric('mine', Mine)\n"
    )
    cloud = np.random.default_rng(0).normal(size=(20, 3))
    if message is None:
        values = pcsr.evaluate(cloud, 2 * cloud, metrics=["mine", "cd"], plugins=[path])
        assert values["cd"] == pcsr.evaluate(cloud, 2 * cloud, metrics="cd")["cd"]
        return
    with pytest.raises(pcsr.UserError, match=message):
        pcsr.evaluate(cloud, cloud, metrics=["mine"], plugins=[path])


@pytest.mark.parametrize(
    "dense", ["points", "np.repeat(points, rate + 1, axis=0)", "[0.0]", "np.full((rate * len(points), 3), np.nan)"]
)
def test_a_baseline_of_a_plugin_is_not_trusted(dense):
    class Mine(pcsr.Baseline):
        def upsample(self, points, rate, mesh, rng):
            points += 1.0
            return eval(dense, {"np": np, "points": points, "rate": rate})

    cloud = np.random.default_rng(0).normal(size=(20, 3))
    before = cloud.copy()
    with pytest.raises(pcsr.UserError, match=r"baseline 'mine' gave .*, not finite points of shape \(80, 3\): mend it"):
        upsampled("mine", Mine(), cloud, 4, None, np.random.default_rng(0))
    assert np.array_equal(cloud, before)
