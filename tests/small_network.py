"""A small network with random weights."""

from pathlib import Path

from pcsr.network.build import build
from pcsr.network.network import Network
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import Recipe, load

SMOKE = Path(__file__).parents[1] / "pcsr/recipes/smoke.yaml"
# From `neighbours` the upsampler starts with weights of zero, which would hide what comes before it.
TINY = (
    "model.encoder.channels=16",
    "model.backbone.channels=[8, 16]",
    "model.upsampler={use: shuffle, hidden: 16, start: origin}",
)
NO_FUSION = ("model.fusion=none", "model.touch_encoder=null")
RATE, N = 4, 30


def recipe(*overrides: str) -> Recipe:
    (only,) = load(SMOKE, load_plugins(), [*TINY, *overrides])
    return only


def network(*overrides: str) -> Network:
    return build(recipe(*overrides), load_plugins()).eval()
