"""The code of a part belongs to what was trained with it: an edit is seen, and trained again or measured knowingly."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from safetensors.torch import load_file

import pcsr
from pcsr.cli import pcsr as command
from pcsr.errors import RunError, UserError
from pcsr.experiments import train
from pcsr.experiments import trained_network as trained
from pcsr.experiments.finished_runs import of_other_code
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr.weights.file import read_card

SMOKE = Path(__file__).parents[2] / "pcsr/recipes" / "smoke.yaml"
SMALL = [
    f"--set={setting}"
    for setting in (
        "data.shapes=balls", "data.touch=caps", "data.shapes.count=4", "data.shapes.held_out=2", "data.points=32",
        "data.rate=4", "train.epochs=1", "train.batch=2", "train.touches=1", "model.encoder.channels=8",
        "model.touch_encoder.channels=4", "model.backbone.channels=[8]", "evaluate.metrics=[cd]",
        "evaluate.examples=0",
    )
]  # fmt: skip
PLUGIN = """
from pcsr import Fusion, hookimpl
from torch import nn

class Mine(Fusion):
    def __init__(self, widths):
        super().__init__()
        self.layer = nn.Linear(widths.touch, widths.visual)

    def forward(self, points, features, touches):
        return features + self.layer(touches.flat.mean(1, keepdim=True))

@hookimpl
def pcsr_register(register):
    register.fusion("mine", Mine)
"""
EDITED = PLUGIN.replace("features + self", "features - self")
WIDER = PLUGIN.replace("nn.Linear(", "nn.LazyLinear(").replace("LazyLinear(widths.touch, ", "Linear(1 + widths.touch, ")


@pytest.fixture
def call(tmp_path, monkeypatch, world):
    """Runs the recipe with the fusion of `mine.py`, one process, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(PLUGIN)
    Path("world.py").write_text(world.read_text())

    def invoke(*words, head=("run", SMOKE, "--set=model.fusion=mine"), code=0):
        arguments = [*head, *SMALL, "--jobs=1", "--plugin=mine.py", "--plugin=world.py", *words]
        done = CliRunner().invoke(command, list(map(str, arguments)))
        assert done.exit_code == code, done.output
        return done.output

    return invoke


def folders():
    return {path.parent.name for path in Path("runs").glob("*/results.json")}


def contents(folder):
    return {path.name: path.read_bytes() for path in Path(folder).iterdir() if path.is_file()}


def results(folder):
    return json.loads((Path("runs") / folder / "results.json").read_text())


@pytest.mark.slow
def test_after_an_edit_it_is_trained_again_beside_the_old_run(call):
    call()
    (old,) = folders()
    before = contents(Path("runs") / old)
    assert "finished: runs/" in call(), "nothing was edited"
    Path("mine.py").write_text(EDITED)
    said = call()
    assert (
        f"the code of fusion 'mine' (mine.py) has changed since runs/{old} was trained: training again; --keep-weights "
        "measures the old weights with the new code\n"
    ) in said
    (new,) = folders() - {old}
    for name in ("results.json", "report.html", "examples.safetensors", "environment.json"):
        assert before.pop(name), "the evaluation writes it again"
    assert before.items() <= contents(Path("runs") / old).items()
    assert results(new)["training"]["source"] == "trained by this run"
    assert "other_code" not in results(new)["training"]
    assert "finished: runs/" in call()
    Path("mine.py").write_text(PLUGIN)
    assert f"finished: runs/{old}, " in call(), "the old code has its weights still"


def test_old_weights_are_kept_knowingly_and_the_report_says_so(call):
    call()
    (old,) = folders()
    Path("mine.py").write_text(EDITED)
    said = " ".join(call("--keep-weights").split())
    changed = f"the code of fusion 'mine' (mine.py) has changed since runs/{old} was trained"
    assert f"weights: kept with --keep-weights, as {changed}" in said
    assert f"Old weights with new code: {changed} (--keep-weights)" in said
    assert "training, 1 epoch" not in said
    (new,) = folders() - {old}
    training = results(new)["training"]
    assert training["source"] == f"those of runs/{old}"
    assert training["other_code"] == f"{changed} (--keep-weights)"
    assert training["steps"] == 2
    page = (Path("runs") / new / "report.html").read_text()
    assert '<p class="warning"><strong>These are old weights with new code: the code of fusion' in page
    assert "was trained (--keep-weights).</strong>" in page
    assert not (Path("runs") / new / "weights.safetensors").exists()
    values = [results(one)["methods"][0]["values"] for one in (old, new)]
    assert values[0] != values[1], "the new code is what is measured"
    assert "training, 1 epoch" in call(), "and it is trained as soon as nothing else is asked for"
    assert 'class="warning"' not in (Path("runs") / new / "report.html").read_text()


