"""Readers of OBJ, OFF, STL and GLB files as clouds of vertices with colours and normals."""

import logging
import re
import warnings
from io import BytesIO
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import COLOURS, NORMALS
from pcsr.clouds.formats import stl
from pcsr.clouds.formats.digits import check_lines, load_rows
from pcsr.clouds.formats.encodings import as_utf8
from pcsr.clouds.formats.scene import check_scene
from pcsr.errors import UserError

logging.getLogger("trimesh").addHandler(logging.NullHandler())  # otherwise its warnings are printed
MESHES = (".ply", ".obj", ".stl", ".off", ".glb")
"""Suffixes of mesh files."""
MEMORY = 11.0
"""Peak memory of reading a mesh, relative to the size of the file."""
VERTEX = re.compile(r"^[ \t]*v[ \t]+([^\r\n#]*(?:(?<=1\.)#[^\r\n#]*)*)", re.MULTILINE)
"""Numbers of a vertex, 1.#QNAN among them, ahead of a comment."""
NORMAL_OF_CORNER = re.compile(r"(?<=\s)(-?\d+)/\d*/(-?\d+)")
OFF_HEADER = re.compile(r"\s*(ST)?(C)?(N)?OFF\b(?!\s*BINARY)")


def read_obj(data: bytes) -> Cloud:
    """Read the vertices of an OBJ file with their colours, and normals if each vertex has one, in the same order.

    Vertices without a colour are black if others have one.
    """
    text = obj_text(data)
    rows, coloured = obj_vertices(text)
    columns = _named(COLOURS, rows[:, 3:]) if coloured.any() else {}
    notes = []
    if columns and not coloured.all():
        notes.append(f"{(~coloured).sum()} of {len(rows)} vertices have no colour and became black")
    normals = load_rows("\n".join(re.findall(r"^[ \t]*vn[ \t]+([^\r\n#]*)", text, re.MULTILINE)))
    # Faces may use different normals for one vertex, which then has none.
    own = all(vertex == normal for vertex, normal in NORMAL_OF_CORNER.findall(text))
    if normals.shape == (len(rows), 3) and own:
        columns |= _named(NORMALS, normals)
    return Cloud(np.ascontiguousarray(rows[:, :3]), columns, {"notes": tuple(notes)} if notes else {})


def obj_text(data: bytes) -> str:
    """Return the text of an OBJ file, with continued lines joined."""
    check_lines(data)
    return re.sub(r"\\\r?\n", " ", as_utf8(data)[0].decode("utf-8", "surrogatepass"))


def obj_vertices(text: str) -> tuple[Float[np.ndarray, "n c"], Bool[np.ndarray, " n"]]:
    """Return coordinates with colours, which are 0 where a vertex has none; and which vertices have one.

    Raises:
        UserError: there are no vertices, or one has neither 3 or 4 nor 6 or 7 numbers.
    """
    lines = VERTEX.findall(text)
    widths = np.fromiter((len(line.split()) for line in lines), np.int64, len(lines))
    if not widths.any():
        raise UserError("it holds no points")
    if len(odd := np.flatnonzero(~np.isin(widths, (3, 4, 6, 7)))):
        raise UserError(
            f"vertex {odd[0] + 1} has {widths[odd[0]]} numbers: 3 are needed, 6 or 7 with colours; it is cut off or "
            f"damaged"
        )
    coloured = widths > 4
    # Of four numbers the last is a weight. Alpha is read if all colours have it.
    channels = int(widths[coloured].min()) - 3 if coloured.any() else 0
    kept = 3 + channels
    if widths.min() != widths.max():
        black = ["0"] * channels
        lines = [
            " ".join(line.split()[:kept] if width > 4 else [*line.split()[:3], *black])
            for line, width in zip(lines, widths, strict=True)
        ]
    text = "\n".join(lines)
    lines.clear()  # saves a quarter of the memory
    return load_rows(text)[:, :kept], coloured


def read_off(data: bytes) -> Cloud:
    """Read the vertices of an OFF file, with the normals of NOFF and the colours of COFF."""
    check_lines(data)
    text = re.sub(r"(?<!1\.)#.*", "", as_utf8(data)[0].decode("utf-8", "surrogatepass"))
    header = OFF_HEADER.match(text)
    if not header:
        raise UserError("it does not begin with 'OFF', or is binary: convert it to text")
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
    """Read the vertices of an STL file. The format repeats a vertex for each face; duplicates are removed."""
    data, notes = stl.checked(data)
    cloud = _loaded(data, "stl")
    _, first = np.unique(cloud.points, axis=0, return_index=True)
    return Cloud(cloud.points[np.sort(first)], about={**cloud.about, "notes": notes})


def read_glb(data: bytes) -> Cloud:
    """Read the vertices of all meshes and clouds of a GLB scene, with the transforms of the scene."""
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
    return Cloud(np.concatenate(points), columns, {kind: {"coordinates": "f4"}})


def load_scene(data: bytes, kind: str) -> Any:
    """Return the `trimesh.Scene` in the bytes of a mesh file; `kind` is the suffix without the dot."""
    import trimesh

    if kind == "glb":
        check_scene(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of trimesh
        # From memory, so that no other file is opened; unprocessed, so that no vertex is merged or dropped.
        return trimesh.load_scene(BytesIO(data), file_type=kind, process=False, skip_materials=True)


def _columns(part: Any, pose: Float[np.ndarray, "3 3"]) -> dict[str, np.ndarray]:
    """Return the colours and normals of the file. Defaults that trimesh generates are left out."""
    columns: dict[str, np.ndarray] = {}
    n = len(part.vertices)
    visual = getattr(part, "visual", None)
    colours = np.asarray(visual.vertex_colors) if visual is not None and visual.kind == "vertex" else np.zeros(0)
    if colours.shape == (n, 4):
        columns |= _named(COLOURS, colours)
    cache = getattr(part, "_cache", None)
    if cache is not None and np.shape(cache.cache.get("vertex_normals")) == (n, 3):
        # Normals transform by the inverse transpose, so that they stay perpendicular in scaled scenes.
        normals = np.asarray(cache.cache["vertex_normals"], np.float64) @ np.linalg.inv(pose)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        columns |= _named(NORMALS, normals / np.where(length > 0, length, 1))
    return columns


def _named(names: tuple[str, ...], block: np.ndarray) -> dict[str, np.ndarray]:
    return {name: np.ascontiguousarray(part) for name, part in zip(names, block.T, strict=False)}
