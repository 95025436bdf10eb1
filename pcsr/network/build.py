"""Builder of networks: a recipe's network with initial weights."""

from pcsr.contracts import Widths
from pcsr.errors import UserError
from pcsr.grafting.from_recipe import build_graft
from pcsr.grafting.injection_point import InjectionPoint
from pcsr.network.kinds import AnyNetwork
from pcsr.network.network import Network
from pcsr.plugins.registry import Registry
from pcsr.random_state import seeded
from pcsr.recipe import Recipe
from pcsr.recipe.schema import GraftedModel


def build(recipe: Recipe, registry: Registry, point: InjectionPoint | None = None) -> AnyNetwork:
    """Build the network of a recipe, with initial weights determined by the recipe's seed.

    The random states of torch, numpy and Python are not changed.

    Args:
        recipe: recipe of the network.
        registry: installed parts.
        point: layer of a graft, if it is known; by default the network is run to find it.

    Raises:
        UserError: the parts do not fit together, such as a touch encoder and a fusion without touch features, or a
            foreign network cannot be built, run or grafted.
    """
    parts = recipe.model
    with seeded([recipe.seed]):
        if isinstance(parts, GraftedModel):
            return build_graft(recipe, parts.graft, registry, point)
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
