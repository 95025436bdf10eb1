"""Checks of mesh files before trimesh reads them, which would skip or guess what is damaged."""

import re
from collections.abc import Callable

from pcsr.clouds.formats import stl
from pcsr.clouds.formats.mesh import obj_text, obj_vertices, read_off
from pcsr.clouds.formats.ply_header import parse
from pcsr.errors import UserError

FACE = re.compile(r"^[ \t]*f[ \t]+([^\r\n#]*)", re.MULTILINE)
CORNER = re.compile(r"[+-]?\d+(/[+-]?\d*){0,2}")
"""Corner of a face of an OBJ: the numbers of its vertex, texture coordinate and normal."""
LONGEST = 20
"""Most digits of the number of a vertex."""
ZERO = re.compile(r"^[ \t]*f[ \t](?:[^\r\n#]*[ \t])?[+-]?0+(?=[/ \t\r\n]|$)", re.MULTILINE)
"""Face of an OBJ up to a corner at vertex 0."""


def check_mesh(data: bytes, suffix: str) -> None:
    """Check the parts of a mesh file that trimesh takes as they are.

    Raises:
        UserError: vertices or faces are missing, or a face of an OBJ is none.
    """
    check: Callable[[bytes], object] | None = {
        ".obj": _check_obj,
        ".off": _check_off,
        ".ply": _check_ply,
        ".stl": stl.checked,
    }.get(suffix)
    if check is not None:
        check(data)


def fault(data: bytes, suffix: str) -> str:
    """Return the reason why trimesh cannot read a mesh file; a general one if the cause is not found."""
    if suffix == ".obj":
        text = obj_text(data)
        count = len(obj_vertices(text)[0])
        for face in FACE.finditer(text):
            for word in face[1].split():
                vertex = word.partition("/")[0]
                if not CORNER.fullmatch(word):
                    wrong = f"has the corner '{word[:40]}', which is no number"
                elif len(vertex) > LONGEST or not 0 < abs(int(vertex)) <= count:
                    wrong = f"names vertex {vertex[:LONGEST]}, and there are {count}"
                else:
                    continue
                return f"line {_line(text, face.end())}: a face {wrong}"
    return f"it is damaged, or not a {suffix} file: get the file again, or save it anew"


def _check_obj(data: bytes) -> None:
    text = obj_text(data)
    obj_vertices(text)
    if zero := ZERO.search(text):
        raise UserError(f"line {_line(text, zero.end())}: a face names vertex 0, and an OBJ counts vertices from 1")


def _check_off(data: bytes) -> None:
    read_off(data)
    lines = [line for line in re.sub(rb"#.*", b"", data).splitlines() if line.strip()]
    counts = lines[0].split()[1:] or lines[1].split()
    vertices, faces = int(counts[0]), int(counts[1])
    there = len(lines) - (1 if len(lines[0].split()) > 1 else 2) - vertices
    if there < faces:
        raise UserError(f"it is cut off: {there} of its {faces} faces are there: get the file again")


def _check_ply(data: bytes) -> None:
    header = parse(data)
    rows = sum(each.count for each in header.elements if each.properties)
    there = sum(1 for line in data[header.end :].splitlines() if line.strip()) if header.encoding == "ascii" else rows
    if there < rows:
        raise UserError(f"it is cut off: {there} of its {rows} lines are there: get the file again")


def _line(text: str, at: int) -> int:
    return text.count("\n", 0, at) + 1
