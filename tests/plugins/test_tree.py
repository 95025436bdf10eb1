"""The tree of these tests is that of the parts: whoever looks for a part's test finds it by its name."""

from pathlib import Path

import pytest

import pcsr_plugins
from pcsr.plugins.loading import load_plugins

PARTS, TESTS = Path(pcsr_plugins.__file__).parent, Path(__file__).parent


def test_each_registered_part_has_a_test_file_of_its_name():
    modules = {entry.load().__module__ for entry in load_plugins() if entry.owner == "pcsr"}
    paths = [Path(*module.split(".")[1:]) for module in modules if module.startswith("pcsr_plugins.")]
    assert len(paths) > 30
    assert [str(path) for path in paths if not (TESTS / path.parent / f"test_{path.name}.py").exists()] == []


@pytest.mark.parametrize("kind", ["backbones", "encoders", "fusions", "layers", "objectives", "upsamplers"])
def test_each_file_of_the_networks_has_a_test_file_of_its_name(kind):
    files = [path.stem for path in (PARTS / kind).glob("*.py") if path.stem != "__init__"]
    assert files
    assert [name for name in files if not (TESTS / kind / f"test_{name}.py").exists()] == []
