"""One part a file, the file's name is the part's name; what parts share is in `layers` and `shapes/shared`."""

from pathlib import Path

import pytest

from pcsr.plugins.loading import load_plugins
from tests.test_floors import imports, parse

FOLDERS = {
    "encoder": "encoders",
    "fusion": "fusions",
    "backbone": "backbones",
    "upsampler": "upsamplers",
    "objective": "objectives",
    "touch": "touch",
    "shapes": "shapes",
    "baseline": "baselines",
    "policy": "policies",
}
PLUGINS = Path(__file__).parents[2] / "plugins" / "pcsr_plugins"
ENTRIES = [entry for entry in load_plugins() if entry.owner == "pcsr" and entry.kind not in ("metric", "logger")]
"""Without the metrics, which are those of `pcsr.metrics`, and the logger, which writes what `pcsr` itself reads."""
MODULES = {str(entry.target).partition(":")[0] for entry in ENTRIES}
EXTENDS = {("pcsr_plugins.fusions.joint_cloud", "pcsr_plugins.fusions.none")}
"""A part that is another one and more."""


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: f"{entry.kind}-{entry.name}")
def test_a_part_is_in_the_file_of_its_name(entry):
    module, _, _ = entry.target.partition(":")
    assert module == f"pcsr_plugins.{FOLDERS[entry.kind]}.{entry.name.replace('-', '_')}"


@pytest.mark.parametrize("folder", FOLDERS.values())
def test_a_folder_of_a_kind_holds_its_parts_and_nothing_else(folder):
    found = {path.stem for path in (PLUGINS / folder).iterdir() if path.stem not in ("__init__", "__pycache__")}
    parts = {module.rpartition(".")[2] for module in MODULES if module.split(".")[1] == folder}
    assert found - ({"shared"} if folder == "shapes" else set()) == parts


@pytest.mark.parametrize("path", sorted(PLUGINS.rglob("*.py")), ids=lambda path: path.relative_to(PLUGINS).as_posix())
def test_no_part_imports_another(path):
    name = ".".join(path.relative_to(PLUGINS.parent).with_suffix("").parts).removesuffix(".__init__")
    part = ".".join(name.split(".")[:3])
    used = {".".join(module.split(".")[:3]) for module in imports(parse(name))} & MODULES
    assert {(part, other) for other in used - {part}} <= EXTENDS
