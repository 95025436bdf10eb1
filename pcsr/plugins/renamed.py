"""Names of pcsr 0.1 with their new names, for the error messages of plugins that still use the old ones."""

import ast
import inspect
from collections.abc import Iterable, Iterator
from pathlib import Path

from pcsr.errors import UserError

PARTS = {
    ("encoder", "frames"): "local-frames",
    ("fusion", "anchored"): "edge-conv",
    ("fusion", "inserted"): "joint-cloud",
    ("backbone", "frames"): "local-frames",
    ("upsampler", "fan"): "edge-offsets",
}
"""Renamed parts: kind and old name to new name. The old names stay reserved: recipes and weights of 0.1 use them."""
PUBLIC = {
    "Item": "ShapeItem",
    "Shapes": "ShapeSource",
    "Touches": "TouchBatch",
    "Upsampling": "UpsamplingNetwork",
}
"""Renamed public names of the package `pcsr`."""
MEMBERS = {
    "Trait.POINT_ORDER_FREE": "Trait.PERMUTATION_EQUIVARIANT",
    "Trait.TOUCH_ORDER_FREE": "Trait.TOUCH_PERMUTATION_INVARIANT",
    "Touch.of_one_finger": "Touch.single",
    "Touch.of_fingers": "Touch.grasp",
}
"""Renamed members of public classes, as they are written in code: `Class.member`."""
OURS = ("pcsr", "pcsr_plugins", "torch", "builtins", "typing", "abc")
"""Packages whose classes have today's names."""
METHODS = {"thinned": "Touch.resampled"}
"""Renamed methods, which are found by their name alone."""
RAY_METHODS = {"places": "MeshRays.surface_points"}
"""Renamed methods in files that import `pcsr.geometry.rays`."""
ATTRIBUTES = {
    "places": "path_options",
    "hears_features": "uses_touch_features",
    "anchors": "keeps_touched_points",
    "at_once": "max_rate_per_pass",
    "pace": "lr_multiplier",
}
"""Renamed class attributes of parts."""
SIGNATURES = {
    "join": "join(points, touches)",
    "losses": "losses(network, points, truth, rate, touches)",
}
"""Methods of parts that had a parameter `mask`, which is now a field of `touches`, with their new signatures."""


def check_class(part: type) -> None:
    """Check that a part's class uses no names of pcsr 0.1, which would be ignored silently.

    Raises:
        UserError: the class sets a renamed attribute, or overrides a method with its old parameters.
    """
    foreign = [one for one in part.__mro__ if one.__module__.partition(".")[0] not in OURS]
    own = {name: value for one in reversed(foreign) for name, value in vars(one).items()}
    found = [_changed(old, new) for old, new in ATTRIBUTES.items() if old in own and not callable(own[old])]
    for name, new in SIGNATURES.items():
        method = own.get(name)
        if inspect.isfunction(method) and "mask" in inspect.signature(method).parameters:
            found.append(_changed(f"{name}(…, mask)", new))
    if found:
        raise UserError(f"{part.__name__} was written for pcsr 0.1: {'; '.join(found)}")


def old_names(files: Iterable[Path]) -> str:
    """Describe the names of pcsr 0.1 that Python files use, with their new names; empty text if they use none."""
    found: dict[str, None] = {}
    for file in files:
        try:
            tree = ast.parse(file.read_bytes())
        except (OSError, SyntaxError, ValueError):
            continue
        found |= dict.fromkeys(_changed(old, new) for old, new in _in_tree(tree))
    return f"it was written for pcsr 0.1, whose names have changed: {'; '.join(found)}" if found else ""


def _in_tree(tree: ast.AST) -> Iterator[tuple[str, str]]:
    imported = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    methods = METHODS | (RAY_METHODS if "pcsr.geometry.rays" in imported else {})
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module in ("pcsr", "pcsr.contracts"):
            yield from ((alias.name, PUBLIC[alias.name]) for alias in node.names if alias.name in PUBLIC)
        elif isinstance(node, ast.Attribute):
            dotted = ast.unparse(node)
            names = {f"pcsr.{old}": f"pcsr.{new}" for old, new in (PUBLIC | MEMBERS).items()} | MEMBERS
            if dotted in names:
                yield dotted, names[dotted]
            elif node.attr in methods:
                yield f".{node.attr}", methods[node.attr]
        elif isinstance(node, ast.ClassDef):
            yield from _in_class(node)


def _in_class(node: ast.ClassDef) -> Iterator[tuple[str, str]]:
    for statement in node.body:
        targets = statement.targets if isinstance(statement, ast.Assign) else [getattr(statement, "target", None)]
        for target in targets:
            if isinstance(target, ast.Name) and target.id in ATTRIBUTES:
                yield target.id, ATTRIBUTES[target.id]
        if isinstance(statement, ast.FunctionDef) and statement.name in SIGNATURES and _takes_mask(statement):
            yield f"{statement.name}(…, mask)", SIGNATURES[statement.name]


def _takes_mask(function: ast.FunctionDef) -> bool:
    return any(argument.arg == "mask" for argument in function.args.args)


def _changed(old: str, new: str) -> str:
    return f"{old} is now {new}"
