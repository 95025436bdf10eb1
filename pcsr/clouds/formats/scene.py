"""Check of a GLB file's scene before it is built. A few bytes can declare a billion instances of one mesh."""

import json
from typing import Any

from pcsr.errors import UserError
from pcsr.limits import LARGEST_JSON, check_inflated

NODES = 10**5
"""Most nodes of a scene."""
BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
"""Bytes of a number of an accessor, by its component type."""
NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Numbers of an item of an accessor, by its type."""


def check_scene(data: bytes) -> None:
    """Check that the scene of a GLB file is a tree, and not far larger than the file.

    Raises:
        UserError: it is not.
    """
    size = int.from_bytes(data[12:16], "little")
    if len(data) < 20 or data[16:20] != b"JSON" or len(data) < 20 + size:
        raise UserError("it cannot be read as a .glb file: it is cut off, or its first part is not its JSON")
    if size > LARGEST_JSON:
        raise UserError(f"its JSON has {size} bytes, and {LARGEST_JSON} are the most: simplify the scene")
    try:
        tree = json.loads(data[20 : 20 + size])
        nodes = tree.get("nodes", [])
        if any("sparse" in accessor for accessor in tree.get("accessors", [])) or tree.get("extensionsRequired"):
            wanted = ", ".join(map(str, tree.get("extensionsRequired", []))) or "sparse accessors"
            raise UserError(f"it needs {wanted[:80]}, which is not supported: export it without")
        sizes = [_size(accessor, len(data)) for accessor in tree.get("accessors", [])]
        meshes = [_of_mesh(mesh, sizes) for mesh in tree.get("meshes", [])]
        _check_tree(nodes)
        whole = sum(meshes[node["mesh"]] for node in nodes if "mesh" in node)
    except RecursionError as error:
        raise UserError("its JSON is nested too deeply") from error
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise UserError("its JSON does not describe a scene of glTF 2.0: it is damaged") from error
    check_inflated(len(data), whole)


def _check_tree(nodes: list[Any]) -> None:
    """Check that every node of a scene has at most one parent and is not its own ancestor."""
    if len(nodes) > NODES:
        raise UserError(f"its scene has {len(nodes)} nodes, and {NODES} are the most: simplify it")
    parent: dict[int, int] = {}
    for number, node in enumerate(nodes):
        for child in node.get("children", []):
            if not 0 <= child < len(nodes):
                raise ValueError(child)
            if child in parent:
                raise UserError(
                    f"node {child} of its scene has two parents, {parent[child]} and {number}: glTF allows one"
                )
            parent[child] = number
    reached = [number for number in range(len(nodes)) if number not in parent]
    for number in reached:
        reached += nodes[number].get("children", [])
    if len(reached) < len(nodes):
        lost = min(set(range(len(nodes))).difference(reached))
        raise UserError(f"node {lost} of its scene is an ancestor of itself, which glTF does not allow")


def _of_mesh(mesh: Any, sizes: list[int]) -> int:
    """Return the size in bytes of a mesh's vertices in double precision and faces in 64 bits."""
    whole = 0
    for primitive in mesh["primitives"]:
        used = [*primitive["attributes"].values(), *([primitive["indices"]] if "indices" in primitive else [])]
        whole += sum(sizes[index] for index in used)
    return whole


def _size(accessor: Any, most: int) -> int:
    """Return the size in bytes of an accessor's numbers in 64 bits.

    Args:
        accessor: the accessor.
        most: size of the file in bytes.

    Raises:
        UserError: the accessor is larger than the file.
    """
    count, numbers, each = accessor["count"], NUMBERS[accessor["type"]], BYTES[accessor["componentType"]]
    if not isinstance(count, int):
        raise TypeError(count)
    if count < 0 or (count * numbers * each > most and "bufferView" in accessor):
        raise UserError(f"an array of its meshes has {count} items, and the file has {most} bytes")
    return 8 * count * numbers
