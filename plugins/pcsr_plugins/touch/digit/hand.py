"""One touch: candidates in the policy's order are pressed, judged and measured with noise."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcsr import Fingertip, Policy, Touch, TouchCandidates
from pcsr.contracts import SimulatedFinger
from pcsr.geometry.rays import MeshRays
from pcsr_plugins.touch.digit.candidates import Candidates
from pcsr_plugins.touch.digit.noise import Noise
from pcsr_plugins.touch.digit.policies import OPPOSING, opposing
from pcsr_plugins.touch.digit.press import Contact, Finger

AT_ONCE = 1 << 14
"""Candidates whose rays are cast together: enough to be quick, few enough to need little memory."""


@dataclass(frozen=True)
class Hand:
    """What touches, and how; the options are those of `Digit`. Lengths are mm, angles degrees."""

    finger: Finger
    noise: Noise
    points: int
    at_least: int
    at_least_area: float | None
    press: tuple[float, float]
    tilt: float
    policy: Policy
    tries: int
    spacing: float

    @property
    def fingertip(self) -> Fingertip:
        """The outline of the sensor, for policies."""
        sensor = self.finger.sensor
        area = self.at_least * sensor.pitch**2 if self.at_least_area is None else self.at_least_area
        sides = (sensor.width, sensor.height)
        return Fingertip(sensor.name, sides, sensor.housing, sensor.protrusion, self.press, area)

    @property
    def rule(self) -> tuple[str, str]:
        """Option that decides what a touch is, and its value in words."""
        if self.at_least_area is None:
            return "at_least", f"{self.at_least} pixels"
        return "at_least_area", f"{self.at_least_area:g} mm²"

    def candidates(self, rays: MeshRays, rngs: Sequence[np.random.Generator]) -> Iterator[Candidates]:
        """Candidates of each of several touches; each has a random stream of its own."""
        group = max(1, AT_ONCE // self.tries)
        for start in range(0, len(rngs), group):
            yield from Candidates.draw(rays, self.tries, self.tilt, self.press, rngs[start : start + group])

    def touch(
        self,
        rays: MeshRays,
        candidates: Candidates,
        seen: Float[np.ndarray, "n 3"],
        touched: Float[np.ndarray, "f 3"],
        rng: np.random.Generator,
    ) -> "Touch | Counter[str]":
        """Touch at the first of `tries` candidates that allows one.

        Args:
            rays: the object.
            candidates: this touch's.
            seen: the visual cloud, in the frame of the rays, in mm.
            touched: points of earlier touches, likewise.
            rng: for this touch alone, its candidates drawn already.

        Returns:
            The touch in the object's own frame and unit, or how many candidates were refused for which reason.
        """
        angles = rng.uniform(0, 2 * np.pi, self.tries)
        depths = rng.uniform(*self.press, (self.tries, OPPOSING))
        possible = np.flatnonzero(candidates.open)
        refused = Counter({"behind other parts of the object": self.tries - len(possible)})
        reachable = TouchCandidates(
            candidates.points[possible], candidates.frames[possible], candidates.presses[possible], self.fingertip
        )
        for k in possible[self.policy.order(reachable, seen, touched)]:
            point, frame = candidates.points[k], candidates.frames[k]
            contact = self.finger.press(rays, point, frame, float(candidates.presses[k]))
            if contact is None:
                refused["without room for the housing"] += 1
                continue
            if not self._enough(contact):
                refused[f"with less contact than {self.rule[1]}"] += 1
                continue
            contacts = [contact]
            if self.policy.grasps:
                starts, axes = opposing(point, frame, self.finger.sensor.housing, self.spacing, float(angles[k]))
                at = zip(starts, depths[k].tolist(), strict=True)
                opposite = [self.finger.press(rays, start, axes, depth) for start, depth in at]
                contacts += [other for other in opposite if other is not None and self._enough(other)]
                if len(contacts) == 1:
                    refused["with nothing to grasp on the other side"] += 1
                    continue
            return Touch.grasp([self.measured(rays, one, rng) for one in contacts]).resampled(self.points, rng)
        return +refused

    def _enough(self, contact: Contact) -> bool:
        if self.at_least_area is None:
            return contact.pixels >= self.at_least
        return contact.area >= self.at_least_area

    def measured(self, rays: MeshRays, contact: Contact, rng: np.random.Generator) -> Touch:
        """Return the whole contact with its noise, in the object's frame and unit."""
        of_heights, of_pose = rng.spawn(2)
        sensor = self.finger.sensor
        local = contact.points(self.noise.heights(contact.seen[..., 2], contact.mask, sensor.pitch, of_heights))
        # The pose is the measured one; the points lie relative to it.
        pose = rays.to_object @ contact.pose @ self.noise.pose_error(of_pose)
        points = local @ pose[:3, :3].T + pose[:3, 3]
        return Touch.single(points, pose, rays.unit, sensor.name, contact.area, sensor.flat_view)


class PressedFinger(SimulatedFinger):
    """Finger of a hand that touches an object at given poses.

    Args:
        hand: its sensor, noise and press.
        rays: the object.
    """

    def __init__(self, hand: Hand, rays: MeshRays) -> None:
        self.unit, self._hand, self._rays = rays.unit, hand, rays

    def touch(self, pose: Float[np.ndarray, "4 4"], rng: np.random.Generator) -> Touch | None:
        """Touch the object; any contact of at least one pixel is a touch."""
        local = np.linalg.inv(self._rays.to_object) @ pose
        contact = self._hand.finger.press(self._rays, local[:3, 3], local[:3, :3], sum(self._hand.press) / 2)
        if contact is None or contact.pixels == 0:
            return None
        return self._hand.measured(self._rays, contact, rng).resampled(self._hand.points, rng)
