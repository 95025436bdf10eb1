"""The logger `tensorboard` keeps its contract, with the package or, where it is not installed, a stand-in."""

import json
import sys
from importlib.util import find_spec
from types import ModuleType

import pytest
from pcsr_logger_tensorboard import FOLDER, TensorBoard

from pcsr.testing import checks_for

STEP = {"loss": 0.5, "loss/chamfer": 0.5, "learning_rate": 1e-3, "epoch": 0, "seconds": 1.0, "threads": 1}


class Writer:
    """Stand-in for `SummaryWriter`: a list of what it is given."""

    def __init__(self, log_dir, purge_step=None):
        self.log_dir, self.purge_step, self.scalars, self.texts, self.closed = log_dir, purge_step, [], [], False

    def add_scalar(self, tag, scalar_value, global_step):
        self.scalars.append((tag, scalar_value, global_step))

    def add_text(self, tag, text_string):
        self.texts.append((tag, text_string))

    def close(self):
        self.closed = True


@pytest.fixture
def stand_in(monkeypatch):
    module = ModuleType("torch.utils.tensorboard")
    module.SummaryWriter = Writer
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", module)


@pytest.mark.parametrize("check", checks_for(TensorBoard), ids=str)
def test_part(check, request):
    if find_spec("tensorboard") is None:
        request.getfixturevalue("stand_in")
    check()


@pytest.mark.usefixtures("stand_in")
def test_values_are_scalars_by_step_and_the_recipe_is_a_text(tmp_path):
    logger = TensorBoard()
    logger.start(tmp_path, {"name": "mine"}, 0)
    logger.log(1, STEP)
    logger.log(1, {"validation/cd": 0.25, "epoch": 1})
    logger.finish(True)
    writer = logger.writer
    assert (writer.log_dir, writer.closed) == (str(tmp_path / FOLDER), True)
    assert writer.scalars == [(name, value, 1) for name, value in STEP.items()] + [
        ("validation/cd", 0.25, 1),
        ("epoch", 1, 1),
    ]
    ((tag, text),) = writer.texts
    assert (tag, json.loads(text.strip("`json\n"))) == ("recipe", {"name": "mine"})


@pytest.mark.usefixtures("stand_in")
def test_what_came_after_the_step_of_a_checkpoint_is_hidden(tmp_path):
    logger = TensorBoard()
    logger.start(tmp_path, {"name": "mine"}, 7)
    assert (logger.writer.purge_step, logger.writer.texts) == (8, [])


def test_the_files_are_those_of_tensorboard(tmp_path):
    pytest.importorskip("tensorboard")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    for start, end in ((0, 3), (2, 4)):  # interrupted after step 3, whose checkpoint is that of step 2
        logger = TensorBoard()
        logger.start(tmp_path, {"name": "mine"}, start)
        for step in range(start + 1, end + 1):
            logger.log(step, {"loss": float(10 * start + step)})
        logger.finish(False)
    events = EventAccumulator(str(tmp_path / FOLDER)).Reload()
    assert [(event.step, event.value) for event in events.Scalars("loss")] == [(1, 1.0), (2, 2.0), (3, 23.0), (4, 24.0)]
