"""Plugins register through one hook; a broken one breaks only itself."""

from importlib import metadata
from textwrap import dedent

import pytest

from pcsr.errors import UserError
from pcsr.plugins.loading import load_plugins, why

GOOD = """
    from pcsr import Fusion, hookimpl

    class Mine(Fusion):
        pass

    @hookimpl
    def pcsr_register(register):
        register.fusion("mine", Mine)
"""


@pytest.fixture
def write(tmp_path):
    def write_plugin(text, name="plugin.py"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True, parents=True)
        path.write_text(dedent(text), encoding="utf-8")
        return path

    return write_plugin


def test_the_parts_of_the_paper_come_through_the_same_door():
    registry = load_plugins()
    assert not registry.failures
    owners = {(entry.kind, entry.name): entry.owner for entry in registry}
    assert owners["fusion", "iterative"] == owners["shapes", "cad-parts"] == "pcsr"


def test_a_file_is_a_plugin(write):
    path = write(GOOD)
    registry = load_plugins([path])
    assert registry.get("fusion", "mine").__name__ == "Mine"
    assert registry.files == (path,)
    assert registry.entries["fusion", "mine"].owner == str(path)


def test_files_of_one_name_do_not_collide(write):
    one = write(GOOD, "a/plugin.py")
    two = write(GOOD.replace('"mine"', '"other"').replace("Mine", "Other"), "b/plugin.py")
    registry = load_plugins([one, two])
    assert registry.get("fusion", "mine").__name__ == "Mine"
    assert registry.get("fusion", "other").__name__ == "Other"
    assert registry.get("fusion", "mine").__module__ != registry.get("fusion", "other").__module__


BROKEN = {
    "raises at import": ("raise RuntimeError('no GPU here')", "RuntimeError: no GPU here"),
    "does not parse": ("def f(:\n", "SyntaxError: "),
    "imports what is not there": (
        "import no_such_module",
        "ModuleNotFoundError: No module named 'no_such_module'",
    ),
    "registers nothing": ("x = 1", "UserError: it has no function pcsr_register marked @pcsr.hookimpl"),
    "forgot the mark": (
        "def pcsr_register(register): ...",
        "UserError: it has no function pcsr_register marked",
    ),
    "misspells the hook": (
        "from pcsr import hookimpl\n@hookimpl\ndef pcsr_regster(register): ...",
        "PluginValidationError: unknown hook 'pcsr_regster'",
    ),
    "misspells the argument": (
        "from pcsr import hookimpl\n@hookimpl\ndef pcsr_register(registry): ...",
        "PluginValidationError: ",
    ),
    "raises in the hook": (
        "from pcsr import hookimpl\n@hookimpl\ndef pcsr_register(register): 1 / 0",
        "ZeroDivisionError: division by zero",
    ),
    "asks for a kind that is none": (
        "from pcsr import hookimpl\n@hookimpl\ndef pcsr_register(register): register.fusoin('a', 'b:C')",
        "AttributeError: 'Register' object has no attribute 'fusoin'",
    ),
}


@pytest.mark.parametrize(("text", "said"), BROKEN.values(), ids=BROKEN)
def test_a_broken_plugin_breaks_only_itself(write, text, said):
    broken, good = write(text, "broken.py"), write(GOOD, "good.py")
    registry = load_plugins([broken, good])
    assert registry.get("fusion", "mine")
    assert registry.get("fusion", "iterative")
    (failure,) = registry.failures
    assert failure.owner == str(broken)
    assert said in why(registry, str(broken))


def test_a_plugin_that_fails_halfway_registers_nothing(write):
    path = write("""
        from pcsr import hookimpl

        @hookimpl
        def pcsr_register(register):
            register.fusion("first", "x:Y")
            register.fusion("iterative", "x:Y")
    """)
    registry = load_plugins([path])
    assert "first" not in registry.names("fusion")
    assert f"fusion 'iterative' is registered twice, by pcsr and by {path}" in why(registry, str(path))


def test_why_says_where_a_plugin_failed(write):
    path = write("x = 1\n\nraise RuntimeError('no GPU here')\n")
    registry = load_plugins([path])
    assert why(registry, str(path)).splitlines() == [
        f"{path} file failed to load: RuntimeError: no GPU here",
        f"  at {path}:3",
    ]
    # The message about a part that isn't there names every plugin that failed.
    with pytest.raises(UserError) as refused:
        why(registry, "telepathy")
    assert str(refused.value).splitlines() == [
        "no installed plugin registers a part or is called 'telepathy'; a part in a file needs --plugin FILE",
        *why(registry, str(path)).splitlines(),
    ]


def test_why_of_a_misspelt_name_offers_the_right_one(write):
    with pytest.raises(UserError, match="called 'iterativ': did you mean 'iterative'"):
        why(load_plugins(), "iterativ")


def test_why_says_who_brings_a_part(write):
    path = write(GOOD)
    registry = load_plugins([path])
    assert why(registry, "mine") == f"fusion 'mine' comes from {path} file (Mine)"
    assert "(pcsr_plugins.fusions.iterative:Iterative)" in why(registry, "iterative")


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(UserError, match=r"--plugin .*nothing\.py: there is no such file"):
        load_plugins([tmp_path / "nothing.py"])


def test_a_file_that_is_not_python(write):
    registry = load_plugins([write("text", "plugin.txt")])
    assert "its name must end in .py" in str(registry.failures[0].error)


def install(folder, name, entry_points):
    """What an installer leaves of a distribution."""
    info = folder / f"{name.replace('-', '_')}-2.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 2.0\n")
    (info / "entry_points.txt").write_text(dedent(entry_points))


def test_an_installed_plugin_is_found_and_a_broken_one_is_kept(write, tmp_path, monkeypatch):
    write(GOOD, "pcsr_test_installed.py")
    install(tmp_path, "aaa-broken", "[pcsr]\nx = no_such_module\n[other]\ny = never_looked_at")
    install(tmp_path, "pcsr-mine", "[pcsr]\nmine = pcsr_test_installed")
    monkeypatch.syspath_prepend(tmp_path)
    registry = load_plugins()
    mine = registry.entries["fusion", "mine"]
    assert (mine.owner, mine.version) == ("pcsr-mine", "2.0")
    assert registry.get("fusion", "iterative")
    (failure,) = registry.failures
    assert (failure.owner, failure.version) == ("aaa-broken", "2.0")
    assert isinstance(failure.error, ModuleNotFoundError)


def test_a_distribution_that_is_on_the_path_twice_counts_once(monkeypatch):
    twice = [*metadata.distributions(), *metadata.distributions()]
    monkeypatch.setattr("pcsr.plugins.loading.distributions", lambda: iter(twice))
    registry = load_plugins()
    assert not registry.failures
    assert registry.names("fusion")


@pytest.mark.parametrize("how", ["SystemExit(0)", "BaseException('odd')"])
def test_a_plugin_that_wants_to_end_everything_ends_itself_alone(write, how):
    path = write(f"raise {how}\n")
    registry = load_plugins([path])
    assert [failure.owner for failure in registry.failures] == [str(path)]
    assert "failed to load" in why(registry, str(path))
    assert registry.names("fusion")
