"""Files of foreign networks: imported as they lie in their repository, found by name, and no plugins of parts."""

import sys

import pytest

from pcsr.errors import UserError
from pcsr.plugins.code import file_code
from pcsr.plugins.loading import add_file, load_plugins
from pcsr.plugins.networks import find_network, network_code

NETWORK = """\
from torch import nn
from models.layers import width

class Net(nn.Module):
    width = width
"""


@pytest.fixture
def repository(tmp_path):
    """Write a repository whose network imports a module of a package, from the folder above its own."""

    def write(name, width):
        folder = tmp_path / name / "models"
        (folder / "inner").mkdir(parents=True)  # packages without an __init__.py, as they often are
        (folder / "layers.py").write_text("from models.inner.sizes import width\n")
        (folder / "inner" / "sizes.py").write_text(f"width = {width}\n")
        (folder / f"{name}.py").write_text(NETWORK)
        return folder / f"{name}.py"

    return write


def test_two_repositories_may_have_packages_of_one_name(repository):
    one, two = repository("one", 1), repository("two", 2)
    path = list(sys.path)
    registry = load_plugins([one])
    add_file(registry, two)
    assert not registry.failures, "a file of networks needs no hook"
    assert [find_network(registry, f"{name}.py:Net")[1].width for name in ("one", "two")] == [1, 2]
    assert registry.files == (one, two)
    assert sys.path == path
    assert "models" not in sys.modules
    add_file(registry, two.parent / ".." / "models" / "two.py")
    assert registry.files == (one, two), "once"


def test_an_edit_of_a_module_above_changes_the_code(repository):
    file = repository("one", 1)
    registry = load_plugins([file])
    before = network_code(registry, "one.py:Net")
    assert before != file_code(file)
    assert before == network_code(load_plugins([file]), "one.py:Net")
    sizes = file.parent / "inner" / "sizes.py"
    sizes.write_text(sizes.read_text() + "# edited\n")
    assert network_code(registry, "one.py:Net") != before


def test_a_renamed_file_has_the_network_still(repository):
    file = repository("one", 1)
    assert find_network(load_plugins([file]), "before.py:Net")[0] == file


@pytest.mark.parametrize(
    ("network", "message"),
    [
        ("one.py:Nett", r"one\.py has no network 'Nett': did you mean 'Net'\?"),
        ("one.py:width", r"'width' of .*one\.py is no class derived from torch\.nn\.Module, nor a function annotated"),
        ("other.py:Other", r"network 'Other' of the file other\.py: hand in that file with --plugin"),
    ],
)
def test_a_network_that_is_not_there_is_named(repository, network, message):
    with pytest.raises(UserError, match=message):
        find_network(load_plugins([repository("one", 1)]), network)


def test_nothing_but_networks_can_be_named(tmp_path):
    """Weights name the network and its options: they must not call other functions of a file."""
    file = tmp_path / "mine.py"
    file.write_text(
        "import os\nfrom os import system\nfrom subprocess import Popen\nfrom torch import nn, load\n"
        "from torch.nn import Linear\n\n\ndef helper(path):\n    os.remove(path)\n\n\n"
        "def made(path: str) -> nn.Module:\n    return nn.Linear(3, 3)\n"
    )
    registry = load_plugins([file])
    assert not registry.failures
    assert find_network(registry, "mine.py:made")[0] == file
    for name in ("os", "os.system", "system", "Popen", "load", "helper", "Linear", "nn", "__builtins__", "none"):
        with pytest.raises(UserError, match=r"is no class derived|has no network"):
            find_network(registry, f"mine.py:{name}")


def test_files_that_cannot_be_loaded_are_refused_in_one_line(repository, tmp_path):
    registry = load_plugins([repository("one", 1)])
    (tmp_path / "broken.py").write_text("import pointops_of_cuda\n")
    (tmp_path / "one.py").write_text("")
    for name, message in {
        "broken.py": r"broken\.py cannot be loaded: ModuleNotFoundError: No module named 'pointops_of_cuda'",
        "none.py": r"there is no file .*none\.py",
        "one.py": r"one\.py has the name of .*: rename one",
    }.items():
        with pytest.raises(UserError, match=message) as caught:
            add_file(registry, tmp_path / name)
        assert "\n" not in str(caught.value)
    assert len(registry.files) == len(registry.modules) == 1
    assert not registry.failures
