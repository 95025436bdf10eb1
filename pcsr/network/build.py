"""The builder of networks: from a recipe to a network with freshly initialised weights."""

import torch

from pcsr.contracts import Widths
from pcsr.errors import UserError
from pcsr.network.network import Network
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe


def build(recipe: Recipe, registry: Registry) -> Network:
    """The network of a recipe, with the weights that its seed gives.

    Raises:
        UserError: parts that don't fit together, such as a fusion that needs touch features without a
            `touch_encoder`.
    """
    parts = recipe.model
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(recipe.seed)
        encoder = parts.encoder.build(registry, "encoder", Widths(rate=recipe.network_rate))
        touch_encoder = (
            parts.touch_encoder.build(registry, "encoder", Widths(rate=recipe.network_rate))
            if parts.touch_encoder
            else None
        )
        widths = Widths(
            visual=encoder.channels,
            touch=touch_encoder.channels if touch_encoder else 3,
            rate=recipe.network_rate,
        )
        fusion = parts.fusion.build(registry, "fusion", widths)
        if touch_encoder is not None and not fusion.uses_touch_features:
            raise UserError(
                f"fusion '{parts.fusion.use}' uses no touch features, so model.touch_encoder would never be used: "
                f"remove it"
            )
        backbone = parts.backbone.build(registry, "backbone", widths)
        refined = Widths(widths.visual, widths.touch, backbone.channels, widths.rate)
        upsampler = parts.upsampler.build(registry, "upsampler", refined)
    return Network(encoder, touch_encoder, fusion, backbone, upsampler)
