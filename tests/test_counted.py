"""Numbers with their nouns."""

from pcsr.counted import counted


def test_only_one_is_singular():
    assert [counted(count, "run") for count in (0, 1, 2)] == ["0 runs", "1 run", "2 runs"]
