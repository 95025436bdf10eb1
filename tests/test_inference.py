"""What upsampling needs, and what it does without: the simulators, and the plugins that weights were trained with."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import pcsr
from pcsr.cli import pcsr as command
from pcsr.model import load
from pcsr.network.build import build
from pcsr.network.load import load_weights
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import RecipeError, from_resolved
from pcsr.recipe import load as load_recipe
from pcsr.recipe.part_keys import PARTS
from pcsr.upsample.candidates import TOUCH_POINTS, Networked
from pcsr.weights import shipped
from pcsr_plugins.touch.digit import Digit

SMOKE = Path(__file__).parents[1] / "pcsr/recipes" / "smoke.yaml"
SIMULATION = ("embreex", "manifold3d", "pcsr_plugins.touch", "pcsr_plugins.shapes", "pcsr.geometry.rays", "pcsr.data")
TRAINING = """
from pcsr import Objective, ShapeSource, TouchSource, hookimpl


class Stars(ShapeSource):
    def __init__(self, *, arms: int = 5, sizes: tuple[int, ...] = (1, 2)) -> None:
        pass


class Feelers(TouchSource):
    def __init__(self, *, points: int = 48, options: str = "") -> None:
        pass


class Wish(Objective):
    def __init__(self, *, strength: float = 2.0) -> None:
        super().__init__()


@hookimpl
def pcsr_register(register):
    register.shapes("stars", Stars)
    register.touch("feelers", Feelers)
    register.objective("wish", Wish)
