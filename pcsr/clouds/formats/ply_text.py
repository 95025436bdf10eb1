"""Elements of PLY files in text, with any spacing of the numbers and with lists that may differ in length."""

import numpy as np

from pcsr.clouds.formats import missing
from pcsr.clouds.formats.digits import check_lines, load_rows
from pcsr.clouds.formats.ply_header import Element, Header
from pcsr.errors import UserError


def read_text(data: bytes, header: Header, wanted: int) -> tuple[dict[str, np.ndarray], int]:
    """Read an element of a text file, in double precision, which represents every number of every PLY type.

    Lists of different lengths are left out.

    Args:
        data: the file.
        header: its header.
        wanted: index of the element.

    Returns:
        Properties by name, (n,) or (n, k), and the number of lines after the last element.

    Raises:
        UserError: the file is cut off, a word is no number, or rows have other numbers than the header says.
    """
    check_lines(data, header.end)
    text = data[header.end :].decode("latin-1")
    try:
        return _by_lines(text, header, wanted)
    except UserError as error:
        table = _by_words(text, header, wanted)
        if table is None:
            raise error from None
        return table, 0


def _by_lines(text: str, header: Header, wanted: int) -> tuple[dict[str, np.ndarray], int]:
    """Read a file that has a row of an element on each line.

    Raises:
        UserError: it has not, or is cut off.
    """
    for element in header.elements[:wanted]:
        text = _after(text, element)
    element = header.elements[wanted]
    # The size of the text bounds the memory, whatever the header claims.
    rows = load_rows(text, min(element.count, len(text) // 2 + 1))
    if len(rows) != element.count:
        raise UserError(f"it is cut off: {len(rows)} of its {element.count} points are there: get the file again")
    table, at, width = dict[str, np.ndarray](), 0, rows.shape[1]
    for each in element.properties:
        taken: int | slice = at
        if each.length:
            lengths = rows[:, at : at + 1]
            if (lengths != lengths[:1]).any():
                raise UserError(f"its vertices have lists '{each.name}' of different lengths on lines of equal length")
            length = float(lengths[0, 0]) if at < width else 0.0
            if not (length >= 0 and length.is_integer()):
                raise UserError(f"its vertices have lists '{each.name}' of {length:g} numbers, which is no length")
            taken = slice(at + 1, at + 1 + int(length) if at < width else width + 1)
        at = taken.stop if isinstance(taken, slice) else at + 1
        if at > width:
            raise UserError(f"its vertices have {width} numbers each, at least {at} are needed")
        table[each.name] = rows[:, taken]
    if at != width:
        raise UserError(f"its vertices have {width} numbers each, {at} are needed")
    last = not any(each.count for each in header.elements[wanted + 1 :])
    return table, max(0, sum(1 for line in text.splitlines() if line.strip()) - element.count) if last else 0


def _after(text: str, element: Element) -> str:
    """Return the text after an element that has a row on each line.

    Raises:
        UserError: a line has other numbers than the header says, or the text ends before.
    """
    at, lists = 0, any(each.length for each in element.properties)
    for number in range(element.count):
        line = ""
        while at < len(text) and not line.strip():
            end = _line_end(text, at)
            line, at = text[at:end], end
            if not element.properties:  # such rows are empty lines
                break
        words = line.split()
        if not words and element.properties:
            raise UserError(f"it is cut off among its {element.count} of '{element.name}': get the file again")
        if (_width(words, element) if lists else len(element.properties)) != len(words):
            raise UserError(f"row {number} of its '{element.name}' has other numbers than the header says")
    return text[at:]


def _line_end(text: str, at: int) -> int:
    end = text.find("\n", at)
    if end < 0 and "\r" in text[at:]:
        end = text.find("\r", at)
    return end + 1 if end >= 0 else len(text)


def _width(words: list[str], element: Element, at: int = 0) -> int:
    """Return the index of the first word after the row that begins at `at`; -1 if a list has no valid length."""
    for each in element.properties:
        if each.length:
            if at >= len(words) or not words[at].isdecimal() or len(words[at]) > 9:
                return -1
            at += int(words[at])
        at += 1
    return at


def _by_words(text: str, header: Header, wanted: int) -> dict[str, np.ndarray] | None:
    """Read a file whose line breaks have no meaning; None if it has not as many numbers as the header says.

    Raises:
        UserError: a word of a vertex is no number.
    """
    words = text.split()
    at, starts = 0, list[int]()
    for number, element in enumerate(header.elements):
        if not element.properties:
            continue
        if not any(each.length for each in element.properties):
            width = len(element.properties)
            if number == wanted and at + element.count * width <= len(words):
                starts = list(range(at, at + element.count * width, width))
            at += element.count * width
        else:
            for _ in range(element.count):
                if number == wanted:
                    starts.append(at)
                at = _width(words, element, at)
                if not 0 <= at <= len(words):
                    return None
    if at != len(words):
        return None
    return _table(words, header.elements[wanted], starts)


def _table(words: list[str], element: Element, starts: list[int]) -> dict[str, np.ndarray]:
    """Read the properties that are no lists of the rows that begin at the words `starts`."""
    table: dict[str, np.ndarray] = {}
    at = list(starts)
    for each in element.properties:
        if each.length:
            at = [index + 1 + int(words[index]) for index in at]
            continue
        column = np.zeros(len(at))
        for row, index in enumerate(at):
            try:
                column[row] = missing.number(words[index])
            except ValueError:
                raise UserError(f"'{each.name}' of point {row} is '{words[index][:40]}', which is no number") from None
        table[each.name] = column
        at = [index + 1 for index in at]
    return table
