"""The data of a run."""

from pathlib import Path

from rich.progress import Progress

from pcsr.data import source as module
from pcsr.data.built import BuiltData


def test_reading_much_data_is_shown(monkeypatch):
    built = BuiltData.read([Path(__file__).with_name("version_0_1")])
    for moment, described in ((module.MOMENT, []), (0, ["checking the train data"])):
        monkeypatch.setattr(module, "MOMENT", moment)
        progress = Progress(disable=True)
        assert len(module._checked(built, "train", progress)) == 2
        assert [task.description for task in progress.tasks] == described
        assert all(task.finished for task in progress.tasks)