"""


@pytest.fixture
def elsewhere(tmp_path):
    """Weights that were trained with the shapes, the touch source and the objective of a plugin that is gone."""
    plugin, path = tmp_path / "training.py", tmp_path / "w.safetensors"
    plugin.write_text(TRAINING)
    registry = load_plugins([plugin])
    words = ["data.shapes=stars", "data.touch={use: feelers, options: x}", "train.objective=wish", "data.points=64"]
    small = ["model.encoder.channels=8", "model.touch_encoder.channels=4", "model.backbone.channels=[8, 8]"]
    (recipe,) = load_recipe(SMOKE, registry, [*words, *small])
    save_weights(path, build(recipe, registry), {"recipe": recipe.resolved()}, registry)
    plugin.unlink()
    return path, recipe


def cloud(count=150):
    return np.random.default_rng(0).normal(size=(count, 3))


@pytest.mark.slow
@pytest.mark.parametrize(
    "code",
    [
        "import pcsr; pcsr.load('frames').upsample([[0, 0, 0.1 * i] for i in range(40)])",
        "from pcsr.cli import main; main(['upsample', 'in.xyz', '-o', 'out.ply'])",
    ],
)
def test_upsampling_imports_no_simulator(code, tmp_path):
    np.savetxt(tmp_path / "in.xyz", cloud())
    look = "import atexit, sys; atexit.register(lambda: print(*sys.modules, file=sys.stderr))\n"
    done = subprocess.run([sys.executable, "-c", look + code], cwd=tmp_path, capture_output=True, text=True, check=True)
    imported = done.stderr.split()
    assert "pcsr_plugins.encoders.local_frames" in imported
    assert [name for name in imported if name.startswith(SIMULATION)] == []


@pytest.mark.slow
def test_weights_need_no_part_of_their_training(elsewhere):
    path, recipe = elsewhere
    model = load(path)
    alone = model.upsample(cloud(), [cloud(30) / 10], rate=2)
    assert alone.shape == (300, 3)
    np.testing.assert_array_equal(model.upsample(cloud(), [cloud(30) / 10], rate=2, jobs=2), alone)
    assert model.recipe.resolved() == recipe.resolved()
    assert model.recipe.fingerprint == recipe.fingerprint
    assert model.recipe.data.touch.options == {"points": 48, "options": "x"}
    assert Networked.of(model.network, model.recipe).touch_points == 48


def test_so_does_the_command(elsewhere, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.savetxt("in.xyz", cloud())
    done = CliRunner().invoke(command, ["upsample", "in.xyz", "-o", "out.xyz", "--model", str(elsewhere[0])])
    assert done.exit_code == 0, done.output
    assert len(np.loadtxt("out.xyz")) == 600


def test_a_run_measures_them_on_data_of_its_own(elsewhere, tmp_path, world, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("w.yaml").write_text(
        f"name: w\nweights: {elsewhere[0]}\nevaluate: {{metrics: [cd]}}\n"
        "data: {shapes: {use: balls, count: 2, held_out: 2}, touch: caps, touches: 1, points: 40}\n"
    )
    call = ["run", "w.yaml", "--plugin", str(world), "--jobs", "2"]
    done = CliRunner().invoke(command, call)
    assert done.exit_code == 0, done.output
    (results,) = Path("runs").glob("w-*/results.json")
    assert json.loads(results.read_text())["recipe"]["train"]["objective"] == {"use": "wish", "strength": 2.0}
    made = ["data", "make", "balls", "-o", "built", "--set=touch=caps", "--set=points=40", "--set=rate=4"]
    CliRunner().invoke(command, [*made, "--set=held_out=2", "--jobs=1", "--plugin", str(world)], catch_exceptions=False)
    done = CliRunner().invoke(command, [*call, "--data", "built"])
    assert done.exit_code == 0, done.output


def test_the_parts_of_a_recipe_of_ones_own_are_checked_as_ever(elsewhere, tmp_path):
    path = tmp_path / "w.yaml"
    path.write_text(f"name: w\nweights: {elsewhere[0]}\ndata: {{touch: feelers}}\n")
    with pytest.raises(RecipeError, match=r"w\.yaml:3:15: there is no touch 'feelers'"):
        load_recipe(path, load_plugins())
    with pytest.raises(RecipeError, match="there is no touch 'feelers'"):
        from_resolved(elsewhere[1].resolved(), load_plugins())


@pytest.mark.parametrize("place", [keys for keys in PARTS if keys[0] == "model"])
def test_parts_of_the_network_are_needed(elsewhere, place, tmp_path):
    path, recipe = elsewhere
    plain = recipe.resolved()
    if "graft" in place:
        plain["model"] = {"graft": {"network": "theirs.py:Theirs", "at": "encoder", place[-1]: {"use": "gone"}}}
    else:
        plain[place[0]][place[1]] = {"use": "gone"}
    save_weights(path, build(recipe, load_plugins()), {"recipe": plain})
    with pytest.raises(pcsr.UserError, match=f"need {PARTS[place]} 'gone'"):
        load(path)


def test_an_evaluation_that_this_version_does_not_know_stops_no_upsampling(elsewhere):
    path, recipe = elsewhere
    plain = recipe.resolved()
    plain["evaluate"] = {"metrics": ["of the future"], "new": 3}
    save_weights(path, build(recipe, load_plugins()), {"recipe": plain})
    assert load(path).upsample(cloud(), rate=2).shape == (300, 3)


@pytest.mark.parametrize("points", ["many", -1, 0, 10**9, True, [1], None])
def test_a_touch_source_may_call_anything_points(elsewhere, points):
    path, recipe = elsewhere
    plain = recipe.resolved()
    plain["data"]["touch"]["points"] = points
    save_weights(path, build(recipe, load_plugins()), {"recipe": plain})
    model = load(path)
    assert Networked.of(model.network, model.recipe).touch_points == TOUCH_POINTS
    assert model.recipe.resolved()["data"]["touch"]["points"] == points


def test_loading_with_all_parts_checked_gives_the_same_fingerprint(monkeypatch):
    monkeypatch.setattr(Digit, "version", 1)  # as it was when these weights were trained
    registry = load_plugins()
    _, recipe, card = load_weights(shipped("frames"), registry)
    assert recipe.fingerprint == from_resolved(card["recipe"], registry).fingerprint == card["fingerprint"]
