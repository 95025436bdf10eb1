"""Where a recipe names parts."""

from pcsr.recipe.source import Keys

PARTS: dict[Keys, str] = {
    ("data", "shapes"): "shapes",
    ("data", "touch"): "touch",
    ("model", "encoder"): "encoder",
    ("model", "touch_encoder"): "encoder",
    ("model", "fusion"): "fusion",
    ("model", "backbone"): "backbone",
    ("model", "upsampler"): "upsampler",
    ("train", "objective"): "objective",
}
"""The keys at which a recipe names a part, with the part's kind. A bare name is short for `{use: name}` there."""
NAMES = {("evaluate", "metrics"): "metric", ("evaluate", "baselines"): "baseline"}
"""The keys of lists of parts that take no options, with their kind."""
DATA, MODEL = (frozenset(keys for keys in PARTS if keys[0] == section) for section in ("data", "model"))
"""Keys of the parts that building data needs, and of the network's parts, which are all that inference needs."""
