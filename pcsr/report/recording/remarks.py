"""Remarks on what is odd about the usable touches of a recording."""

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from pcsr.clouds.pose_error import PoseError
from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.recorded import Recording
from pcsr.recorded.likely_mistakes import check_indentation
from pcsr.report.recording.facts import TouchFacts, in_sensors
from pcsr.sensors.gels import WIDEST
from pcsr.touches import GivenTouches

MOST_NAMED = 3
"""Most touches that a remark names; further ones are counted."""
FAR = 3.0
"""Distances from the cloud are far from this many errors of the position and spacings of the cloud on."""


def remarks(
    recording: Recording, facts: Sequence[TouchFacts], cloud: Float[np.ndarray, "n 3"] | None = None
) -> list[str]:
    """Return one line for each thing that is odd; skipped touches are not among them.

    Args:
        recording: the recording.
        facts: facts about its touches.
        cloud: cloud in the frame and unit of the touches.
    """
    found: dict[str, list[str]] = defaultdict(list)
    for touch, one in zip(recording.touches, facts, strict=True):
        for remark in _of_touch(touch, one):
            found[remark].append(one.name)
    lines = [f"{_named(names)}: {remark}" for remark, names in found.items()]
    lines += _equal_poses(recording)
    if cloud is not None:
        lines += _far(recording, facts, cloud)
    if recording.pose_error is None and any(len(touch.poses) for touch in recording.touches):
        assumed = PoseError()
        lines.append(
            f"pose_error is not stated, so that {assumed.position:g} mm and {assumed.rotation:g} degrees are assumed: "
            f"add what is known of the arm to touches.json"
        )
    return lines


def unusable(recording: Recording, cloud: Float[np.ndarray, "n 3"]) -> dict[str, str]:
    """Return the touches that cannot be used with a cloud, with the reasons.

    Args:
        recording: the recording.
        cloud: cloud in the frame and unit of the touches.
    """
    reasons = {}
    for name, touch in zip(recording.names, recording.touches, strict=True):
        try:
            GivenTouches.of([touch]).check(cloud)
        except UserError as error:
            reasons[name] = str(error).removeprefix("touch 0 ")
    return reasons


def _of_touch(touch: Touch, facts: TouchFacts) -> Iterator[str]:
    if facts.depth is None:
        yield "without a pose, so that the depth and the direction of the sensor are unknown"
        return
    if facts.depth <= 0:
        yield "no point lies above the face of its sensor: z of the sensor's frame points out of the object; see axes"
    try:
        check_indentation(facts.depth, touch.sensor, "correct unit or pose")
    except UserError as error:
        yield str(error)
    for points in in_sensors(touch):
        if len(points) == 0:
            continue
        sides = np.ptp(points[:, :2], axis=0)
        if sides.max() > WIDEST:
            yield f"a finger's points are {sides.max():.4g} mm wide, more than {WIDEST:g} mm: correct unit"
        if touch.view is not None and (2 * np.abs(points[:, :2]).max(axis=0) > np.multiply(touch.view, 1.01)).any():
            yield "points lie outside of the view of their sensor: correct view or pose"


def _equal_poses(recording: Recording) -> Iterator[str]:
    groups: dict[bytes, list[str]] = defaultdict(list)
    for name, touch in zip(recording.names, recording.touches, strict=True):
        if len(touch.poses):
            groups[touch.poses.tobytes()].append(name)
    for names in groups.values():
        if len(names) > 1:
            yield f"{_named(names)}: the poses are equal: was one copied?"


def _far(recording: Recording, facts: Sequence[TouchFacts], cloud: Float[np.ndarray, "n 3"]) -> Iterator[str]:
    """Name the touches farther from the cloud than its spacing and the error of the poses explain."""
    unit = recording.touches[0].unit
    some = cloud[:: -(-len(cloud) // 1000)]
    spacing = float(np.median(KDTree(cloud).query(some, k=2)[0][:, 1])) * unit if len(cloud) > 1 else 0.0
    limit = FAR * ((recording.pose_error or PoseError()).position + spacing)
    far = [one.name for one in facts if one.distance is not None and one.distance > limit]
    if far:
        yield (
            f"{_named(far)}: farther than {limit:.2g} mm from the cloud: right on a side that the cloud does not show, "
            f"else its pose is wrong"
        )


def _named(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return f"{', '.join(names[:MOST_NAMED])}{more}"
