"""Poses at which the next touches are expected to lower the error of an upsampled cloud most."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pcsr.clouds.convert import convert
from pcsr.clouds.faults import Bad, ScreenedCloud, screen
from pcsr.clouds.touch import Touch
from pcsr.contracts import Fingertip, Policy
from pcsr.errors import UserError
from pcsr.exploration.choosing import NextTouches, choose
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Registry
from pcsr.recorded.fields import UNITS
from pcsr.touches import GivenTouches, TouchesLike

CANDIDATES = 160
"""Points of the surface at which candidates are drawn by default."""
LONGEST = 100_000.0
"""Length in mm above which a cloud is hardly touched by a fingertip: it must be in another unit."""


def next_touches(
    cloud: Any,
    touches: TouchesLike = (),
    *,
    count: int = 5,
    sensor: str | Fingertip = "digit",
    policy: str | Policy = "expected-error",
    camera: Sequence[float] | None = None,
    all_around: bool = False,
    unit: str | float | None = None,
    candidates: int = CANDIDATES,
    seed: int = 0,
    bad: Bad = "refuse",
    touch_as_is: bool = False,
    plugins: Sequence[str | Path] = (),
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> NextTouches:
    """Find the poses at which the next touches lower the error of the upsampled cloud most, the best first.

    Each pose is chosen as if the ones before it had been touched. On the far side of a cloud that was seen from one
    side, the surface is guessed by a network that was fitted to generated parts.

    Args:
        cloud: points that a camera sees, of any kind that `Model.upsample` takes.
        touches: touches so far, in the frame and unit of the cloud: a folder, `Touch` records or arrays of points.
        count: number of poses.
        sensor: preset of the touch source `digit`, or the outline of a sensor.
        policy: name of a policy, or a policy.
        camera: position of the camera, (3), in the frame and unit of the cloud. By default the direction from which the
            cloud was seen is estimated; if it shows several sides, no far side is guessed.
        all_around: the cloud shows the object from all sides, so that no far side is guessed.
        unit: unit of the cloud: "mm", "m", "cm", "in", or its length in mm. By default that of the touches, or mm
            without any.
        candidates: number of points of the surface at which poses are tried. More take longer and find better ones.
        seed: seed of the candidates.
        bad: treatment of faulty points, as of `Model.upsample`; "drop" and "keep" do not use them.
        touch_as_is: use the touches where they were reported, without registration.
        plugins: plugin files, if the policy is a part of one.
        advance: called with the number of chosen poses and `count`.

    Returns:
        At most `count` poses; if there are fewer, `reason` says why.

    Raises:
        UserError: the cloud is too small for the sensor or has too few points, the units contradict each other, there
            is no such sensor or policy, or `camera` is given with `all_around`.

    Examples:
        >>> ball = np.random.default_rng(0).normal(size=(400, 3))
        >>> ball *= 15 / np.linalg.norm(ball, axis=1, keepdims=True)
        >>> poses = pcsr.next_touches(ball[ball[:, 2] > 1], count=1)  # its lower side is hidden
        >>> poses[0].guessed, bool(poses[0].pose[2, 2] < 0)
        (True, True)
    """
    for name, number, least in (("count", count, 1), ("candidates", candidates, 1), ("seed", seed, 0)):
        if not isinstance(number, int | np.integer) or number < least:
            raise UserError(f"{name} is {number!r}: give a whole number from {least} on")
    if not isinstance(policy, str | Policy):
        raise UserError(f"policy is {policy!r}: give the name of a policy, or an instance of one")
    if camera is not None and all_around:
        raise UserError("a cloud from all around has no one camera: give either camera or all_around (--all-around)")
    screened = cloud if isinstance(cloud, ScreenedCloud) else screen(convert(cloud).cloud, bad)
    points = screened.points
    given = GivenTouches.of(touches, as_is=touch_as_is)
    if isinstance(touches, str | Path):
        given = given.in_frame(points)
    given.check(points)
    given = given.moved(given.registration(points))
    length = None if unit is None else unit_in_mm(unit)
    scale = _unit(length, given)
    registry = load_plugins([Path(file) for file in plugins])
    fingertip = sensor if isinstance(sensor, Fingertip) else fingertip_of(sensor, registry)
    chooser: Policy = policy if isinstance(policy, Policy) else registry.get("policy", policy)()
    middle = points.mean(0)
    seen = (points - middle) * scale
    touched = [(one - middle) * scale for one in given.points(0)]
    _check_size(seen, fingertip, length)
    towards = _towards(camera, points)
    rng = np.random.default_rng(seed)
    found = choose(seen, touched, towards, all_around, count, fingertip, chooser, candidates, rng, advance)
    to_cloud = np.diag([1 / scale, 1 / scale, 1 / scale, 1.0])
    to_cloud[:3, 3] = middle
    moved = tuple(replace(one, pose=to_cloud @ one.pose) for one in found.touches)
    return replace(found, touches=moved, unit=scale)


def unit_in_mm(unit: str | float) -> float:
    """Return the length of a unit in mm.

    Args:
        unit: its name, such as "m", or its length in mm, as a number or text.

    Raises:
        UserError: it is neither.
    """
    try:
        length = float(UNITS[unit] if isinstance(unit, str) and unit in UNITS else unit)
    except (TypeError, ValueError):
        length = np.nan
    if not 0 < length < np.inf:
        raise UserError(
            f"unit is {unit!r}: name it ({', '.join(UNITS)}), or give its length in mm, such as 1000 for m (--unit)"
        )
    return length


def fingertip_of(sensor: str, registry: Registry, source: str = "digit") -> Fingertip:
    """Return the outline of a sensor that a touch source knows.

    Raises:
        UserError: there is no such source or sensor, or the source knows no outline.
    """
    from pcsr.recipe import for_data

    if not (isinstance(sensor, str) and re.fullmatch(r"[\w.-]+", sensor)):
        raise UserError(f"sensor is {sensor!r}: name a preset, such as digit or gelsight-mini (--sensor)")
    try:
        recipe = for_data("cad-parts", {}, registry, [f"use={source}", f"sensor={sensor}"], part="touch")
    except UserError as error:
        raise UserError(f"--sensor: {str(error).split('.sensor: ')[-1]}") from error
    found = recipe.data.touch.build(registry, "touch").fingertip()
    if not isinstance(found, Fingertip):
        raise UserError(f"touch source '{source}' does not know the outline of its sensor: name another source")
    return found


def _towards(camera: Sequence[float] | None, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3"] | None:
    """Return the unit vector from the middle of the cloud towards the camera.

    Raises:
        UserError: the position is not three finite numbers, or lies between the points of the cloud.
    """
    if camera is None:
        return None
    try:
        position = np.asarray(camera, np.float64)
    except (TypeError, ValueError):
        position = np.zeros(0)
    if position.shape != (3,) or not np.isfinite(position).all():
        raise UserError(f"camera is {camera!r}: give its position as three finite numbers (--camera)")
    low, high = points.min(0), points.max(0)
    if ((position >= low) & (position <= high)).all():
        raise UserError(
            f"camera is {position.tolist()}, inside of the cloud, which reaches from {low.round(4).tolist()} to "
            f"{high.round(4).tolist()}: give the camera's position in the frame and unit of the cloud (--camera)"
        )
    away = position - points.mean(0)
    away = away / np.abs(away).max()
    towards: Float[np.ndarray, 3] = away / np.linalg.norm(away)
    return towards


def _unit(unit: float | None, given: GivenTouches) -> float:
    units = sorted({touch.unit for touch in given.touches if isinstance(touch, Touch)})
    if len(units) > 1:
        raise UserError(f"the touches have units of {units} mm: all must have that of the cloud")
    if unit is not None and units and units[0] != unit:
        raise UserError(f"unit is {unit:g} mm, but that of the touches is {units[0]:g} mm: leave it out (--unit)")
    return unit or (units[0] if units else 1.0)


def _check_size(seen: Float[np.ndarray, "n 3"], fingertip: Fingertip, unit: float | None) -> None:
    """Check that the cloud, in mm, is large enough for the gel.

    Raises:
        UserError: it is not, or it is too large for a fingertip.
    """
    size = float(np.ptp(seen, axis=0).max())
    gel = " × ".join(f"{side:.3g}" for side in fingertip.gel)
    if min(fingertip.gel) <= size <= LONGEST:
        return
    remedy = "name the cloud's unit, such as --unit m (unit=1000)" if unit is None else "correct its unit (--unit)"
    side = "smaller than" if size < LONGEST else "far larger than"
    raise UserError(
        f"the cloud is {size:.3g} mm long, {side} the gel of sensor '{fingertip.name}' ({gel} mm): {remedy}, or take a "
        f"sensor that fits"
    )
