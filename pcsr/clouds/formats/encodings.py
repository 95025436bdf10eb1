"""Decoding of text files: UTF-8, UTF-16 and UTF-32 with or without a byte order mark, and Windows-1252."""

import codecs
import re

from pcsr.errors import UserError

MARKS = {
    codecs.BOM_UTF32_LE: "utf-32-le",
    codecs.BOM_UTF32_BE: "utf-32-be",
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
}
"""Byte order marks and the encodings that they announce; that of UTF-32 comes before that of UTF-16, which it begins
with."""
CONTROL = re.compile(rb"[\x00-\x08\x0e-\x19\x1b-\x1f\x7f]")
"""Control character that no text has."""
LIKE_ASCII = str.maketrans(
    {
        "\N{MINUS SIGN}": "-",
        "\N{NO-BREAK SPACE}": " ",
        "\N{NARROW NO-BREAK SPACE}": " ",
        "\N{ZERO WIDTH NO-BREAK SPACE}": "",
    }
)
"""Characters of typesetting that stand for those of plain numbers."""
THOUSANDS = re.compile(r"\d{1,3}(?:[\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}]\d{3})+(?!\d)")
"""Number with spaces between thousands, as French spreadsheets write it."""
SEPARATED = re.compile(r"\d[ \t;|]+[+-]?\d")
"""Two numbers between which there is no such space."""
HEAD = 1 << 12
"""Bytes by which binary files, and UTF-16 without a byte order mark, are recognised."""


def as_utf8(data: bytes) -> tuple[bytes, list[str]]:
    """Convert text to UTF-8 without a byte order mark, with lines that end in a newline.

    Returns:
        The text, which is `data` itself if there is nothing to convert; and notes on what was guessed.

    Raises:
        UserError: the file is binary, or cut off within a character.
    """
    encoding, start, notes = _encoding(data)
    if encoding != "ascii":
        text = _decoded(data[start:], encoding, start)
        grouped = THOUSANDS.search(text)
        separated = SEPARATED.search(text)
        text = text.translate(LIKE_ASCII)
        if grouped and separated:
            shown = grouped[0].translate(LIKE_ASCII)[:40]
            raise UserError(f"its numbers have separators of thousands, such as {shown}: write them without")
        data = text.encode("utf-8", "surrogatepass")
    if data.endswith(b"\x1a"):  # the end of a file in DOS
        data = data.rstrip(b"\x1a")
    control = CONTROL.search(data[:HEAD])
    at = control.start() if control else data.find(b"\0")
    if at >= 0:
        raise UserError(
            f"it is no text: byte {start + at} is 0x{data[at]:02x}; if it is a binary file, give it the suffix of its "
            f"format; otherwise it is damaged"
        )
    if b"\n" not in data and b"\r" in data:
        data = data.replace(b"\r", b"\n")
    return data, notes


def _encoding(data: bytes) -> tuple[str, int, list[str]]:
    """Return the encoding, the length of the byte order mark, and notes on what was guessed."""
    for mark, encoding in MARKS.items():
        if data.startswith(mark):
            return encoding, len(mark), []
    if data.isascii() and b"\0" not in data[:HEAD]:
        return "ascii", 0, []
    low, high = data[0:HEAD:2], data[1:HEAD:2]
    for encoding, zeros, others in (("utf-16-le", high, low), ("utf-16-be", low, high)):
        if zeros and zeros.count(0) > 0.9 * len(zeros) and others.count(0) == 0:
            return encoding, 0, [f"it has no byte order mark and was read as {encoding[:6].upper()}"]
    try:
        codecs.lookup("utf-8").decode(data)
    except UnicodeDecodeError:
        return "cp1252", 0, ["it is not UTF-8 and was read as Windows-1252 (Latin-1)"]
    return "utf-8", 0, []


def _decoded(data: bytes, encoding: str, start: int) -> str:
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding == "cp1252":  # five bytes have no character there
            return data.decode("latin-1")
        raise UserError(
            f"it begins as {encoding.upper()} text, and byte {start + error.start} is no character of it: it is "
            f"cut off or damaged"
        ) from error
