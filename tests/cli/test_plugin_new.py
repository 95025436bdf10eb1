"""`pcsr plugins new`: what it writes works as it is, for every kind; what it can't write it refuses."""

import ast
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import assume, given
from hypothesis import strategies as st

from pcsr.cli import pcsr
from pcsr.cli.plugin_new import LISTED, NAME, SECTIONS, WITHIN, distribution
from pcsr.errors import UserError
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import KINDS
from pcsr.recipe.part_keys import NAMES, PART_LISTS, PARTS


@pytest.fixture
def new(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(pcsr, ["plugins", "new", *arguments])


def test_every_kind_can_be_written_and_is_named_where_a_recipe_names_it():
    assert list(SECTIONS) == list(KINDS)
    keys = {kind: WITHIN[kind][0] if kind in WITHIN else LISTED.get(kind, kind) for kind in SECTIONS}
    wanted = {(section, keys[kind]) for kind, section in SECTIONS.items()}
    assert wanted <= PARTS.keys() | NAMES.keys() | PART_LISTS.keys()


@pytest.mark.slow
def test_as_written_the_tests_of_every_kind_pass(new, tmp_path):
    for kind in SECTIONS:
        result = new(kind, f"my-{kind}")
        assert result.exit_code == 0, result.output
        files = sorted(path.name for path in (tmp_path / f"my-{kind}").iterdir())
        assert files == ["README.md", f"my_{kind}.py", "pyproject.toml", f"test_my_{kind}.py"]
        assert result.output.startswith(f"my-{kind}/: pyproject.toml, my_{kind}.py, ")
    (tmp_path / "pytest.ini").write_text("[pytest]\nfilterwarnings = error\n")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *(f"my-{kind}" for kind in SECTIONS)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )
    assert done.returncode == 0, done.stdout
    assert int(re.search(r"(\d+) passed", done.stdout)[1]) >= 5 * len(SECTIONS)


@pytest.mark.parametrize("kind", SECTIONS)
def test_the_module_registers_the_part_under_its_name(new, kind, tmp_path):
    assert new(kind, "Mine-2d").exit_code == 0
    registry = load_plugins([tmp_path / "Mine-2d" / "mine_2d.py"])
    assert not registry.failures
    assert registry.get(kind, "Mine-2d").__name__ == "Mine2d"


@pytest.mark.parametrize("kind", SECTIONS)
def test_what_pip_is_told_fits_the_files(kind):
    files = distribution(kind, "my-part")
    project_file = tomllib.loads(files["pyproject.toml"])
    assert project_file["project"]["name"] == "my-part"
    assert project_file["project"]["entry-points"]["pcsr"] == {"my-part": "my_part"}
    assert project_file["tool"]["hatch"]["build"]["targets"]["wheel"]["only-include"] == ["my_part.py"]
    ours = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))
    ours["build-system"]["requires"] = [
        one for one in ours["build-system"]["requires"] if "readme" not in one
    ]  # PyPI's
    assert project_file["build-system"] == ours["build-system"]
    assert not [file for file, text in files.items() if "$" in text]
    line = f"{LISTED[kind]}: [my-part]" if kind in LISTED else f"{kind}: {{use: my-part}}"
    if kind in WITHIN:
        outer, of = WITHIN[kind]
        line = f"{outer}: {{use: {of}, {kind}: my-part}}"
    assert f"{SECTIONS[kind]}:\n  {line}" in files["README.md"]


@pytest.mark.slow
@given(name=st.from_regex(NAME, fullmatch=True), kind=st.sampled_from(list(SECTIONS)))
def test_whatever_name_is_taken_makes_a_module_that_compiles(name, kind):
    try:
        files = distribution(kind, name)
    except UserError:  # as `a`, `None` or `re`; which ones, the tests below say
        assume(False)
    tree = ast.parse(files[f"{name.replace('-', '_').lower()}.py"])
    (part,) = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    others = {node.id for node in ast.walk(ast.Module(tree.body[:-2], [])) if isinstance(node, ast.Name)}
    assert part.name not in others


@pytest.mark.parametrize("name", ["", "2d", "my_fusion", "my--fusion", "my-", "-my", "my fusion", "a/b", "..", "größe"])
def test_a_bad_name_is_refused(new, name, tmp_path):
    result = new("fusion", "--", name)
    assert result.exit_code == 2
    assert f"name '{name}': it must consist of letters and digits with single hyphens between them" in result.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("none", "module none or class None has another meaning"),
        ("class", "module class or class Class has another meaning"),
        ("fusion", "module fusion or class Fusion has another meaning"),
        ("register", "module register or class Register has another meaning"),
        ("torch", "pip would replace torch, which is installed"),
        ("json", f"it would hide the module json in {json.__file__}"),
    ],
)
def test_a_name_that_python_would_mix_up_is_refused(new, name, said, tmp_path):
    result = new("fusion", name)
    assert (result.exit_code, f"name '{name}': {said}: choose another" in result.stderr) == (2, True), result.stderr
    assert not list(tmp_path.iterdir())


def test_a_name_that_is_taken_is_refused_for_its_own_kind_alone(new, tmp_path):
    result = new("fusion", "iterative")
    assert result.exit_code == 2
    assert "name 'iterative': pcsr already registers a fusion of this name: choose another" in result.stderr
    assert new("encoder", "iterative").exit_code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["iterative"]


@pytest.mark.parametrize("there", ["file", "folder"])
def test_what_is_there_stays_as_it_is(new, there, tmp_path):
    path = tmp_path / "my-fusion"
    path.write_text("mine") if there == "file" else path.mkdir()
    result = new("fusion", "my-fusion")
    assert result.exit_code == 2
    assert "folder my-fusion exists already: choose another name, or remove it" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["my-fusion"]
    assert path.is_file() or not list(path.iterdir())


def test_an_unknown_kind_is_told_the_kinds(new):
    result = new("fusoin", "my-fusion")
    assert result.exit_code == 2
    assert all(kind in result.stderr for kind in SECTIONS)


def test_a_folder_is_written_whole_or_not_at_all(new, tmp_path, monkeypatch):
    def full(old, other):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.rename", full)
    result = new("fusion", "my-fusion")
    assert result.exit_code == 1
    assert "folder my-fusion could not be written: No space left on device" in result.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("ruamel-yaml", "pip would replace ruamel.yaml, which is installed"),
        ("PoT", "pip would replace POT, which is installed"),
        ("x" * 101, "is 101 characters long"),
    ],
)
def test_what_pip_or_a_disk_would_not_take_is_refused(new, name, said, tmp_path):
    result = new("fusion", name)
    assert result.exit_code == UserError.exit_code
    assert said in result.output
    assert not list(tmp_path.iterdir())
