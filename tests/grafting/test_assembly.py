import contextlib
import re
from pathlib import Path
from typing import Any

from pcsr.grafting import Grafted, graft
from tests.grafting.networks import Meeting

DOCUMENT = Path(__file__).parents[2] / "docs" / "graft.md"


def test_installed_plugins_are_found_without_a_registry():
    assert graft(Meeting(None), "layer").specs["fusion"] == {"use": "iterative", "pool": "none"}


def test_the_documented_example_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (example,) = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
    names: dict[str, Any] = {}
    with contextlib.redirect_stdout(None):
        exec(example, names)
    assert isinstance(names["grafted"], Grafted)
    assert (tmp_path / "grafted.safetensors").is_file()
