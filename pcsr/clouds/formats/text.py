"""XYZ, TXT, ASC and CSV: a point on each line, with or without names of columns; all columns are kept."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import one_word_names, spread
from pcsr.clouds.formats.attributes import name_columns
from pcsr.clouds.formats.column_names import given_names
from pcsr.clouds.formats.digits import check_lines, words
from pcsr.clouds.formats.encodings import as_utf8
from pcsr.clouds.formats.preamble import BLANK, COMMENT, COUNT, Preamble, read_preamble
from pcsr.clouds.formats.separators import find_layout
from pcsr.clouds.formats.table import INTEGER, Rows, read_table
from pcsr.clouds.formats.titles import Names, check_given, choose_names, find_names
from pcsr.errors import UserError
from pcsr.limits import MOST_COLUMNS


def read_xyz(data: bytes, *, columns: str | Sequence[str] | None = None, all_columns: bool = True) -> Cloud:
    """Read numbers separated by white space, semicolons, tabs, bars or commas.

    If the file does not name columns x, y and z, the first three columns are the coordinates.

    Args:
        data: content of the file.
        columns: names of the columns, such as "x,y,z,-,red,green,blue"; those in the file by default. Columns that are
            called - or _ and those beyond the last name are left out.
        all_columns: whether to read other columns than the coordinates.
    """
    return _read(data, columns, all_columns)


def read_csv(data: bytes, *, columns: str | Sequence[str] | None = None, all_columns: bool = True) -> Cloud:
    """Read a table as `read_xyz` does; names of columns, if there are any, must include x, y and z."""
    return _read(data, columns, all_columns, must=True)


def read_as(
    data: bytes,
    default: Mapping[int, Sequence[str]],
    *,
    columns: str | Sequence[str] | None = None,
    all_columns: bool = True,
) -> Cloud:
    """Read a table as `read_xyz` does, in a format that defines the names of its columns.

    Args:
        data: content of the file.
        default: names of the columns beside the coordinates, by the number of columns.
        columns: as in `read_xyz`.
        all_columns: as in `read_xyz`.
    """
    return _read(data, columns, all_columns, default=default)


def _read(
    data: bytes,
    columns: str | Sequence[str] | None,
    all_columns: bool,
    *,
    must: bool = False,
    default: Mapping[int, Sequence[str]] | None = None,
) -> Cloud:
    given = None if columns is None else given_names(columns)
    check_lines(data)
    data, notes = as_utf8(data)
    head = read_preamble(data)
    data, counted, blank = _without_other_lines(data, head)
    if blank:
        lines = "1 line of separators alone is" if blank == 1 else f"{blank} lines of separators alone are"
        notes.append(f"{lines} left out")
    found = find_names(head) if given is None else []
    widths = {len(given)} if given is not None else {len(each.names) for each in found if not each.rest}
    if default is not None and not widths:
        widths = {3, *default}
    layout = find_layout(head.sample, data, head.start, widths)
    sample = [layout.split(line) for line in head.sample if not COUNT.fullmatch(line.encode())]
    width = max(map(len, sample))
    if width > MOST_COLUMNS:
        raise UserError(f"it has {width} columns, and {MOST_COLUMNS} are the most: remove some")
    if width < 3:
        raise UserError(f"line {head.line} has {width} columns, at least 3 are needed")
    if given is not None:
        names = check_given(given, head, width)
    elif found and not all_columns:
        names = next((each for each in found if len(each.names) == width), found[0])
    else:
        names = choose_names(found, head, sample, must=must)
    if default is not None and not (names.given or names.named):
        names.names = ["x", "y", "z", *default.get(width, ())]
    rows = Rows(layout.plain(data), head.start, head.line, layout, names.axes, _only(names, all_columns))
    table = read_table(rows, sample)
    points = np.stack([np.asarray(table.columns.pop(i), np.float64) for i in names.axes], axis=-1)
    if layout.decimal_comma and not layout.sure:
        notes.append("its commas were read as decimal points")
    notes += [*names.notes, *_check_count(counted, len(points))]
    if not (names.given or found or default):
        notes += _check_first_columns(sample)
    about: dict[str, Any] = {"header": names.header}
    attributes, about["names"], more = name_columns(table, names.names) if all_columns else ({}, {}, [])
    return Cloud(points, attributes, {"text": about, "notes": (*notes, *more)})


def _only(names: Names, all_columns: bool) -> list[int] | None:
    """Return the indices of the columns to read; None for all."""
    if not all_columns:
        return names.axes
    if names.given or names.rest:
        return [i for i, name in enumerate(names.names) if name]
    return None


def _without_other_lines(data: bytes, head: Preamble) -> tuple[bytes, int | None, int]:
    """Empty the lines that hold no point: comments, counts of points, and separators alone.

    Returns:
        The text; the number of points that its counts announce, None without any; and the number of lines that held
        separators alone.

    Raises:
        UserError: the first two lines have one integer each.
    """
    counted, blank, rest = None, 0, None
    if any(data.find(mark, head.start) >= 0 for mark in (b"#", b"//", b"%")):
        rest = COMMENT.sub(b"", data[head.start :])
    if head.count is not None:
        if COUNT.fullmatch(head.sample[0].encode()):
            raise UserError("its first lines hold one number each, and a point needs three: a PTX file is named .ptx")
        rest = data[head.start :] if rest is None else rest
        counted = head.count + sum(int(match[1]) for match in COUNT.finditer(rest))
        rest = COUNT.sub(b"", rest)
    if BLANK.search(data, head.start):
        rest, blank = BLANK.subn(b"", data[head.start :] if rest is None else rest)
    return data if rest is None else data[: head.start] + rest, counted, blank


def _check_first_columns(sample: Sequence[Sequence[str]]) -> list[str]:
    """Return a note if lines without names begin with integers ahead of three columns with decimals.

    They may be numbers of points, rows or columns.
    """
    whole = [all(INTEGER.fullmatch(word) for word in column) for column in zip(*sample, strict=False)]
    for count, axes in (
        (1, "column holds integers and was taken for x"),
        (2, "two columns hold integers and were taken for x and y"),
    ):
        if len(whole) >= count + 3 and all(whole[:count]) and not any(whole[count : count + 3]):
            skipped = "-," * count
            return [f"its first {axes}: if they number the points, name the columns by --columns {skipped}x,y,z,…"]
    return []


def _check_count(counted: int | None, count: int) -> list[str]:
    if counted is not None and counted > count:
        raise UserError(
            f"it is cut off: {count} of its {counted} points are there; if the file is whole, correct the line with "
            f"their number"
        )
    return [f"it counts {counted} points and holds {count}"] if counted is not None and counted < count else []


def write_xyz(cloud: Cloud) -> bytes:
    """Write numbers separated by spaces.

    Column names are written to the first line if the file that was read had them, or if names would be lost.
    """
    return _write(cloud, " ", cloud.about.get("text", {}).get("header", False))


def write_csv(cloud: Cloud) -> bytes:
    """Write numbers separated by commas.

    Column names are written to the first line, unless the file that was read had none and no name would be lost.
    """
    return _write(cloud, ",", cloud.about.get("text", {}).get("header", True))


def _write(cloud: Cloud, separator: str, header: bool) -> bytes:
    own = cloud.about.get("text", {}).get("names", {})
    columns = one_word_names({own.get(name, name): part for name, part in spread(cloud.columns, rest=True).items()})
    names = [*"xyz", *columns]
    header = header or any(name != f"c{i}" for i, name in enumerate(names[3:], 3))
    head = separator.join(names) + "\n" if header else ""
    table = [*cloud.points.T, *columns.values()]
    return (head + "".join(separator.join(row) + "\n" for row in zip(*map(words, table), strict=True))).encode()
