"""Recognition of what separates the columns of a text file, and of decimal commas."""

import csv
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from pcsr.errors import UserError

COMMA = re.compile(r"[+-]?(?:\d*,\d+(?:[eEdD][+-]?\d+)?|1,#\w+(?:[+-]\d+)?)")
"""Number that may have a decimal comma, 1,#QNAN among them."""
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(?:,\d{3})+")
"""Number whose commas may separate thousands."""
BOTH = re.compile(r"[+-]?\d{1,3}(?:(?:\.\d{3})+,\d+|(?:,\d{3})+\.\d*)")
"""Number with separators of thousands and a decimal sign: 1.234,5 or 1,234.5."""
PLAIN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?")
"""Number without a comma."""
ANY_POINT = re.compile(rb"\d\.|\.\d")
"""Decimal point."""
WITH_POINT = re.compile(rb"(?<![^\s;|\"])([+-]?\d*\.\d+(?:[eE][+-]?\d+)?)(?![^\s;|\"])")
"""Field that is a number with a decimal point."""
DECIMAL_EVIDENCE = re.compile(rb",0\d|(?<![\d.,])[-+]0,\d|\d,\d+[eE][+-]?\d")
"""What decimal commas have and commas between columns rarely do: 0,05 and -0,5 and 1,5e-3."""
NO_COLUMN = re.compile(r"[-+]0|0\d+")
"""Integer as decimal commas leave it: -0 or 05."""
REMEDY = "write decimal points, or semicolons between columns"
NO_THOUSANDS = "write them without"


@dataclass(frozen=True)
class Layout:
    """Separator of columns and decimal sign of a text file."""

    separator: str | None
    """Character between columns; None for white space."""
    decimal_comma: bool = False
    """Whether a comma is the decimal sign."""
    commas_too: bool = False
    """Whether commas separate columns beside white space."""
    sure: bool = True
    """Whether the file allows no other reading."""

    def split(self, line: str) -> list[str]:
        """Return the words of a line, without quotes and outer spaces."""
        line = line.strip(" \r\n")
        if self.separator is None:
            line = line.replace(",", " ") if self.commas_too else line
            if '"' not in line:
                return line.split()
            return [word.strip('"').strip() for word in re.findall(r'"[^"]*"|[^\s"]+', line)]
        if '"' not in line:
            words = line.split(self.separator)
            return [word.strip() for word in words] if " " in line or "\t" in line else words
        return [word.strip() for word in next(csv.reader([line], delimiter=self.separator, skipinitialspace=True))]

    def plain(self, data: bytes) -> bytes:
        """Return the text with decimal points, and with white space where commas separate columns beside it."""
        if self.commas_too:
            return data.replace(b",", b" ")
        if not self.decimal_comma:
            return data
        if self.separator == ",":
            return re.sub(rb'"([^",\n]*),([^",\n]*)"', rb'"\1.\2"', data)
        return data.replace(b",", b".")


def find_layout(sample: Sequence[str], data: bytes, start: int, widths: Collection[int]) -> Layout:
    """Recognise separator and decimal sign.

    Args:
        sample: first lines with numbers.
        data: the whole text.
        start: index of the first line with numbers.
        widths: numbers of columns that names of columns, or the format, allow; none if any is.

    Raises:
        UserError: commas may be decimal signs, separate columns, or separate thousands.
    """
    bare = [re.sub(r'"[^"]*"', '""', line) for line in sample]
    for separator in (";", "|"):
        if all(separator in line for line in bare):
            if not _single(sample, separator):
                raise UserError(
                    f"'{separator}' and white space separate its columns, as in '{sample[0].strip()[:60]}': use one"
                )
            return _with_decimals(Layout(separator), sample, data, start)
    indented = all(line.startswith("\t") for line in bare)
    if not indented and all(line.strip(" \r\n").count("\t") >= 2 for line in bare) and _single(sample, "\t"):
        return _with_decimals(Layout("\t"), sample, data, start)
    if not any("," in line for line in bare):
        return (
            _with_decimals(Layout(None), sample, data, start) if any("," in line for line in sample) else Layout(None)
        )
    if all(line.count(",") >= 2 for line in bare) and _single(sample, ","):
        return _by_commas(sample, data, start, widths)
    return _by_white_space(bare, data, start, widths)


