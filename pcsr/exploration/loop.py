"""Loop in simulation: touch a mesh, upsample with the touches so far, and measure the error."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from pcsr.contracts import TouchSource
from pcsr.data.sample import make_sample
from pcsr.extras import require
from pcsr.metrics.chamfer import chamfer
from pcsr.model import Model
from pcsr.plugins.registry import Registry
from pcsr.recipe import for_data


@dataclass(frozen=True)
class Setting:
    """What is touched, and how."""

    mesh: Path
    touches: int
    sensor: str
    object_size: str
    """Longest side of the object in mm, as YAML; "null" if the mesh is in mm."""
    points: int
    one_side: bool
    """Whether one camera sees the object, rather than random points of all sides."""
    tries: int
    seed: int


def errors_over_touches(
    setting: Setting, policies: Sequence[str], model: Model, registry: Registry, advance: Callable[[], None]
) -> dict[str, list[float]]:
    """Return for each policy the Chamfer distance in mm² after 0, 1, 2, … touches.

    Args:
        setting: object, cloud and sensor.
        policies: names of policies.
        model: upsamples the cloud to 16 times as many points, with the touches so far.
        registry: parts.
        advance: called after each upsampling.

    Raises:
        UserError: the mesh cannot be read or touched.
    """
    return {policy: _errors(setting, policy, model, registry, advance) for policy in policies}


def _errors(
    setting: Setting, policy: str, model: Model, registry: Registry, advance: Callable[[], None]
) -> list[float]:
    recipe = for_data(
        "meshes",
        {"folder": str(setting.mesh.parent)},
        registry,
        [
            f"sampling={'view' if setting.one_side else 'random'}",
            f"points={setting.points}",
            f"touch.sensor={setting.sensor}",
            f"touch.object_size={setting.object_size}",
            f"touch.policy={{use: {policy}, tries: {setting.tries}}}",
        ],
    )
    data = recipe.data
    require(data.touch.needs(registry, "touch"))
    source: TouchSource = data.touch.build(registry, "touch")
    item = data.shapes.build(registry, "shapes").item(setting.mesh.name)
    sample = make_sample(item, source, data, setting.touches, setting.seed)
    unit = source.touches(item, np.asarray(item.mesh.vertices), 1, setting.seed)[0].unit if setting.touches else 1.0
    radius = sample.sphere.radius * unit
    truth = torch.from_numpy(sample.truth)[None]
    errors = []
    for number in range(setting.touches + 1):
        touches = [touch.astype(np.float64) for touch in sample.touches[:number]]
        dense = model.upsample(sample.points.astype(np.float64), touches, rate=data.rate + 1)
        errors.append(float(chamfer(torch.from_numpy(dense).float()[None], truth)[0]) * radius**2)
        advance()
    return errors
