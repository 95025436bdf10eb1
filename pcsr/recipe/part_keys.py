"""Keys of a recipe that name parts."""

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
"""Keys at which a recipe names a part, with the part's kind. A bare name there is short for `{use: name}`."""
NAMES = {("evaluate", "metrics"): "metric", ("evaluate", "baselines"): "baseline"}
"""Keys of lists of parts without options, with the parts' kind."""
PART_LISTS: dict[Keys, str] = {("train", "loggers"): "logger"}
"""Keys of lists of parts with options, with the parts' kind."""
CHOICES: tuple[Keys, ...] = (("train", "optimizer"), ("train", "average"))
"""Keys at which a recipe names something else than a part, with options. A bare name is short for `{use: name}`."""
DATA, MODEL = (frozenset(keys for keys in PARTS if keys[0] == section) for section in ("data", "model"))
"""`DATA`: keys of the parts that building data needs. `MODEL`: keys of the network's parts, which inference needs."""
