"""Checks of STL files before trimesh reads them, which takes damaged ones for empty."""

import re

from pcsr.clouds.formats.digits import load_rows
from pcsr.errors import UserError

TRIANGLE, TRIANGLES = 50, 84
"""Size in bytes of a triangle of a binary file, and where the first one begins."""
LINE = re.compile(rb"^[ \t]*(facet|endfacet|solid|endsolid)\b", re.MULTILINE | re.IGNORECASE)
VERTEX = re.compile(rb"^[ \t]*vertex[ \t]+([^\r\n]*)", re.MULTILINE | re.IGNORECASE)


def checked(data: bytes) -> tuple[bytes, tuple[str, ...]]:
    """Check that an STL file is complete.

    Args:
        data: the file, in text or binary.

    Returns:
        The file without bytes after its last triangle, and a note on these.

    Raises:
        UserError: it is cut off, or a vertex of a text file is none.
    """
    claimed = int.from_bytes(data[TRIANGLES - 4 : TRIANGLES], "little")
    end = TRIANGLES + TRIANGLE * claimed
    if data[:512].lstrip()[:5].lower() == b"solid" and len(data) != end and b"\0" not in data:
        _check_text(data.replace(b"\r\n", b"\n").replace(b"\r", b"\n"))
        return data, ()
    if len(data) < TRIANGLES:
        raise UserError(f"it has {len(data)} bytes, and an STL file has {TRIANGLES} or more: it is cut off, or no STL")
    there = (len(data) - TRIANGLES) // TRIANGLE
    if there < claimed:
        raise UserError(f"it is cut off: {there} of its {claimed} triangles are there: get the file again")
    more = len(data) - end
    return data[:end], (f"it goes on for {more} bytes after its {claimed} triangles: these were left out",) * (more > 0)


def _check_text(data: bytes) -> None:
    words = [word.lower() for word in LINE.findall(data)]
    facets, ends = words.count(b"facet"), words.count(b"endfacet")
    if facets != ends or words.count(b"solid") != words.count(b"endsolid"):
        raise UserError(f"it is cut off or damaged: {min(facets, ends)} of its facets are complete: get the file again")
    if not facets:
        raise UserError("it holds no points")
    rows = load_rows(b"\n".join(VERTEX.findall(data)).decode("latin-1"))
    if rows.shape != (3 * facets, 3):
        raise UserError(f"its {facets} facets have {len(rows)} vertices, and 3 for each are needed: it is damaged")
