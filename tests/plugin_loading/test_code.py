"""The hash of a plugin's code: of its file and what it imports beside it, of a distribution and all of its files."""

import importlib
import os
import shutil

import pytest

from pcsr.plugins.code import distribution_code, file_code
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Entry


@pytest.fixture
def plugin(tmp_path):
    """A plugin file that imports a module and two packages beside it, one of them through another.

    The outer package has no `__init__.py`, as in many repositories.
    """
    (tmp_path / "package").mkdir()
    (tmp_path / "outer" / "inner").mkdir(parents=True)
    files = {
        "mine.py": "import os, near\nfrom pcsr import Fusion\nfrom outer.layers import z\n",
        "outer/layers.py": "from outer.inner import deep\n",
        "outer/inner/deep.py": "z = 1\n",
        "near.py": "def f():\n    from package import inner\n",
        "package/__init__.py": "",
        "package/inner.py": "x = 1\n",
        "other.py": "y = 1\n",
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    return tmp_path / "mine.py"


@pytest.mark.parametrize(
    "name",
    ["mine.py", "near.py", "package/__init__.py", "package/inner.py", "outer/layers.py", "outer/inner/deep.py"],
)
def test_an_edit_of_a_file_or_of_what_it_imports_changes_its_hash(plugin, name):
    before = file_code(plugin)
    path = plugin.parent / name
    path.write_text(path.read_text() + "\n")
    assert file_code(plugin) != before


def test_nothing_else_changes_it(plugin, tmp_path_factory):
    before = file_code(plugin)
    assert len(before) == 12
    (plugin.parent / "other.py").write_text("z = 3\n")
    os.utime(plugin, (0, 0))
    assert file_code(plugin) == before
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "copy"
    shutil.copytree(plugin.parent, elsewhere)
    (elsewhere / "mine.py").rename(elsewhere / "renamed.py")
    assert file_code(elsewhere / "renamed.py") == before


def test_a_file_whose_imports_cannot_be_followed_is_hashed_alone(plugin):
    (plugin.parent / "near.py").write_text("def f(:\n")
    before = file_code(plugin)
    (plugin.parent / "near.py").write_text("def g(:\n")
    assert file_code(plugin) == before
    plugin.write_text("import near, sys\n")
    assert file_code(plugin) not in (None, before)


def test_a_file_that_is_not_there_has_none(tmp_path):
    assert file_code(tmp_path / "none.py") is None


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """An editable distribution: its metadata on the path, its package and its module in a folder of the author's."""
    site, source = tmp_path / "site", tmp_path / "source"
    about = site / "pcsr_fake_fusion-0.3.dist-info"
    about.mkdir(parents=True)
    (source / "pcsr_fake_fusion" / "layers").mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: pcsr-fake-fusion\nVersion: 0.3\n")
    (about / "entry_points.txt").write_text("[pcsr]\nfake = pcsr_fake_fusion\n")
    (about / "top_level.txt").write_text("pcsr_fake_fusion\npcsr_fake_module\n")
    (source / "pcsr_fake_fusion" / "__init__.py").write_text(
        "from pcsr import Fusion, hookimpl\n\n\nclass Fake(Fusion):\n    def __init__(self, widths):\n"
        "        super().__init__()\n\n\n@hookimpl\ndef pcsr_register(register):\n"
        "    register.fusion('fake', Fake)\n"
    )
    (source / "pcsr_fake_fusion" / "layers" / "table.toml").write_text("a = 1\n")
    (source / "pcsr_fake_module.py").write_text("b = 1\n")
    monkeypatch.syspath_prepend(site)
    monkeypatch.syspath_prepend(source)
    importlib.invalidate_caches()
    return about, source


def code():
    return load_plugins().entries["fusion", "fake"].code


def test_an_edit_of_an_installed_distribution_changes_its_hash(installed):
    about, source = installed
    seen = [code()]
    assert len(seen[0]) == 12
    for path in (
        source / "pcsr_fake_fusion" / "__init__.py",
        source / "pcsr_fake_fusion" / "layers" / "table.toml",
        source / "pcsr_fake_module.py",
    ):
        path.write_text(path.read_text() + "\n# edited\n")
        seen.append(code())
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: pcsr-fake-fusion\nVersion: 0.4\n")
    seen.append(code())
    assert len(set(seen)) == 5, "each edit and the version"


def test_bytecode_and_hidden_files_are_no_code(installed):
    _, source = installed
    before = code()
    package = source / "pcsr_fake_fusion"
    (package / "__pycache__").mkdir(exist_ok=True)
    (package / "__pycache__" / "x.pyc").write_bytes(b"1")
    (package / ".git").mkdir()
    (package / ".git" / "head").write_text("1")
    (source / "beside.py").write_text("1")
    assert code() == before


def test_what_is_not_installed_has_none():
    assert distribution_code("pcsr-unknown") is None
    assert Entry("fusion", "x", "nowhere:X", "pcsr-unknown", "1").code is None
