"""A table loses no letter, however narrow the terminal is."""

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from pcsr import report
from pcsr.report.tables.text_table import TextTable
from pcsr.results import parse_results

CELLS = st.text("ab1±[] \n", max_size=12)


def printed(table, width):
    console = Console(file=io.StringIO(), width=width)
    console.print(table)
    lines = console.file.getvalue().splitlines()
    assert all(len(line) <= width for line in lines)
    return lines


@given(
    st.integers(1, 4).flatmap(
        lambda n: st.tuples(
            st.lists(CELLS, min_size=n, max_size=n), st.lists(st.lists(CELLS, min_size=n, max_size=n), min_size=1)
        )
    ),
    st.integers(8, 60),
)
def test_every_letter_is_printed(made, width):
    heads, cells = made
    text = "".join(printed(TextTable("title", heads, cells, "a note"), width))
    for letter in "ab1±[]":
        wanted = sum(cell.count(letter) for row in (heads, *cells) for cell in row)
        assert text.count(letter) >= wanted + "a note".count(letter)


@pytest.mark.parametrize("width", [40, 60, 80, 100, 140])
def test_names_and_numbers_are_whole_at_80_columns_and_fewer(results, touch, width):
    for name in ("hd-pugcn", "emd", "p2f"):
        results["metrics"][name] = {"description": "a distance", "scale": 1000}
        for method in results["methods"]:
            method["values"][name] = method["values"]["hd"]
    table = report.table(parse_results(results))
    lines = printed(table, width)
    words = " ".join(lines).split()
    for row in (table.heads, *table.cells):
        for cell in row:
            assert set(cell.split()) <= set(words)
    assert "…" not in " ".join(lines)


def test_a_table_that_is_too_wide_has_its_deviations_below_the_means():
    table = TextTable("", ["method", "cd"], [["net", "1.25 ± 0.75\n3/8 wins"]], "")
    assert any("1.25 ± 0.75" in line for line in printed(table, 30))
    narrow = [line.split() for line in printed(table, 17) if line.strip()]
    assert ["net", "1.25"] in narrow
    assert ["±", "0.75"] in narrow


def test_a_table_that_is_still_too_wide_becomes_several_with_the_same_first_column():
    table = TextTable("", ["method", *"abcd"], [["net", *(letter * 6 for letter in "vwxy")]], "")
    lines = [line.split() for line in printed(table, 25) if "net" in line]
    assert lines == [["net", "vvvvvv", "wwwwww"], ["net", "xxxxxx", "yyyyyy"]]


def test_what_a_terminal_takes_for_markup_is_text():
    table = TextTable("[red]title", ["[b]head"], [["[bold]cell[/bold]"]], "[dim]note")
    text = " ".join(printed(table, 60))
    assert all(part in text for part in ("[red]title", "[b]head", "[bold]cell[/bold]", "[dim]note"))
