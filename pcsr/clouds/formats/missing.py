"""Numbers in text, with the spellings of what is not a number, of infinity and of missing values."""

import math
import re

MISSING = {
    *("", "na", "n/a", "#n/a", "<na>", "null", "<null>", "(null)", "none", "nil", "missing", "nodata", "no data"),
    *("-", "--", "---", "?", "*", ".", "\\n", "#nv", "#value!", "#wert!", "#num!", "#zahl!", "#div/0!", "#ref!"),
}
"""Spellings of missing values, in lower case; those with # are Excel's."""
NOT_FINITE = re.compile(r"([+-]?)(?:[qs]?nan[qs]?(?:\([^)]*\))?|inf|infinity|1[.,]#\w+(?:[+-]\d+)?)")
"""Number that is not finite, in lower case, in the spellings of C, Windows (1.#QNAN, -nan(ind)), Java and Python."""
FORTRAN = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))[dD]([+-]?\d+)")
"""Number of double precision in Fortran's notation."""


def number(word: str) -> float:
    """Return the value of a word; NaN for a missing value.

    Raises:
        ValueError: the word is no number.
    """
    try:
        if "_" not in word:
            return float(word)
    except ValueError:
        pass
    low = word.strip().lower()
    if low in MISSING:
        return math.nan
    if match := NOT_FINITE.fullmatch(low):
        return math.nan if "inf" not in low else -math.inf if match[1] == "-" else math.inf
    if match := FORTRAN.fullmatch(low):
        return float(f"{match[1]}e{match[2]}")
    raise ValueError(word)


def is_number(word: str) -> bool:
    """Return whether a word is a number or the spelling of one that is not finite or missing."""
    try:
        number(word)
    except ValueError:
        return False
    return True
