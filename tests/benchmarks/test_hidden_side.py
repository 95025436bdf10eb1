"""benchmarks/hidden_side.py: parts that one camera saw, with touches of the other side and without."""

import importlib
from pathlib import Path

import pytest
from click.testing import CliRunner

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    script = importlib.import_module("hidden_side")

FEW = ["--set", "data.shapes.held_out=2"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*touched points")
def test_touches_of_the_unseen_side_lower_the_error_of_interpolation():
    parts = script.samples(3, FEW[1::2])
    plain, touched = (script.errors(script.pcsr.load("midpoint"), parts, count) for count in (0, 3))
    assert len(parts) == 2
    assert (touched < 0.8 * plain).all()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*touched points")
def test_there_is_a_row_for_each_model():
    done = CliRunner().invoke(script.main, ["midpoint", "--touches", "1", *FEW])
    assert done.exit_code == 0, done.output
    assert [line.split("|")[1].strip() for line in done.stdout.splitlines() if "/2" in line] == ["`midpoint`"]


@pytest.mark.parametrize(
    ("setting", "said"),
    [("data.point=3", "data.point"), ("data.touch.policy=uniform", "leaves no row of policy 'sparse'")],
)
def test_a_mistake_in_the_recipe_is_one_line(setting, said):
    done = CliRunner().invoke(script.main, ["--set", setting])
    assert done.exit_code == 1
    assert said in done.output
    assert "Traceback" not in done.output
