"""What people catch, and what the command line returns."""

import pytest

import pcsr
from pcsr.errors import did_you_mean


@pytest.mark.parametrize(("kind", "code"), [(pcsr.UserError, 2), (pcsr.RunError, 1), (pcsr.PcsrError, 1)])
def test_all_that_pcsr_reports_is_one_kind_of_error_with_a_code(kind, code):
    with pytest.raises(pcsr.PcsrError, match="said") as caught:
        raise kind("said")
    assert caught.value.exit_code == code


def test_a_slip_gets_a_suggestion_and_nonsense_the_whole_list():
    assert did_you_mean("iterativ", ["none", "iterative"]) == "did you mean 'iterative'?"
    assert did_you_mean("xyz", ["none", "iterative"]) == "known: iterative, none"
    assert did_you_mean("xyz", []) == "none is known"


def test_characters_that_steer_a_terminal_are_escaped():
    assert str(pcsr.PcsrWarning("a\x1b[2J\ud800\nb")) == "a\\x1b[2J\\ud800\nb"
    assert str(pcsr.UserError("column 'a\x1b[2Jb\x07':\nß × 10⁻³")) == "column 'a\\x1b[2Jb\\x07':\nß × 10⁻³"
