"""Beginning of a text file: comments, titles, names of columns and the number of points, ahead of the numbers."""

import re
from dataclasses import dataclass, field

from pcsr.clouds.formats.missing import MISSING, is_number
from pcsr.errors import UserError

COMMENT_MARKS = ("#", "//", "%")
"""Beginnings of a line that is a comment."""
COMMENT = re.compile(rb"^[ \t]*(?:#|//|%).*$|[ \t]#[ \t].*$", re.MULTILINE)
"""Line that is a comment, or the end of a line that is one."""
COUNT = re.compile(rb"^[ \t]*(\d{1,18})[ \t]*\r?$", re.MULTILINE)
"""Line with one integer, the number of points that follow."""
BLANK = re.compile(rb"^[ \t]*+[;,|][ \t;,|]*+\r?$", re.MULTILINE)
"""Line with separators alone, as spreadsheets write empty rows."""
EXCEL = re.compile(r'"?sep=.{1,2}"?[;,\t]*', re.IGNORECASE)
"""Line that sets the separator for Excel."""
OFF = re.compile(r"(?:ST)?C?N?OFF\s*")
"""First line of an OFF mesh."""
MOST_LINES = 1000
"""Most lines ahead of the numbers."""
BETWEEN = re.compile(r"[\s,;|]+")
"""What may separate columns."""
SAMPLE = 200
"""Number of lines by which the layout of a file is recognised."""
LINE = re.compile(rb"[^\n]*\n?")


@dataclass
class Preamble:
    """What stands ahead of the numbers of a text file, and the first lines with numbers."""

    start: int = 0
    """Index of the first byte of the first line with numbers."""
    line: int = 1
    """Number of that line."""
    comments: list[str] = field(default_factory=list)
    """Comments ahead of the numbers."""
    titles: list[str] = field(default_factory=list)
    """Lines that are neither comments nor numbers."""
    count: int | None = None
    """Number of points that stands on a line of its own."""
    sample: list[str] = field(default_factory=list)
    """First lines with numbers."""


def read_preamble(data: bytes) -> Preamble:
    """Read the lines ahead of the numbers, and the first lines with numbers.

    Raises:
        UserError: no line has numbers, or the first that has comes after `MOST_LINES` others.
    """
    found = Preamble()
    for number, match in enumerate(LINE.finditer(data), 1):
        if match.start() == len(data):
            break
        line = match[0].decode("utf-8", "replace").strip(" \r\n")
        if not line.strip(" \t;,|") or EXCEL.fullmatch(line):
            continue
        if line.lstrip().startswith(COMMENT_MARKS):
            found.comments += [] if found.sample else [line]
        elif found.sample:
            found.sample.append(line)
            if len(found.sample) == SAMPLE:
                break
        elif found.count is None and COUNT.fullmatch(line.strip().encode()):
            found.count = int(line)
        elif _has_numbers(line):
            found.start, found.line, found.sample = match.start(), number, [line]
        else:
            found.titles.append(line)
            if len(found.titles) == 1 and OFF.fullmatch(line):
                raise UserError("it is an OFF mesh: name it .off")
            if len(found.titles) == 1 and line.lower().startswith("ncols"):
                raise UserError(
                    "it is an ESRI grid, a map of heights without points: convert it, by gdal_translate -of XYZ"
                )
        if number > MOST_LINES and not found.sample:
            raise UserError(f"its first {MOST_LINES} lines hold no points: remove what stands ahead of the numbers")
    if not found.sample:
        shown = f"; its last line is '{found.titles[-1].strip()[:60]}'" if found.titles else ""
        raise UserError(f"it holds no points: no line has numbers for x, y and z, such as 0.5 1.5 2.5{shown}")
    return found


def _has_numbers(line: str) -> bool:
    """Return whether a line holds a point: its first word is a number, or three words are."""
    words = [word.strip('"') for word in BETWEEN.split(line)]
    if {"x", "y", "z"} <= {word.lower() for word in words}:
        return False
    filled = [word for word in words if word]
    first = bool(filled) and is_number(filled[0]) and filled[0].lower() not in MISSING
    return first or sum(map(is_number, filled)) >= 3
