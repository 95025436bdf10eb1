"""`pcsr plugins check`: a line for each check, what is wrong with a part, and what is wrong with the command."""

from pathlib import Path

import pytest
import trimesh
from click.testing import CliRunner

from pcsr.cli import pcsr
from pcsr.testing import checks_for
from tests.testing.parts import Boxes, Lift, Pats

PLUGIN = """
from pcsr import UserError, hookimpl
from tests.testing import parts, broken_network


class Lift(parts.Lift):
    pass


class Picky(parts.Pats):
    def touches(self, item, cloud, count, seed):
        if item.name != "box.stl":
            raise UserError(f"{item.name}: never recorded")
        return super().touches(item, cloud, count, seed)


class Choosy(parts.Squares):
    def losses(self, network, points, truth, rate, touches=None):
        if not isinstance(network.upsampler, parts.Copy):
            raise UserError("objective 'choosy' wants the upsampler 'copy'")
        return super().losses(network, points, truth, rate, touches)


class Tuples(parts.Boxes):
    def __init__(self, *, counts: tuple[int, int] = (2, 1), folder: str) -> None:
        assert isinstance(counts, tuple)
        self.counts = dict(zip(("train", "test"), counts))


@hookimpl
def pcsr_register(register):
    register.encoder("lift", Lift)
    register.encoder("noisy", broken_network.Noisy)
    register.fusion("lift", parts.Attend)
    register.upsampler("copy", parts.Copy)
    register.objective("choosy", Choosy)
    register.touch("picky", Picky)
    register.shapes("tuples", Tuples)
    register.shapes("lost", "no_such:Part")
"""


@pytest.fixture
def invoke(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("lab.py").write_text(PLUGIN)
    return lambda *arguments: CliRunner().invoke(pcsr, ["plugins", "check", *map(str, arguments), "--plugin", "lab.py"])


def names(output, result):
    return [line.split()[1].rstrip(":") for line in output.splitlines() if line.split()[0] == result]


@pytest.mark.slow
def test_a_part_that_keeps_its_contract(invoke):
    result = invoke("lift", "--kind", "encoder")
    assert result.exit_code == 0, result.output
    lines = result.output.splitlines()
    assert lines[0] == "encoder 'lift' of lab.py file"
    assert names(result.output, "passed") == [check.name for check in checks_for(Lift) if check.name != "trait-local"]
    assert lines[-1] == f"  {len(lines) - 3} passed, 1 skipped, 0 failed"


@pytest.mark.slow
def test_a_part_that_does_not_says_what_to_do_and_the_command_fails(invoke):
    result = invoke("noisy")
    assert result.exit_code == 1
    assert {"independent-rows", "deterministic"} <= set(names(result.output, "FAILED"))
    assert {"builds", "shapes", "gradients"} <= set(names(result.output, "passed"))
    assert "in eval mode the same input gives results that are" in result.stdout
    assert "draw nothing at random, and keep no state, where `self.training` is False" in result.stdout
    assert result.stderr.startswith("pcsr: error: encoder 'noisy' failed")


@pytest.mark.slow
def test_all_parts_of_a_name_are_checked(invoke):
    result = invoke("lift")
    assert [line for line in result.output.splitlines() if line[0] != " "] == [
        "encoder 'lift' of lab.py file",
        "fusion 'lift' of lab.py file",
    ]
    assert "skipped ragged-join: fusion Attend does not join" in result.output


@pytest.mark.slow
def test_an_object_and_an_upsampler_can_be_handed_in(invoke):
    trimesh.creation.box([10, 20, 30]).export("box.stl")
    assert "refuses 0 touches of 'egg'" in invoke("picky").stdout
    assert invoke("picky", "--mesh", "box.stl", "--set", "points=4").exit_code == 0
    assert "refuses the suite's network" in invoke("choosy").stdout
    assert invoke("choosy", "--upsampler", "copy").exit_code == 0


@pytest.mark.slow
def test_options_are_read_as_a_recipe_reads_them(invoke):
    result = invoke("tuples")
    assert result.exit_code == 1
    assert "missing 1 required keyword-only argument: 'folder'" in result.stdout
    assert "--set option=…" in result.stdout
    assert invoke("tuples", "--set", "folder=here", "--set", "counts=[1, 1]").exit_code == 0
    assert "counts" in invoke("tuples", "--set", "counts=[1, x]").stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["lifd"], "there is no part and no plugin 'lifd': did you mean 'lift'?"),
        (["lift", "--kind", "fusions"], "--kind fusions: there is no such kind: did you mean 'fusion'?"),
        (
            ["lift", "--kind", "backbone"],
            "--kind backbone: there is no backbone 'lift', only of the kind encoder, fusion",
        ),
        (
            ["noisy", "--set", "chanels=3"],
            "--set chanels=3: encoder 'noisy' takes no 'chanels': did you mean 'channels'?",
        ),
        (["noisy", "--set", "channels"], "--set channels: write KEY=VALUE"),
        (["noisy", "--set", "channels=wide"], "--set, for encoder 'noisy': channels: it must be a whole number"),
        (["picky", "--mesh", "none.stl"], "--mesh none.stl: there is no such file"),
        (["picky", "--mesh", "."], "--mesh .: that is a folder"),
        (["choosy", "--upsampler", "copi"], "there is no upsampler 'copi': did you mean 'copy'?"),
        (["lost"], "shapes 'lost' of lab.py cannot be loaded from 'no_such:Part'"),
    ],
)
def test_mistakes_are_one_line(invoke, arguments, said):
    result = invoke(*arguments)
    assert result.exit_code == 2
    assert said in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_a_plugin_that_failed_says_why(invoke):
    Path("lab.py").write_text("raise RuntimeError('no')")
    result = invoke("lab.py")
    assert result.exit_code == 2
    assert "lab.py file failed to load: RuntimeError: no" in result.stderr


def test_options_of_the_group_are_not_lost_before_a_subcommand(invoke):
    for option in (["--plugin", "lab.py"], ["--why", "lift"]):
        result = CliRunner().invoke(pcsr, ["plugins", *option, "check", "lift"])
        assert result.exit_code == 2
        assert "options go behind the subcommand: pcsr plugins check … --plugin FILE" in result.output


def test_the_parts_of_these_tests_are_sound():
    for part in (Boxes, Pats):
        assert all(check.outcome().result == "passed" for check in checks_for(part))


@pytest.mark.slow
def test_the_part_of_the_file_is_checked_where_one_of_its_name_is_installed(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(
        "from pcsr import Fusion, hookimpl\n\n\nclass Mine(Fusion):\n    def __init__(self, widths):\n"
        "        super().__init__()\n        raise ValueError('of the file')\n\n\n@hookimpl\n"
        "def pcsr_register(register):\n    register.fusion('concat', Mine)\n"
    )
    done = CliRunner().invoke(pcsr, ["plugins", "check", "concat", "--plugin", str(file)])
    assert f"fusion 'concat' of {file} file" in done.output
    assert "of the file" in done.output
    assert done.exit_code == 1
    assert CliRunner().invoke(pcsr, ["plugins", "check", "concat"]).output.startswith("fusion 'concat' of pcsr ")
    twice = tmp_path / "twice.py"
    twice.write_text(file.read_text())
    both = CliRunner().invoke(pcsr, ["plugins", "check", "concat", "--plugin", str(file), "--plugin", str(twice)])
    assert f"fusion 'concat' of {file} file" in both.output
    assert str(twice) not in both.output
