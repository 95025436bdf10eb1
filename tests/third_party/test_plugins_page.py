"""docs/plugins.md from top to bottom: its files are written, its commands typed, and what it quotes is said."""

import re
from inspect import get_annotations, isfunction, signature
from pathlib import Path

import pytest

import pcsr
from pcsr import contracts
from pcsr.plugins.registry import KINDS

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "plugins.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", TEXT, re.DOTALL)
QUOTED = " ".join(re.findall(r"^> (.*)$", TEXT, re.MULTILINE))


@pytest.fixture(scope="module")
def done(environment, tmp_path_factory):
    """What each line printed, and the folder in which the page was followed."""
    folder = tmp_path_factory.mktemp("page")
    printed: list[tuple[str, str]] = []
    for language, block in BLOCKS:
        if language == "sh":
            for line in block.splitlines():
                missing = "# no installed plugin" in line
                printed.append((line, environment(line, folder, code=2 if missing else 0)))
        elif language == "toml":
            assert block in (folder / "my-fusion" / "pyproject.toml").read_text(encoding="utf-8")
        else:
            name = re.match(r"# ([a-z_]+\.(py|yaml))\n", block)[1]
            (folder / name).write_text(block, encoding="utf-8")
            if name.startswith("test_"):
                printed.append((name, environment(f"pytest -q {name}", folder)))
    return printed, folder


def test_the_first_thing_on_the_page_is_a_plugin_in_one_file():
    language, block = BLOCKS[0]
    assert (language, block.splitlines()[0]) == ("python", "# nearest.py")
    assert {language for language, _ in BLOCKS} == {"python", "yaml", "sh", "toml"}


@pytest.mark.slow
def test_every_command_does_what_is_said_of_it(done):
    printed, folder = done
    assert len(printed) >= 12
    why = [text for line, text in printed if line.startswith("pcsr plugins --why my-fusion")]
    assert why[0].startswith("fusion 'my-fusion' comes from my-fusion 0.1.0")
    assert "no installed plugin registers a part or is called 'my-fusion'" in why[1]
    new = next(line for line, _ in printed if line.startswith("pcsr plugins new"))
    (files,) = re.findall(r"# my-fusion/: (.*)", new)
    assert set(files.split(", ")) == {path.name for path in (folder / "my-fusion").iterdir() if path.is_file()}


@pytest.mark.slow
def test_the_comparison_ends_in_a_table_of_both_fusions(done):
    (compared,) = [text for line, text in done[0] if line.startswith("pcsr compare")]
    table = compared[compared.rindex("report: ") :]
    rows = re.findall(r"^ *(fusion\.[a-z.-]+) +[\d.]+ ± [\d.]+", table, re.MULTILINE)
    assert rows == ["fusion.iterative", "fusion.my-fusion"]


@pytest.mark.slow
def test_weights_say_what_has_to_be_installed(done):
    _, folder = done
    run = next(path for path in (folder / "runs").glob("small-fusion.my-fusion-*") if path.is_dir())
    with pytest.raises(pcsr.UserError) as caught:
        pcsr.load(run)
    message = str(caught.value).replace(f"{folder}/", "")
    start, end = QUOTED.split("…")
    assert message.startswith(start)
    assert message.endswith(end)


@pytest.mark.parametrize("kind", KINDS)
def test_the_table_of_kinds_leads_to_a_page_for_each(kind):
    assert f"| `{kind}` |" in TEXT
    assert f"(parts/{kind}.md)" in TEXT
    assert (ROOT / "docs" / "parts" / f"{kind}.md").is_file()
    assert isfunction(getattr(pcsr.Register, kind))


def test_what_all_parts_have_is_told():
    for name in (*get_annotations(contracts.Part), *get_annotations(contracts.Widths)):
        assert f"`{name}`" in TEXT, name
    assert all(f"`{trait.name}`" in TEXT for trait in contracts.Trait)


def test_the_hook_and_its_argument_are_told():
    from pcsr.cli import GROUP as COMMANDS
    from pcsr.plugins.hookspecs import pcsr_register
    from pcsr.plugins.loading import GROUP

    assert f"def pcsr_register({', '.join(signature(pcsr_register).parameters)}):" in TEXT
    assert f"[project.entry-points.{GROUP}]" in TEXT
    assert f"`{COMMANDS}`" in TEXT