def test_a_table_marks_what_was_measured_with_old_weights(call):
    head = ("compare", SMOKE, "--fusion=concat", "--fusion=mine")
    call(head=head)
    assert "†" not in Path("runs/compare.html").read_text()
    Path("mine.py").write_text(EDITED)
    said = call("--keep-weights", head=head)
    assert "mine †" in said.replace("fusion.", "")
    page = Path("runs/compare.html").read_text()
    assert "mine: old weights with new code, the code of fusion &#x27;mine&#x27; (mine.py) has changed" in page
    assert "concat †" not in page


def test_an_edit_of_the_layers_leaves_nobody_stuck(call):
    call()
    (old,) = folders()
    Path("mine.py").write_text(PLUGIN.replace("self.layer =", "self.more = nn.Linear(2, 2)\n        self.layer ="))
    said = call("--keep-weights", code=UserError.exit_code)
    assert "--keep-weights: the code of fusion 'mine' (mine.py) has changed since" in said
    assert "the file has no fusion.more.weight" in said
    assert "leave --keep-weights out, and it is trained again" in said
    assert folders() == {old}
    assert "training again" in call()
    assert len(folders()) == 2


def test_without_old_weights_none_are_kept(call):
    said = call("--keep-weights", code=UserError.exit_code)
    assert "--keep-weights: runs holds no weights of recipe 'smoke'" in said
    assert "give one of the two" in call("--keep-weights", "--retrain", code=UserError.exit_code)


@pytest.mark.slow
def test_retraining_replaces_the_weights_when_it_is_finished_and_goes_on_after_a_stop(call, monkeypatch):
    call()
    (folder,) = folders()
    path = Path("runs") / folder
    before, steps, real = contents(path), [], train._step

    def counted(*words):
        steps.append(1)
        return real(*words)

    def full(*words, **options):
        raise RunError("the disk is full")

    monkeypatch.setattr(train, "_step", counted)
    with monkeypatch.context() as patched:
        patched.setattr(trained, "save_weights", full)
        said = call("--retrain", code=RunError.exit_code)
    assert "--retrain: training, 1 epoch" in said
    assert len(steps) == 2, "from the first step"
    assert {name: data for name, data in contents(path).items() if name != "recipe.json"}.items() <= before.items()
    assert (path / "retraining" / "checkpoint.safetensors").exists()
    assert "finished: runs/" in call(), "the old ones are there meanwhile"
    assert "--retrain: training goes on after step 2, 1 epoch in all" in call("--retrain")
    assert len(steps) == 2, "what was done is not done again"
    assert {one.name for one in path.iterdir()} == {*before, "plugins"}
    after = load_file(path / "weights.safetensors")
    assert read_card(path / "weights.safetensors")["training"]["steps"] == 2
    assert results(folder)["training"]["source"] == "trained by this run"
    assert (path / "metrics.jsonl").read_text().count('"loss"') == 2
    call("--retrain")
    assert len(steps) == 4, "asked for again, it begins again"
    assert all((after[name] == tensor).all() for name, tensor in load_file(path / "weights.safetensors").items())


def test_a_recipe_that_names_weights_of_other_code_says_so(call):
    call()
    (folder,) = folders()
    Path("mine.py").write_text(EDITED)
    call(f"--set=weights=runs/{folder}/weights.safetensors", "--set=name=named")
    (named,) = folders() - {folder}
    assert "made by fusion 'mine' (mine.py) of code" in results(named)["training"]["other_code"]
    assert "These are old weights with new code" in (Path("runs") / named / "report.html").read_text()


def test_what_names_weights_is_not_retrained(call):
    call()
    (folder,) = folders()
    said = call("--retrain", f"--set=weights=runs/{folder}/weights.safetensors", "--set=data.rate=4", code=2)
    assert "recipe 'smoke' names weights, so that nothing is trained: leave out --retrain" in said


