"""Reader of the vertices of PLY files, in text and both binary byte orders; other elements are skipped."""

from collections.abc import Mapping

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import native
from pcsr.clouds.formats.digits import cast_column
from pcsr.clouds.formats.ply_binary import read_binary
from pcsr.clouds.formats.ply_header import TYPES, Element, parse, vertices
from pcsr.clouds.formats.ply_text import read_text
from pcsr.clouds.formats.splats import as_colours, is_splats
from pcsr.errors import UserError


def read(data: bytes) -> Cloud:
    """Read the vertices. Coordinates in text are read in double precision, whatever their declared type.

    Lists of vertices that differ in length are left out, with a note. Of Gaussian splats positions and colours are
    read.

    Raises:
        UserError: it is no PLY file, is cut off, or lacks a coordinate.
    """
    header = parse(data)
    wanted, notes = vertices(header)
    element = header.elements[wanted]
    if element.count == 0:
        raise UserError("it holds no points")
    if header.encoding == "ascii":
        table, lines = read_text(data, header, wanted)
        rest = f"{lines} lines" if lines else ""
    else:
        rows = read_binary(data, header, wanted)
        table, more = rows.table, len(data) - rows.end
        last = not any(each.count for each in header.elements[wanted + 1 :])
        rest = f"{more} bytes" if last and more * element.count >= rows.size else ""
    if rest:
        notes.append(f"it goes on for {rest} after its {element.count} points: these were left out")
    notes += [
        f"the lists '{each.name}' of its {element.count} points have different lengths and were left out"
        for each in element.properties
        if each.name not in table
    ]
    return vertex_cloud(table, header.encoding, header.comments, element, notes)


def vertex_cloud(
    table: Mapping[str, np.ndarray], encoding: str, comments: list[str], element: Element, notes: list[str]
) -> Cloud:
    """Return the cloud of a table of vertices.

    Args:
        table: properties by name, those that are kept.
        encoding: encoding of the file.
        comments: comments of its header.
        element: the vertices' element in the header.
        notes: sentences on what was left out.
    """
    kind = {each.name: each.type for each in element.properties}
    columns = {
        name: native(cast_column(column, np.dtype(TYPES[kind[name]]), name))
        for name, column in table.items()
        if name not in ("x", "y", "z")
    }
    if is_splats(set(columns)):
        columns, note = as_colours(columns)
        notes = [*notes, note]
    points = np.stack([np.asarray(table[axis], np.float64) for axis in "xyz"], axis=-1)
    single = all(kind[axis] == "float" for axis in "xyz")
    about = {
        "encoding": encoding,
        "comments": comments,
        "coordinates": "float" if single else "double" if kind["x"] == "float" else kind["x"],
    }
    return Cloud(points, columns, {"ply": about, "notes": tuple(notes)})
