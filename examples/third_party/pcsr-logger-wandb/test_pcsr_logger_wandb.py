"""The logger `wandb` keeps its contract, offline; where the package is not installed, with a stand-in."""

import sys
from importlib.util import find_spec
from types import ModuleType

import pytest
from pcsr_logger_wandb import ID, WandB

from pcsr.testing import checks_for


class Run:
    """Stand-in for a run: a list of what it is given."""

    def __init__(self, **settings):
        self.settings, self.lines, self.exit_code = settings, [], None

    def log(self, data, step):
        self.lines.append((step, data))

    def finish(self, exit_code):
        self.exit_code = exit_code


@pytest.fixture
def stand_in(monkeypatch):
    module = ModuleType("wandb")
    module.init = Run
    monkeypatch.setitem(sys.modules, "wandb", module)


@pytest.mark.parametrize("check", checks_for(WandB, mode="offline"), ids=str)
def test_part(check, request):
    if find_spec("wandb") is None:
        request.getfixturevalue("stand_in")
    check()


def train(folder, step, completed, **options):
    logger = WandB(**options)
    logger.start(folder, {"name": "mine", "seed": 3}, step)
    logger.log(step + 1, {"loss": 0.5})
    logger.finish(completed)
    return logger.run


@pytest.mark.usefixtures("stand_in")
def test_a_run_has_the_recipe_and_the_values(tmp_path):
    run = train(tmp_path, 0, True, project="touch", entity="lab", mode="offline")
    assert run.lines == [(1, {"loss": 0.5})]
    assert run.exit_code == 0
    identifier = run.settings.pop("id")
    assert run.settings == {
        "project": "touch",
        "entity": "lab",
        "name": "mine",
        "resume": "allow",
        "dir": str(tmp_path),
        "config": {"name": "mine", "seed": 3},
        "mode": "offline",
    }
    assert (tmp_path / ID).read_text() == identifier + "\n"


@pytest.mark.usefixtures("stand_in")
def test_a_training_that_goes_on_goes_on_in_its_run_and_a_new_one_begins_another(tmp_path):
    first = train(tmp_path, 0, False)
    second = train(tmp_path, 5, True)
    third = train(tmp_path, 0, True)
    assert (first.exit_code, second.exit_code) == (1, 0)
    assert first.settings["id"] == second.settings["id"] != third.settings["id"]
