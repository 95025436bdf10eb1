"""The tactile parts of a graft: built for the width of a layer, and run once."""

import json
from collections.abc import Mapping
from typing import Any

import torch
from pydantic import ValidationError
from torch import Tensor

from pcsr.contracts import Encoder, Fusion, TouchBatch, Widths
from pcsr.errors import UserError
from pcsr.grafting.fuse import fuse
from pcsr.grafting.grafted import Grafted
from pcsr.grafting.observation import one_line, quiet
from pcsr.plugins.registry import Registry
from pcsr.recipe.schema import options_model
from pcsr.recipe.section import PartSpec
from pcsr.validation_messages import described


def build_parts(
    width: int,
    fusion: str | Mapping[str, Any] | Fusion,
    touch_encoder: str | Mapping[str, Any] | Encoder | None,
    registry: Registry,
) -> tuple[Fusion, Encoder | None, dict[str, Any]]:
    """Build fusion and touch encoder for a layer of `width` channels; returns them and their options."""
    if touch_encoder == "default":
        quarter = max(8, width // 4)
        touch_encoder = {"use": "unet", "channels": quarter + quarter % 2}  # a unet needs an even number of channels
    encoder, encoder_spec = None, None
    if touch_encoder is not None:
        encoder, encoder_spec = build_part("encoder", touch_encoder, Widths(), registry)
    widths = Widths(visual=width, touch=encoder.channels if encoder else 3)
    built, fusion_spec = build_part("fusion", fusion, widths, registry)
    if not built.uses_touch_features or type(built).join is not Fusion.join:
        raise UserError(
            f"fusion '{fusion_spec['use'] if isinstance(fusion_spec, dict) else type(built).__name__}' joins touched "
            f"points to the cloud, and a graft does not know which outputs of the network to thin afterwards: take a "
            f"fusion of features, or join them yourself: network(torch.cat([points, touches.flatten(1, 2)], 1))"
        )
    return built, encoder, {"fusion": fusion_spec, "touch_encoder": encoder_spec}


def build_part(kind: str, given: Any, widths: Widths, registry: Registry) -> tuple[Any, Any]:
    """Build a part; returns it and its name with all its options, or "instance"."""
    contract = {"encoder": Encoder, "fusion": Fusion}[kind]
    if isinstance(given, contract):
        return given, "instance"
    written = {"use": given} if isinstance(given, str) else dict(given) if isinstance(given, Mapping) else {}
    name = written.pop("use", None)
    if not isinstance(name, str):
        raise UserError(
            f"{kind} {one_line(given)}: give a name, {{'use': name, …options}} or a pcsr.{contract.__name__}"
        )
    try:
        model = options_model(registry.get(kind, name))
    except (TypeError, NameError) as error:
        raise UserError(f"the options of {kind} '{name}' cannot be read off its constructor: {error}") from error
    try:
        checked = model.model_validate_json(json.dumps(written))
    except TypeError as error:
        raise UserError(f"{kind} '{name}': JSON cannot represent its options: {error}") from error
    except ValidationError as error:
        owner, known = f"{kind} '{name}'", model.model_fields
        mistakes = [
            described([one], f"{owner}.{'.'.join(map(str, one['loc']))}", owner, known) for one in error.errors()
        ]
        raise UserError("; ".join(mistakes)) from error
    options = {key: getattr(checked, key) for key in model.model_fields}
    try:
        built = PartSpec(use=name, options=options).build(registry, kind, widths)
    except (RuntimeError, ValueError) as error:  # such as torch's, about a negative number of channels
        raise UserError(f"{kind} '{name}' cannot be built with {options}: {one_line(error)}") from error
    return built, {"use": name, **options}


def try_parts(grafted: Grafted, like: Tensor) -> None:
    """Run the parts once, so that wrong widths are reported here and not in training."""
    random = torch.Generator().manual_seed(0)
    cloud = torch.rand(1, 64, 3, generator=random).to(like)
    features = torch.rand(1, 64, grafted.injection_point.width, generator=random).to(like)
    with quiet(grafted, like.device):
        try:
            fused = fuse(grafted.fusion, grafted.touch_encoder, cloud, features, TouchBatch.of(cloud[:, None]))
            reason = f"it gives {tuple(fused.shape)} for {tuple(features.shape)}"
        except Exception as error:  # a layer of a wrong width may raise any error
            fused, reason = None, f"{type(error).__name__}: {one_line(error)}"
    if fused is None or fused.shape != features.shape:
        point = grafted.injection_point
        raise UserError(
            f"the fusion {type(grafted.fusion).__name__} does not fit layer '{point.at}' of {point.width} channels and "
            f"its touch encoder: {reason}. Make it for these widths or name it"
        )
