"""Names of pcsr 0.1 and what they are called now."""

PARTS = {
    ("encoder", "frames"): "local-frames",
    ("fusion", "anchored"): "edge-conv",
    ("fusion", "inserted"): "joint-cloud",
    ("backbone", "frames"): "local-frames",
    ("upsampler", "fan"): "edge-offsets",
}
"""Parts by kind and old name. No other part may take these names: recipes and weights of 0.1 mean the renamed one."""
