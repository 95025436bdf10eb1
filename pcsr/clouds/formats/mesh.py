"""Meshes as clouds: the vertices of OBJ, OFF, STL and GLB, with their colours and normals."""

import logging
import re
import warnings
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import COLOURS, NORMALS, spread
from pcsr.clouds.formats.digits import check_lines, load_rows, words
from pcsr.clouds.formats.scene import check_scene
from pcsr.errors import UserError

if TYPE_CHECKING:
    pass

logging.getLogger("trimesh").addHandler(logging.NullHandler())  # else what it finds odd goes to the terminal
MESHES = (".ply", ".obj", ".stl", ".off", ".glb")
"""Kinds of files that meshes are read from."""
MEMORY = 11.0
"""What reading a mesh takes at its peak, in sizes of the file."""
NORMAL_OF_CORNER = re.compile(r"(?<=\s)(-?\d+)/\d*/(-?\d+)")
OFF_HEADER = re.compile(r"\s*(ST)?(C)?(N)?OFF\b(?!\s*BINARY)")


def read_obj(data: bytes) -> Cloud:
    """The lines `v`, with colours as they stand; normals where there is one for each vertex, in the same order."""
    check_lines(data)
    text = data.decode("utf-8-sig", "surrogateescape")
    rows = load_rows("\n".join(re.findall(r"^[ \t]*v[ \t]+([^\r\n#]*)", text, re.MULTILINE)))
    if not len(rows):
        raise UserError("it holds no points")
    if rows.shape[1] not in (3, 4, 6, 7):
        raise UserError(f"its vertices have {rows.shape[1]} numbers each: 3 are needed, 6 or 7 with colours")
    columns = _named(COLOURS, rows[:, 3:]) if rows.shape[1] > 4 else {}  # a fourth of four is a weight
    normals = load_rows("\n".join(re.findall(r"^[ \t]*vn[ \t]+([^\r\n#]*)", text, re.MULTILINE)))
    # Faces may give a vertex one normal here and another there: then it has none of its own.
    own = all(vertex == normal for vertex, normal in NORMAL_OF_CORNER.findall(text))
    if normals.shape == (len(rows), 3) and own:
        columns |= _named(NORMALS, normals)
    return Cloud(np.ascontiguousarray(rows[:, :3]), columns)


def read_off(data: bytes) -> Cloud:
    """The vertices, with the normals of NOFF and the colours of COFF."""
    check_lines(data)
    text = re.sub(r"#.*", "", data.decode("utf-8-sig"))
    header = OFF_HEADER.match(text)
    if not header:
        raise UserError("it does not begin with 'OFF', or is a binary one: convert it to text")
    counts = re.compile(r"\s*(\d+)[ \t]+(\d+)(?:[ \t]+\d+)?[ \t]*(?:\r?\n|$)").match(text, header.end())
    if not counts:
        raise UserError("its second line must be the numbers of vertices, faces and edges")
    count = int(counts[1])
    if not count:
        raise UserError("it holds no points")
    rows = load_rows(text[counts.end() :], count)
    if len(rows) != count:
        raise UserError(f"it is cut off: {len(rows)} of its {count} points are there")
    needed = 6 if header[3] else 3
    if rows.shape[1] < needed:
        raise UserError(f"its vertices have {rows.shape[1]} numbers each, at least {needed} are needed")
    columns = _named(NORMALS, rows[:, 3:6]) if header[3] else {}
    if header[2] and rows.shape[1] - needed in (3, 4):
        colours = rows[:, needed:]
        whole = bool(((colours >= 0) & (colours < 256) & (colours == np.rint(colours))).all()) and colours.max() > 1
        columns |= _named(COLOURS, colours.astype(np.uint8) if whole else colours)
    return Cloud(np.ascontiguousarray(rows[:, :3]), columns)


def read_stl(data: bytes) -> Cloud:
    """The corners of the triangles, each once: STL repeats them for every face."""
    cloud = _loaded(data, "stl")
    _, first = np.unique(cloud.points, axis=0, return_index=True)
    return Cloud(cloud.points[np.sort(first)])


def read_glb(data: bytes) -> Cloud:
    """The vertices of all meshes and clouds of a scene, each in its place."""
    return _loaded(data, "glb")


def _loaded(data: bytes, kind: str) -> Cloud:
    scene = load_scene(data, kind)
    points, found = [], []
    for node in scene.graph.nodes_geometry:
        pose, name = scene.graph[node]
        part = scene.geometry[name]
        if len(getattr(part, "vertices", ())):
            points.append(np.asarray(part.vertices, np.float64) @ pose[:3, :3].T + pose[:3, 3])
            found.append(_columns(part, pose[:3, :3]))
    if not points:
        raise UserError("it holds no points")
    common = [name for name in found[0] if all(name in each for each in found)]
    columns = {name: np.concatenate([each[name] for each in found]) for name in common}
    return Cloud(np.concatenate(points), columns)


def load_scene(data: bytes, kind: str) -> Any:
    """The `trimesh.Scene` in the bytes of a mesh file; `kind` is its suffix without the dot."""
    import trimesh

    if kind == "glb":
        check_scene(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what trimesh finds odd
        # From memory, so that no file beside it is looked for; unprocessed, so that no vertex is merged or dropped.
        return trimesh.load_scene(BytesIO(data), file_type=kind, process=False, skip_materials=True)


def _columns(part: Any, pose: Float[np.ndarray, "3 3"]) -> dict[str, np.ndarray]:
    """The colours and normals that the file has: trimesh makes up both where there are none."""
    columns: dict[str, np.ndarray] = {}
    n = len(part.vertices)
    visual = getattr(part, "visual", None)
    colours = np.asarray(visual.vertex_colors) if visual is not None and visual.kind == "vertex" else np.zeros(0)
    if colours.shape == (n, 4):
        columns |= _named(COLOURS, colours)
    cache = getattr(part, "_cache", None)
    if cache is not None and np.shape(cache.cache.get("vertex_normals")) == (n, 3):
        # Where a scene is stretched normals are not: they stay upright on their surface.
        normals = np.asarray(cache.cache["vertex_normals"], np.float64) @ np.linalg.inv(pose)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        columns |= _named(NORMALS, normals / np.where(length > 0, length, 1))
    return columns


def _named(names: tuple[str, ...], block: np.ndarray) -> dict[str, np.ndarray]:
    return {name: np.ascontiguousarray(part) for name, part in zip(names, block.T, strict=False)}


def write_obj(cloud: Cloud) -> bytes:
    """Vertices, with colours from 0 to 1 and normals; there are no faces.

    Raises:
        UserError: there are other columns, which an OBJ does not hold.
    """
    columns = spread(cloud.columns, rest=True)
    colours = [columns.pop(name) for name in COLOURS if name in columns]
    normals = [columns.pop(name) for name in NORMALS if name in columns]
    if columns or len(normals) not in (0, 3) or len(colours) not in (0, 3, 4):
        raise UserError(
            f"an .obj holds whole colours and normals beside the points, no columns {', '.join(columns) or 'else'}: "
            "write a .ply"
        )
    shares = [each / np.iinfo(each.dtype).max if each.dtype.kind in "iu" else each for each in colours]
    lines = ["v " + " ".join(row) + "\n" for row in zip(*map(words, [*cloud.points.T, *shares]), strict=True)]
    if normals:
        lines += ["vn " + " ".join(row) + "\n" for row in zip(*map(words, normals), strict=True)]
    return "".join(lines).encode()
