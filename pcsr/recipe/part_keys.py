"""Keys of a recipe that name parts, and the name of a foreign network."""

import re
from typing import Any

from pcsr.recipe.source import Keys

PARTS: dict[Keys, str] = {
    ("data", "shapes"): "shapes",
    ("data", "touch"): "touch",
    ("model", "encoder"): "encoder",
    ("model", "touch_encoder"): "encoder",
    ("model", "fusion"): "fusion",
    ("model", "backbone"): "backbone",
    ("model", "upsampler"): "upsampler",
    ("model", "graft", "fusion"): "fusion",
    ("model", "graft", "touch_encoder"): "encoder",
    ("train", "objective"): "objective",
}
"""Keys at which a recipe names a part, with the part's kind. A bare name there is short for `{use: name}`."""
NAMES = {("evaluate", "metrics"): "metric", ("evaluate", "baselines"): "baseline"}
"""Keys of lists of parts without options, with the parts' kind."""
PART_LISTS: dict[Keys, str] = {("train", "loggers"): "logger"}
"""Keys of lists of parts with options, with the parts' kind."""
CHOICES: tuple[Keys, ...] = (("train", "optimizer"), ("train", "average"))
"""Keys at which a recipe names something else than a part, with options. A bare name is short for `{use: name}`."""
DATA, MODEL = (frozenset(keys for keys in PARTS if keys[0] == section) for section in ("data", "model"))
"""`DATA`: keys of the parts that building data needs. `MODEL`: keys of the network's parts, which inference needs."""
NETWORK_KEYS: Keys = ("model", "graft", "network")
"""Key at which a recipe names a foreign network."""
NETWORK = re.compile(r"[^/\\:]{1,200}\.py:[A-Za-z_]\w{0,99}")
"""Pattern of a network in a resolved recipe: the name of a Python file without its folder, and that of a class in it,
or of a function that returns the network."""


def owner_of(data: Any, keys: Keys) -> dict[str, Any] | None:
    """Return the mapping of a recipe that holds the last of some keys; None if there is none."""
    for key in keys[:-1]:
        data = data.get(key) if isinstance(data, dict) else None
    return data if isinstance(data, dict) else None


def is_graft(data: Any) -> bool:
    """Return whether the data of a recipe have a graft in place of the parts of a network."""
    model = data.get("model") if isinstance(data, dict) else None
    return isinstance(model, dict) and "graft" in model
