"""GLB's scene, looked at before it is built: a few bytes may say that one mesh stands in it a billion times."""

import json
from typing import Any

from pcsr.errors import UserError
from pcsr.limits import LARGEST_JSON, check_inflated

NODES = 10**5
"""Nodes of the largest scene."""
BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
"""Of the numbers of an accessor, by their type."""
NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Of each item of an accessor, by its kind."""


def check_scene(data: bytes) -> None:
    """Refuse a GLB whose scene is no tree, or far larger than its file.

    Raises:
        UserError: it is.
    """
    size = int.from_bytes(data[12:16], "little")
    if len(data) < 20 or data[16:20] != b"JSON" or len(data) < 20 + size:
        raise UserError("it cannot be read as a .glb file: it is cut off, or its first part is not its JSON")
    if size > LARGEST_JSON:
        raise UserError(f"its JSON has {size} bytes, and {LARGEST_JSON} are the most")
    try:
        tree = json.loads(data[20 : 20 + size])
        nodes = tree.get("nodes", [])
        if any("sparse" in accessor for accessor in tree.get("accessors", [])) or tree.get("extensionsRequired"):
            wanted = ", ".join(map(str, tree.get("extensionsRequired", []))) or "sparse accessors"
            raise UserError(f"it needs {wanted[:80]}, which is not read: export it without")
        sizes = [_size(accessor, len(data)) for accessor in tree.get("accessors", [])]
        meshes = [_of_mesh(mesh, sizes) for mesh in tree.get("meshes", [])]
        _check_tree(nodes)
        whole = sum(meshes[node["mesh"]] for node in nodes if "mesh" in node)
    except RecursionError as error:
        raise UserError("its JSON is nested too deeply") from error
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise UserError("its JSON does not describe a scene as glTF 2.0 has it: it is damaged") from error
    check_inflated(len(data), whole)


def _check_tree(nodes: list[Any]) -> None:
    """Refuse a scene in which a node has two parents, or is its own ancestor."""
    if len(nodes) > NODES:
        raise UserError(f"its scene has {len(nodes)} nodes, and {NODES} are the most")
    parent: dict[int, int] = {}
    for number, node in enumerate(nodes):
        for child in node.get("children", []):
            if not 0 <= child < len(nodes):
                raise ValueError(child)
            if child in parent:
                raise UserError(
                    f"node {child} of its scene has two parents, {parent[child]} and {number}: glTF has none"
                )
            parent[child] = number
    reached = [number for number in range(len(nodes)) if number not in parent]
    for number in reached:
        reached += nodes[number].get("children", [])
    if len(reached) < len(nodes):
        lost = min(set(range(len(nodes))).difference(reached))
        raise UserError(f"node {lost} of its scene is an ancestor of itself: glTF has none such")


def _of_mesh(mesh: Any, sizes: list[int]) -> int:
    """Bytes of a mesh's vertices and faces, as doubles and indices of 64 bits."""
    whole = 0
    for primitive in mesh["primitives"]:
        used = [*primitive["attributes"].values(), *([primitive["indices"]] if "indices" in primitive else [])]
        whole += sum(sizes[index] for index in used)
    return whole


def _size(accessor: Any, most: int) -> int:
    """Bytes that an accessor becomes; refuses one that claims more than its file has."""
    count, numbers, each = accessor["count"], NUMBERS[accessor["type"]], BYTES[accessor["componentType"]]
    if not isinstance(count, int):
        raise TypeError(count)
    if count < 0 or (count * numbers * each > most and "bufferView" in accessor):
        raise UserError(f"an array of its meshes has {count} items, and the file has {most} bytes")
    return 8 * count * numbers
