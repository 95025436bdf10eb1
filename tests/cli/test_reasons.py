from pcsr.cli.reasons import echo_skipped, kinds, skipped_lines
from pcsr.recorded import Recording


def test_reasons_that_differ_in_names_and_numbers_are_of_one_kind():
    reasons = {"one": "one has 3 points", "two": "two has 17.5 points", "cup": "cup is lost", "4": "4 has 1e-3 points"}
    assert [list(alike) for alike in kinds(reasons)] == [["one", "two", "4"], ["cup"]]


def test_many_skipped_touches_of_one_kind_are_one_line(capsys):
    few = {f"{k}.jpg": f"no contact: none of the {k + 90} pixels is in contact" for k in range(3)}
    lines = skipped_lines(Recording([], [], few))
    assert lines == [f"touch {name} is skipped: {reason}" for name, reason in few.items()]
    many = {f"{k}.jpg": f"no contact: none of the {k + 90} pixels is in contact" for k in range(40)} | {"x": "damaged"}
    echo_skipped(Recording([], [], many))
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.splitlines() == [
        "touch 0.jpg and 39 more like it are skipped: no contact: none of the 90 pixels is in contact",
        "touch x is skipped: damaged",
    ]
