"""Loggers of a training: what they are given, and that none of them can end it."""

import pytest

from pcsr import Logger, PcsrWarning, UserError
from pcsr.experiments.loggers import Loggers
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Entry
from pcsr.recipe import PartSpec
from pcsr.run_files import HISTORY
from tests.small_training import STEPS, history, same, stop_at, tiny, trained


class Memory(Logger):
    def __init__(self, *, fails: str = "", name: str = "") -> None:
        self.fails, self.calls = fails, []
        type(self).last = self
        if fails == "constructor":
            raise UserError("logger 'memory': no such project")

    def _call(self, what, *values):
        self.calls.append((what, *values))
        if self.fails == what:
            raise OSError("the network is down")

    def start(self, folder, recipe, step):
        self._call("start", folder, recipe, step)

    def log(self, step, values):
        self._call("log", step, values)

    def finish(self, completed):
        self._call("finish", completed)


@pytest.fixture
def registry():
    made = load_plugins()
    made.add(Entry("logger", "memory", Memory, "tests", "0"))
    return made


def recipe(folder, *loggers, **changes):
    plain = tiny(folder, *(f"train.{key}={value}" for key, value in changes.items()))
    specs = tuple(PartSpec(use=name, options=options) for name, options in loggers)
    return plain.model_copy(update={"train": plain.train.model_copy(update={"loggers": specs})})


def test_a_logger_is_given_every_step_and_validation(registry, tmp_path):
    one = recipe(tmp_path, ("memory", {}), ("jsonl", {}))
    trained(one, tmp_path / "run", registry=registry)
    (first, folder, plain, step), *logs, last = Memory.last.calls
    assert (first, folder, step, last) == ("start", tmp_path / "run", 0, ("finish", True))
    assert plain == one.resolved()
    steps = [values for _, _, values in logs if "loss" in values]
    assert [list(values) for values in steps] == STEPS * [
        ["epoch", "loss", "loss/chamfer", "learning_rate", "seconds", "threads"]
    ]
    lines = history(tmp_path / "run")
    assert [line["loss"] for line in lines if "loss" in line] == [values["loss"] for values in steps]
    validations = {step: values["validation/cd"] for _, step, values in logs if "validation/cd" in values}
    assert validations == {line["step"]: line["validation"]["cd"] for line in lines if "validation" in line}


def test_without_jsonl_there_is_no_history_and_the_training_is_the_same(registry, tmp_path):
    network = trained(recipe(tmp_path), tmp_path / "run", registry=registry)
    assert not (tmp_path / "run" / HISTORY).exists()
    assert same(network, trained(tiny(tmp_path), tmp_path / "other"))


def test_an_interruption_is_told_to_a_logger_and_then_from_which_step_it_goes_on(registry, tmp_path):
    one = recipe(tmp_path, ("memory", {}))
    with pytest.raises(KeyboardInterrupt):
        trained(one, tmp_path / "run", registry=registry, shown=stop_at(4), checkpoint_every=0.0)
    assert Memory.last.calls[-1] == ("finish", False)
    trained(one, tmp_path / "run", registry=registry)
    calls = Memory.last.calls
    assert (calls[0][0], calls[0][3]) == ("start", 3)
    assert calls[1][1] == 4


@pytest.mark.parametrize(("fails", "when"), [("start", "at its start"), ("log", "at step 1"), ("finish", "at its end")])
def test_a_logger_that_raises_is_said_once_and_ends_nothing(registry, tmp_path, fails, when):
    one = recipe(tmp_path, ("memory", {"fails": fails}), ("jsonl", {}))
    with pytest.warns(PcsrWarning) as caught:
        network = trained(one, tmp_path / "run", registry=registry)
    goes_on = "; training goes on, and further errors of this logger are not shown" if fails != "finish" else ""
    assert [str(warning.message) for warning in caught] == [
        f"logger 'memory' failed {when}: OSError: the network is down{goes_on}"
    ]
    calls = [call[0] for call in Memory.last.calls]
    assert calls == ["start"] if fails == "start" else calls[-1] == "finish"
    assert calls.count("log") == {"start": 0}.get(fails, STEPS + 4)
    assert same(network, trained(tiny(tmp_path), tmp_path / "other"))
    assert history(tmp_path / "run") == history(tmp_path / "other")


def test_a_logger_that_ends_the_process_does_not(registry, tmp_path):
    class Ends(Logger):
        def log(self, step, values):
            raise SystemExit(3)

    registry.add(Entry("logger", "ends", Ends, "tests", "0"))
    with pytest.warns(PcsrWarning, match=r"logger 'ends' failed at step 1: SystemExit: 3; training goes on"):
        trained(recipe(tmp_path, ("ends", {})), tmp_path / "run", registry=registry)


def test_a_logger_that_cannot_be_built_ends_the_run_before_the_first_step(registry, tmp_path):
    with pytest.raises(UserError, match="logger 'memory': no such project"):
        trained(recipe(tmp_path, ("memory", {"fails": "constructor"})), tmp_path / "run", registry=registry)
    assert not list((tmp_path / "run").iterdir())


def test_a_logger_cannot_change_what_others_are_given(registry, tmp_path):
    class Clears(Logger):
        def start(self, folder, recipe, step):
            recipe.clear()

        def log(self, step, values):
            values.clear()

    registry.add(Entry("logger", "clears", Clears, "tests", "0"))
    loggers = Loggers((PartSpec(use="clears"), PartSpec(use="memory")), registry)
    with loggers.running(tmp_path, tiny(tmp_path), 0):
        loggers.log(1, {"loss": 1.0})
    assert Memory.last.calls[0][2]["name"] == "tiny"
    assert Memory.last.calls[1] == ("log", 1, {"loss": 1.0})


def test_settings_of_the_process_that_a_logger_changes_are_restored(registry, tmp_path):
    import torch

    class Changes(Logger):
        def start(self, folder, recipe, step):
            torch.set_default_dtype(torch.float64)

        def log(self, step, values):
            torch.set_grad_enabled(False)

    registry.add(Entry("logger", "changes", Changes, "tests", "0"))
    with pytest.warns(PcsrWarning) as caught:
        network = trained(recipe(tmp_path, ("changes", {})), tmp_path / "run", registry=registry)
    said = {str(warning.message) for warning in caught}
    for changed in ("torch's default dtype to torch.float64", "whether torch computes gradients to False"):
        assert f"logger 'changes' changed {changed}: restored, as it would change other parts' results" in said
    assert torch.get_default_dtype() == torch.float32
    assert same(network, trained(tiny(tmp_path), tmp_path / "other"))