@pytest.mark.slow
def test_an_edited_touch_source_makes_other_data_but_not_of_data_that_is_built(call):
    call()
    (old,) = folders()
    text = Path("world.py").read_text()
    Path("world.py").write_text(text.replace("seed)\n        vertices", "seed + 1)\n        vertices"))
    assert "the code of shapes 'balls' (world.py) and touch 'caps' (world.py) has changed" in " ".join(call().split())
    assert len(list(Path("runs/data").iterdir())) == 2
    data = [results(one)["data"]["fingerprint"] for one in (old, *(folders() - {old}))]
    assert data[0] != data[1]
    built = sorted(Path("runs/data").iterdir())[0]
    call("--data", built)
    Path("world.py").write_text(text + "\n# edited again\n")
    assert "finished: runs/" in call("--data", built)


@pytest.mark.slow
def test_weights_of_other_code_are_used_with_a_warning(call):
    call()
    (folder,) = folders()
    points = np.random.default_rng(0).normal(size=(60, 3))
    np.savetxt("in.xyz", points)
    upsample = ["upsample", "in.xyz", "-o", "out.xyz", "--model", f"runs/{folder}", "--plugin", "mine.py"]
    assert "results may differ" not in CliRunner().invoke(command, upsample).output
    Path("mine.py").write_text(EDITED)
    said = CliRunner().invoke(command, upsample)
    assert said.exit_code == 0, said.output
    assert said.output.count("were made by fusion 'mine' (mine.py) of code ") == 1
    with pytest.warns(UserWarning, match=r"this is [0-9a-f]{12}: results may differ"):
        model = pcsr.load(f"runs/{folder}", plugins=["mine.py"])
    assert model.upsample(points, jobs=2).shape == (240, 3)


def test_weights_that_did_not_note_their_code_are_not_taken_for_those_of_this_code(call):
    call()
    (folder,) = folders()
    path = Path("runs") / folder / "weights.safetensors"
    registry = load_plugins([Path("mine.py"), Path("world.py")])
    settings = ["model.fusion=mine", *(one.removeprefix("--set=") for one in SMALL)]
    (recipe,) = load(SMOKE, registry, settings)
    card = read_card(path)
    assert of_other_code(recipe, card["data_fingerprint"], Path("runs"), registry) is None
    del card["recipe"]["code"], card["settings_fingerprint"]
    card["fingerprint"] = recipe.settings_fingerprint  # as pcsr 0.1.0 wrote it
    trained.save_weights(path, pcsr.load(path, plugins=["mine.py"]).network, card, registry)
    path.parent.rename("runs/smoke-of-old")
    said = " ".join(call().split())
    assert "runs/smoke-of-old was trained by a version of pcsr that did not record the code of" in said
    assert "fusion 'mine' (mine.py): training again" in said


def test_recipes_of_parts_of_pcsr_are_what_they_were(monkeypatch):
    monkeypatch.setattr(load_plugins().get("touch", "digit"), "version", 1)  # the other parts have it
    (recipe,) = load(SMOKE, load_plugins(), ["model.upsampler={use: shuffle, hidden: 16, start: neighbours}"])
    assert recipe.code == {}
    assert "code" not in recipe.resolved()
    assert recipe.fingerprint == recipe.settings_fingerprint
    assert recipe.fingerprint.startswith("aa7c155f91f56ad2")


def test_a_part_of_pcsr_is_told_by_its_version(monkeypatch):
    registry = load_plugins()
    (before,) = load(SMOKE, registry)
    monkeypatch.setattr(registry.get("fusion", before.model.fusion.use), "version", 2)
    (after,) = load(SMOKE, load_plugins())
    assert before.code == {"data.touch": "version 2"}
    assert after.code == {"data.touch": "version 2", "model.fusion": "version 2"}
    assert len({before.fingerprint, after.fingerprint, after.settings_fingerprint}) == 3
    assert after.settings_fingerprint == before.settings_fingerprint


def test_what_a_recipe_says_of_code_is_not_believed(call, tmp_path):
    registry = load_plugins([Path("mine.py")])
    (recipe,) = load(SMOKE, registry, ["model.fusion=mine", "code.model=3", "code.data=x"])
    assert recipe.code.keys() == {"data.touch", "model.fusion"}
    assert recipe.code["data.touch"] == "version 2"
    assert len(recipe.code["model.fusion"]) == 12
