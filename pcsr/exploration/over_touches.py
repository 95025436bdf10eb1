"""Error of the upsampled cloud over touches in simulation, policy by policy."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from pcsr.contracts import TouchSource
from pcsr.data.sample import make_sample
from pcsr.errors import PcsrWarning
from pcsr.exploration.loop import explore
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
    candidates: int
    seed: int


@dataclass(frozen=True)
class OverTouches:
    """What the touches of one policy did."""

    errors: list[float]
    """Chamfer distance in mm² after 0, 1, 2, … touches. It has fewer values if no pose was left."""
    failed: int
    """Poses at which the housing was in the way, or nothing was met."""


def errors_over_touches(
    setting: Setting, policies: Sequence[str], model: Model, registry: Registry, advance: Callable[[], None]
) -> dict[str, OverTouches]:
    """Touch a mesh at the poses of each policy, and measure the upsampled cloud after each touch.

    Args:
        setting: object, cloud and sensor.
        policies: names of policies.
        model: upsamples the cloud with the touches so far.
        registry: parts.
        advance: called after each touch.

    Raises:
        UserError: the mesh cannot be read or touched.
    """
    recipe = for_data(
        "meshes",
        {"folder": str(setting.mesh.parent)},
        registry,
        [
            f"sampling={'view' if setting.one_side else 'random'}",
            f"points={setting.points}",
            f"touch.sensor={setting.sensor}",
            f"touch.object_size={setting.object_size}",
        ],
    )
    data = recipe.data
    require(data.touch.needs(registry, "touch"))
    source: TouchSource = data.touch.build(registry, "touch")
    item = data.shapes.build(registry, "shapes").item(setting.mesh.name)
    sample = make_sample(item, source, data, 0, setting.seed)
    cloud = sample.sphere.denormalize(sample.points)
    truth = torch.from_numpy(sample.truth)[None]
    found = {}
    for name in policies:
        policy = registry.get("policy", name)()
        made = explore(
            item,
            source,
            cloud,
            policy,
            setting.touches,
            candidates=setting.candidates,
            seed=setting.seed,
            advance=advance,
        )
        touches = [sample.sphere.normalize(touch.points).astype(np.float64) for touch in made.touches]
        errors = []
        for number in range(len(touches) + 1):
            with warnings.catch_warnings():  # touches are exact: those beside the cloud are not misplaced
                warnings.simplefilter("ignore", PcsrWarning)
                dense = model.upsample(sample.points.astype(np.float64), touches[:number], rate=data.rate + 1)
            distance = float(chamfer(torch.from_numpy(dense).float()[None], truth)[0])
            errors.append(distance * (sample.sphere.radius * made.unit) ** 2)
        found[name] = OverTouches(errors, made.failed)
    return found
