"""The public API in one list, tests/public_api.txt. A change of it fails until CHANGELOG.md says so.

`python tests/test_public_api.py` writes the list anew and prints the line that CHANGELOG.md needs.
"""

import ast
import hashlib
import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import GenericAlias, ModuleType

import click
import pytest

import pcsr
from pcsr import cli, contracts
from pcsr.plugins import hookspecs, registry
from pcsr.plugins import loading as plugins

ROOT = Path(__file__).parents[1]
LISTED = ROOT / "tests" / "public_api.txt"
MODULES = (
    "geometry.neighbours",
    "geometry.sampling",
    "grafting",
    "metrics",
    "metrics.nearest",
    "recorded",
    "sensors",
    "tensors",
    "testing",
)
"""Public modules; the names in their `__all__` are public too."""
CHANGES = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
UNRELEASED = re.search(r"^## .*?\n(.*?)(?=^## |\Z)", CHANGES, re.MULTILINE | re.DOTALL)[1]
COMMAND = "python tests/test_public_api.py"


def listing() -> str:
    """All that is promised, a line each."""
    lines = [f"entry points: {group}" for group in (plugins.GROUP, cli.GROUP)]
    lines += [f"kind: {kind} ({contract})" for kind, contract in registry.KINDS.items()]
    lines += ["hook: " + line for line in of_source(hookspecs.pcsr_register)]
    lines += [line for name in sorted(pcsr.__all__) for line in described(f"pcsr.{name}", getattr(pcsr, name))]
    lines += described("pcsr.contracts.Part", contracts.Part)
    for module in MODULES:
        public = importlib.import_module(f"pcsr.{module}")
        for name in sorted(public.__all__):
            if not (module == "grafting" and name in pcsr.__all__):
                lines += described(f"pcsr.{module}.{name}", getattr(public, name))
    return "\n".join([*lines, *of_commands(cli.pcsr, "pcsr")]) + "\n"


def described(label: str, thing: object) -> list[str]:
    """A public name and, of functions and classes, what their source says."""
    if isinstance(thing, ModuleType):
        return [f"{label}: module"]
    if hasattr(thing, "dim_str"):  # an alias of pcsr.tensors
        return [f"{label}: {thing.__name__}"]
    if isinstance(thing, GenericAlias):
        return [f"{label}: tuple of {', '.join(one.__name__ for one in thing.__args__)}"]
    if isinstance(thing, dict):
        return [f"{label}: {', '.join(thing)}"]
    if not (isinstance(thing, type) or callable(thing)) or not hasattr(thing, "__name__"):
        return [f"{label}: {type(thing).__name__}"]
    first, *rest = of_source(thing)
    return [f"{label}: {first}", *rest]


def of_source(thing: object) -> Iterator[str]:
    """Signatures as they are written: whatever wraps a function while tests run does not show."""
    tree = ast.parse(Path(str(sys.modules[thing.__module__].__file__)).read_text(encoding="utf-8"))
    (node,) = [one for one in tree.body if getattr(one, "name", None) == thing.__name__]
    if isinstance(node, ast.FunctionDef):
        yield of_function(node)
        return
    yield f"class ({', '.join(map(ast.unparse, node.bases))})"
    for one in node.body:
        if isinstance(one, ast.FunctionDef) and (one.name[0] != "_" or one.name in ("__init__", "__call__")):
            yield "    " + of_function(one)
        elif isinstance(one, ast.AnnAssign | ast.Assign) and not ast.unparse(one).startswith("_"):
            yield "    " + ast.unparse(one)


def of_function(node: ast.FunctionDef) -> str:
    marks = "".join(f"@{ast.unparse(mark)} " for mark in node.decorator_list)
    gives = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    return f"{marks}{node.name}({ast.unparse(node.args)}){gives}"


def of_commands(command: click.Command, path: str) -> Iterator[str]:
    """A command's arguments and options, then those of the commands under it."""
    for parameter in command.params:
        kind = "|".join(map(str, parameter.type.choices)) if hasattr(parameter.type, "choices") else parameter.type.name
        several = " several" if parameter.nargs == -1 or getattr(parameter, "multiple", False) else ""
        needed = " required" if parameter.required else ""
        flag = " flag" if getattr(parameter, "is_flag", False) else ""
        names = "/".join([*parameter.opts, *parameter.secondary_opts])
        yield f"{path} {names}: {kind}{flag}{several}{needed}"
    if isinstance(command, click.Group):
        context = click.Context(command)
        # Commands of other distributions are theirs.
        for name in sorted(cli.COMMANDS if path == "pcsr" else command.list_commands(context)):
            below = command.get_command(context, name)
            assert below is not None
            yield f"{path} {name}"
            yield from of_commands(below, f"{path} {name}")


def digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def names() -> list[str]:
    """What CHANGELOG.md has to name: not every option, but every name that can be imported, registered or typed."""
    modules = {module: importlib.import_module(f"pcsr.{module}").__all__ for module in MODULES}
    imported = [*pcsr.__all__, *(f"pcsr.{module}" for module in MODULES), *modules["testing"]]
    commands = re.findall(r"^(pcsr [a-z -]+)$", listing(), re.MULTILINE)
    return [*imported, *registry.KINDS, "pcsr_register", plugins.GROUP, cli.GROUP, *commands]


def test_the_public_api_is_as_listed():
    written, now = LISTED.read_text(encoding="utf-8").splitlines(), listing().splitlines()
    gone, new = [line for line in written if line not in now], [line for line in now if line not in written]
    assert now == written, (
        f"the public API has changed: gone {gone}, new {new}. If that is meant, run `{COMMAND}` and say in "
        f"CHANGELOG.md what has changed; otherwise take it back"
    )


def test_the_changelog_says_so():
    wanted = digest(LISTED.read_text(encoding="utf-8"))
    assert f"`{wanted}`" in UNRELEASED, (
        f"tests/public_api.txt has changed: say in CHANGELOG.md, in its first section, what has, and that the list's "
        f"digest is `{wanted}`"
    )


@pytest.mark.parametrize("name", names())
def test_each_public_name_is_in_the_changelog(name):
    assert f"`{name}`" in CHANGES, f"CHANGELOG.md: name `{name}` in its first section"


@pytest.mark.parametrize("name", pcsr.__all__)
def test_each_public_name_is_documented(name):
    assert f"`{name}`" in (ROOT / "docs" / "plugins.md").read_text(encoding="utf-8")


def test_a_change_shows():
    tree = ast.parse("def f(a: int, *, b: str = 'x') -> None: ...").body[0]
    other = ast.parse("def f(a: int, *, b: str = 'y') -> None: ...").body[0]
    assert of_function(tree) != of_function(other)
    command = click.Command("c", params=[click.Option(["--a"]), click.Option(["--b"], is_flag=True)])
    assert list(of_commands(command, "c")) == ["c --a: text", "c --b: boolean flag"]
    assert digest("a") != digest("b")


if __name__ == "__main__":
    LISTED.write_text(listing(), encoding="utf-8")
    print(f"- The public API is listed in `tests/public_api.txt` (digest `{digest(listing())}`).")  # noqa: T201
