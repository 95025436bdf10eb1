"""Table of text that fits a terminal of any width without cutting a letter."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType
from rich.constrain import Constrain
from rich.table import Table
from rich.text import Text

GAP = 3
"""Columns of the terminal between two columns of the table."""
NOTE = 100
"""Least width of the note below a table, in columns, where the console is so wide."""


@dataclass(frozen=True)
class TextTable:
    """Table of plain text. A cell may have several lines, separated by newlines.

    Printed to a `rich` console, the table adapts to the width: where it is too wide, standard deviations go into a
    line of their own; where it is still too wide, columns are distributed over several tables, each with the first
    column.
    """

    title: str
    heads: list[str]
    cells: list[list[str]]
    """Rows; the first cell of each is its label."""
    note: str
    bold: frozenset[tuple[int, int]] = frozenset()
    """Row and column of the cells whose first line is bold."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[RenderableType]:
        """Lay the table out for the width of the console."""
        width = options.max_width
        everything = list(range(1, len(self.heads)))
        yield Text(self.title, style="table.title", overflow="fold")
        # Both forms of a cell have the same length, so that bold stays in its place.
        stacked = [[cell.replace(" ± ", "\n± ") for cell in row] for row in self.cells]
        for cells in (self.cells, stacked):
            widths = self._widths(cells)
            if sum(widths) + GAP * len(everything) <= width:
                yield self._table(cells, widths, everything)
                width = min(width, max(NOTE, sum(widths) + GAP * len(everything)))
                break
        else:
            for widths, columns in _distributed(self._widths(self.cells), width):
                yield self._table(self.cells, widths, columns)
        yield Text()
        yield Constrain(Text(self.note, style="table.caption", overflow="fold"), width)

    def _widths(self, cells: Sequence[Sequence[str]]) -> list[int]:
        """Width of each column: its longest line, or the longest word of its head."""
        return [
            max(1, *map(cell_len, (*head.split(), *(line for row in cells for line in row[k].split("\n")))))
            for k, head in enumerate(self.heads)
        ]

    def _table(self, cells: Sequence[Sequence[str]], widths: Sequence[int], columns: Sequence[int]) -> Table:
        table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
        for k in (0, *columns):
            head = Text(self.heads[k], overflow="fold")
            table.add_column(head, justify="right" if k else "left", overflow="fold", width=widths[k])
        for i, row in enumerate(cells):
            table.add_row(*(self._text(row[k], (i, k)) for k in (0, *columns)))
        return table

    def _text(self, cell: str, position: tuple[int, int]) -> Text:
        text = Text(cell, overflow="fold")
        if position in self.bold:
            text.stylize("bold", 0, len(self.cells[position[0]][position[1]].partition("\n")[0]))
        return text


def _distributed(widths: Sequence[int], width: int) -> Iterator[tuple[list[int], list[int]]]:
    """Widths of all columns, and the columns beside the first one, for each of several tables that fit a width."""
    first = min(widths[0], max(1, width // 2))
    room = max(1, width - first - GAP)
    fitted = [first, *(min(one, room) for one in widths[1:])]
    columns: list[int] = []
    for k in range(1, len(fitted)):
        if columns and sum(fitted[c] + GAP for c in (*columns, k)) > width - first:
            yield fitted, columns
            columns = []
        columns.append(k)
    yield fitted, columns