def _single(sample: Sequence[str], separator: str) -> bool:
    """Return whether no field between two separators holds several numbers."""
    layout = Layout(separator)
    for line in sample:
        for field in layout.split(line):
            words = field.split()
            if len(words) > 1 and all(PLAIN.fullmatch(word) or COMMA.fullmatch(word) for word in words):
                return False
    return True


def _with_decimals(layout: Layout, sample: Sequence[str], data: bytes, start: int) -> Layout:
    """Return a layout whose separator is known, with the decimal sign of its numbers."""
    words = [word for line in sample for word in layout.split(line)]
    commas = [word for word in words if COMMA.fullmatch(word)]
    for word in words:
        if "," in word and (BOTH.fullmatch(word) or (THOUSANDS.fullmatch(word) and not COMMA.fullmatch(word))):
            raise UserError(f"its numbers have separators of thousands, such as {word[:40]}: {NO_THOUSANDS}")
    if not commas:
        return layout
    if point := WITH_POINT.search(data, start):
        shown = point[1].decode("utf-8", "replace")[:40]
        raise UserError(f"it has decimal points and commas, {shown} and {commas[0][:40]}: {REMEDY}")
    if layout.separator != ";":
        _check_thousands(commas)
    return Layout(layout.separator, decimal_comma=True, sure=layout.separator == ";")


def _check_thousands(commas: Sequence[str]) -> None:
    if all(THOUSANDS.fullmatch(word) for word in commas):
        raise UserError(
            f"the commas in its numbers may be decimal commas or separate thousands, such as {commas[0][:40]}: {REMEDY}"
        )


def _by_commas(sample: Sequence[str], data: bytes, start: int, widths: Collection[int]) -> Layout:
    """Return the layout of lines whose commas separate columns, unless they look like decimal commas."""
    layout = Layout(",")
    rows = [layout.split(line) for line in sample]
    if any('"' in line for line in sample) and any("," in word for row in rows for word in row):
        return _with_decimals(layout, sample, data, start)
    if len(rows[0]) in widths or ANY_POINT.search(data, start):
        return layout
    split_in_two = any(2 * width == len(rows[0]) for width in widths)
    fragments = len(rows[0]) > 4 and any(NO_COLUMN.fullmatch(word) for row in rows for word in row)
    # Commas with and without a space in each line: "1,5, 2,5, 3,5".
    uneven = all(re.search(r"\d,\s+[+-]?\d", line) and re.search(r"\d,[+-]?\d", line) for line in sample)
    if split_in_two or fragments or uneven:
        raise UserError(
            f"it seems to have decimal commas and commas between columns, as in '{sample[0].strip()[:60]}': {REMEDY}"
        )
    return layout


def _by_white_space(sample: Sequence[str], data: bytes, start: int, widths: Collection[int]) -> Layout:
    """Return the layout of lines in which there are both commas and white space."""
    rows = [line.split() for line in sample]
    words = [word for row in rows for word in row if "," in word]
    if all(BOTH.fullmatch(word) for word in words):
        raise UserError(f"its numbers have separators of thousands, such as {words[0][:40]}: {NO_THOUSANDS}")
    if not all(COMMA.fullmatch(word) for word in words) or max(map(len, rows)) < 3:
        return _checked_mixture(words)
    shown = f"it may have decimal commas ({words[0][:40]} for {words[0][:40].replace(',', '.')})"
    if ANY_POINT.search(data, start):
        raise UserError(f"{shown}, and has decimal points too: {REMEDY}")
    _check_thousands(words)
    # Commas that separate columns are as many in each line.
    by_tokens = {len(row) for row in rows}
    by_commas = {line.count(",") for line in sample}
    others = {len(row) + line.count(",") for row, line in zip(rows, sample, strict=True)}
    fits = by_tokens <= set(widths) and not others & set(widths)
    sure = len(by_tokens) == 1 and (len(by_commas) > 1 or fits)
    if sure or DECIMAL_EVIDENCE.search(data, start):
        return Layout(None, decimal_comma=True, sure=False)
    raise UserError(f"{shown}, or commas and spaces between columns: {REMEDY}")


def _checked_mixture(words: Sequence[str]) -> Layout:
    for word in words:
        parts = word.strip(",").split(",")
        if word.endswith(",") and len(parts) == 2 and all(map(PLAIN.fullmatch, parts)) and "." not in word:
            raise UserError(f"it may have decimal commas and commas between columns, as in '{word[:40]}': {REMEDY}")
    return Layout(None, commas_too=True)
