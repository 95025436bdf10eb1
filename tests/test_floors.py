"""The floors of the house: a file imports only from floors below its own, or from its own package."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

FLOORS = {
    "pcsr.cli": 7,
    "pcsr.experiments": 6,
    "pcsr.report": 5,
    "pcsr.model": 5,
    "pcsr.export": 5,
    "pcsr.streaming": 6,
    "pcsr.touches": 3,
    "pcsr.results": 2,
    "pcsr.run_files": 3,
    "pcsr.run_folders": 4,
    "pcsr.upsample": 4,
    "pcsr.exploration": 6,
    "pcsr.uncertainty": 4,
    "pcsr.network": 3,
    "pcsr.grafting": 3,
    "pcsr.data": 3,
    "pcsr.testing": 3,
    "pcsr.recipe": 2,
    "pcsr.weights": 2,
    "pcsr.recipes": 1,
    "pcsr.recorded": 2,
    "pcsr.registration": 2,
    "pcsr.plugins": 1,
    "pcsr.sensors": 1,
    "pcsr.contracts": 1,
    "pcsr.metrics": 1,
    "pcsr.clouds": 1,
    "pcsr.geometry": 0,
    "pcsr.tensors": 0,
    "pcsr.files": 0,
    "pcsr.inputs": 0,
    "pcsr.limits": 0,
    "pcsr.options": 0,
    "pcsr.ros": 0,
    "pcsr.progress": 0,
    "pcsr.stages": 0,
    "pcsr.threads": 0,
    "pcsr.workers": 0,
    "pcsr.errors": 0,
    "pcsr.counted": 0,
    "pcsr.random_state": 0,
    "pcsr.version": 0,
    "pcsr.validation_messages": 0,
    "pcsr.extras": 0,
}
SAME_FLOOR = {
    # Of two files of one floor the first may use the second.
    ("pcsr.files", "pcsr.errors"),
    ("pcsr.inputs", "pcsr.errors"),
    ("pcsr.inputs", "pcsr.limits"),
    ("pcsr.inputs", "pcsr.validation_messages"),
    ("pcsr.limits", "pcsr.errors"),
    ("pcsr.validation_messages", "pcsr.errors"),
    ("pcsr.progress", "pcsr.errors"),
    ("pcsr.workers", "pcsr.errors"),
    ("pcsr.workers", "pcsr.extras"),
    ("pcsr.extras", "pcsr.errors"),
    ("pcsr.ros", "pcsr.errors"),
    ("pcsr.ros", "pcsr.extras"),
    ("pcsr.ros", "pcsr.inputs"),
    ("pcsr.ros", "pcsr.limits"),
    ("pcsr.geometry", "pcsr.errors"),
    ("pcsr.geometry", "pcsr.extras"),
    ("pcsr.geometry", "pcsr.tensors"),
    ("pcsr.contracts", "pcsr.clouds"),
    ("pcsr.plugins", "pcsr.contracts"),
    ("pcsr.recipe", "pcsr.results"),
    ("pcsr.recipe", "pcsr.weights"),
    ("pcsr.weights", "pcsr.results"),
    ("pcsr.network", "pcsr.run_files"),
    ("pcsr.metrics", "pcsr.clouds"),
    ("pcsr.metrics", "pcsr.contracts"),
    ("pcsr.metrics", "pcsr.plugins"),
    ("pcsr.network", "pcsr.grafting"),
    ("pcsr.testing", "pcsr.network"),
    ("pcsr.uncertainty", "pcsr.upsample"),
}
PUBLIC = (
    "pcsr.exploration",
    "pcsr.geometry",
    "pcsr.metrics",
    "pcsr.tensors",
    "pcsr.errors",
    "pcsr.extras",
    "pcsr.contracts",
    "pcsr.recorded",
    "pcsr.sensors",
)
"""What a plugin may import besides the names of `pcsr` itself."""


def name_of(path: Path) -> str:
    root = ROOT / "plugins" if "plugins" in path.relative_to(ROOT).parts[:1] else ROOT
    return ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")


FILES = {name_of(path): path for folder in ("pcsr", "plugins/pcsr_plugins") for path in (ROOT / folder).rglob("*.py")}


def imports(tree: ast.AST, *, top: bool = False) -> set[str]:
    """Modules that a file imports, other than for its types alone; `top`: not those inside of functions."""
    found = set()
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide where a name is from"
            # `from pcsr import extras` may import the module pcsr.extras, or a name of pcsr.
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= (inner & FILES.keys()) or {str(node.module)}
        else:
            for_types = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
            if not for_types and not (top and isinstance(node, ast.FunctionDef)):
                found |= imports(node, top=top)
    return found


def parse(name: str) -> ast.Module:
    return ast.parse(FILES[name].read_text(encoding="utf-8"))


def unit(module: str) -> str:
    """The file or package of the table that a module belongs to."""
    return ".".join(module.split(".")[:2])


def ours(package: str) -> list[str]:
    return sorted(name for name in FILES if name.split(".")[0] == package)


@pytest.mark.parametrize("name", [name for name in ours("pcsr") if name != "pcsr"])
def test_a_file_imports_only_from_below(name):
    own = unit(name)
    assert own in FLOORS, f"{own} has no floor: give it one in the table above"
    for module in imports(parse(name)):
        if module.split(".")[0] != "pcsr" or unit(module) in (own, "pcsr"):
            continue
        below = FLOORS[unit(module)] < FLOORS[own] or (own, unit(module)) in SAME_FLOOR
        assert below, f"{name} imports {module}, which is not on a floor below"


@pytest.mark.parametrize("name", ours("pcsr"))
def test_the_host_never_imports_its_plugins(name):
    assert not {module for module in imports(parse(name)) if module.split(".")[0] == "pcsr_plugins"}


@pytest.mark.parametrize("name", ours("pcsr_plugins"))
def test_plugins_import_only_what_is_public(name):
    for module in imports(parse(name)):
        if module.split(".")[0] == "pcsr":
            assert module == "pcsr" or unit(module) in PUBLIC, f"{name} imports {module}, which is not public"


@pytest.mark.parametrize("name", [name for name in ours("pcsr") if unit(name) == "pcsr.cli"])
def test_commands_import_nothing_heavy_before_they_are_called(name):
    top = imports(parse(name), top=True)
    allowed = {"pcsr", "pcsr.counted", "pcsr.errors", "pcsr.version"}
    assert not {
        m for m in top if m.split(".")[0] in ("torch", "numpy", "scipy", "trimesh", "plotly", "pydantic", "rich")
    }
    assert not {m for m in top if m.split(".")[0] == "pcsr" and m not in allowed and unit(m) != "pcsr.cli"}


def test_files_whose_names_say_nothing_are_not_here():
    assert not {name for name in FILES if name.split(".")[-1] in ("utils", "util", "helpers", "common", "base", "misc")}


def test_floors_of_the_same_height_go_one_way():
    for one, other in SAME_FLOOR:
        assert FLOORS[one] == FLOORS[other]
        assert (other, one) not in SAME_FLOOR


def test_the_search_for_imports_finds_them_all():
    tree = ast.parse("import a.b\nfrom c import d\nif TYPE_CHECKING:\n    import e\ndef f():\n    import g\n")
    assert imports(tree) == {"a.b", "c", "g"}
    assert imports(tree, top=True) == {"a.b", "c"}
    assert imports(ast.parse("from pcsr import extras, Fusion")) >= {"pcsr.extras"}
    with pytest.raises(AssertionError):
        imports(ast.parse("from . import a"))
