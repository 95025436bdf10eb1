"""A fingertip pressed onto the object, simulated by ray casting (TAPSR, Sec. 4.1; DIGIT: Lambeta et al., 2020).

docs/touch.md describes the model and the sources of its figures.
"""

from dataclasses import replace
from typing import Annotated

import numpy as np
from jaxtyping import Float
from pydantic import Field

from pcsr import Fingertip, PoseError, ShapeItem, Touch, TouchSource, UserError
from pcsr.geometry.rays import MeshRays
from pcsr_plugins.touch.digit.hand import Hand, PressedFinger
from pcsr_plugins.touch.digit.noise import Noise
from pcsr_plugins.touch.digit.policies import PolicyOptions
from pcsr_plugins.touch.digit.press import CONTACT, Finger
from pcsr_plugins.touch.digit.sensors import Length, SensorOptions

# Limits that no sensor meets: what is beyond them would run on or take all memory.
Size = Annotated[float, Field(gt=0, le=1e9)]
Area = Annotated[float, Field(gt=0, le=1e6)]
Count = Annotated[int, Field(ge=1, le=1 << 20)]
Tilt = Annotated[float, Field(ge=0, le=180)]
MOST_POINTS = 1 << 22
"""Points of all touches of an object."""


class Digit(TouchSource):
    """Touches at points of the surface that a policy chooses, by a sensor out of a table or one's own.

    The pose of a touch maps the sensor's frame to the object's. The sensor's frame is in millimetres; its
    origin is the centre of the unpressed face, x runs along its width, y along its height, and z out of the
    object: the sensor looks along -z.
    """

    needs = frozenset({"embreex"})
    version = 2  # contact begins at 0.4 of the press, not at 0.2

    def __init__(
        self,
        *,
        object_size: Size | None = 60.0,
        sensor: SensorOptions = SensorOptions(),
        points: Count = 512,
        at_least: Count = 1000,
        at_least_area: Area | None = None,
        press: tuple[Length, Length] = (0.5, 1.5),
        tilt: Tilt = 5.0,
        policy: PolicyOptions = PolicyOptions(),
        noise: Noise = Noise(),
    ) -> None:
        """Choose the sensor and how it is used.

        Args:
            object_size: longest side of the object's bounding box, in mm: the mesh is taken to be that large.
                None: the mesh's unit is the millimetre.
            sensor: a preset, and the figures that replace its own.
            points: kept of each touch, drawn at random from the contact's pixels; where it has fewer, they
                are repeated.
            at_least: pixels in contact that make a touch (TAPSR, Sec. 4.1).
            at_least_area: contact in mm² that makes a touch, instead of `at_least`.
            press: least and greatest depth that the finger is pressed, in mm.
            tilt: standard deviation of the angle between the sensor's axis and the surface normal, in
                degrees; the angle is never more than twice that.
            policy: which candidates on the surface are tried first, and how many.
            noise: of heights and poses.

        Raises:
            UserError: options that contradict each other.
        """
        self.sensor = sensor.sensor()
        if press[0] > press[1]:
            raise UserError(f"touch 'digit': press is {press}: give the least depth first")
        if press[1] <= CONTACT and self.sensor.senses == "pressure":
            raise UserError(f"touch 'digit': press is {press}, but contact begins at {CONTACT} mm: press deeper")
        if noise.blur > max(self.sensor.width, self.sensor.height):
            raise UserError(
                f"touch 'digit': blur is {noise.blur} mm, wider than the sensor's {self.sensor.width:.4g} × "
                f"{self.sensor.height:.4g} mm: lower it"
            )
        self.object_size = object_size
        self.hand = Hand(
            finger=Finger(self.sensor),
            noise=noise,
            points=points,
            at_least=at_least,
            at_least_area=at_least_area,
            press=press,
            tilt=tilt,
            policy=policy.part(),
            tries=policy.tries,
            spacing=policy.spacing,
        )
        self.policy_name = policy.use

    def touches(self, item: ShapeItem, cloud: Float[np.ndarray, "n 3"], count: int, seed: int) -> list[Touch]:
        """`count` touches, each with a random stream of its own, so that fewer are a prefix of more.

        Raises:
            UserError: the mesh has no surface, is smaller than the gel, or none of `tries` candidates allowed a touch;
                too many points in all.
        """
        if count * self.hand.points > MOST_POINTS:
            raise UserError(
                f"touch 'digit': {count} touches of {self.hand.points} points are {count * self.hand.points} points, "
                f"more than {MOST_POINTS}: take fewer touches, or lower points"
            )
        rays = MeshRays(item.mesh, self.object_size, item.name)
        self._check_size(rays, item.name)
        seen = (cloud - rays.to_object[:3, 3]) * rays.unit
        if self.hand.policy.uses_cloud and not np.isfinite(seen).all():
            raise UserError(
                f"{item.name}: its cloud has a coordinate that is not finite: policy '{self.policy_name}' needs all"
            )
        found: list[Touch] = []
        touched = np.zeros((0, 3))
        rngs = [np.random.default_rng((seed, number)) for number in range(count)]
        for number, candidates in enumerate(self.hand.candidates(rays, rngs)):
            touch = self.hand.touch(rays, candidates, seen, touched, rngs[number])
            if not isinstance(touch, Touch):
                tries = self.hand.tries
                raise UserError(
                    f"{item.name}: touch 'digit' found {number} of {count} touches, then none of {tries} "
                    f"candidates would do ({', '.join(f'{times} {why}' for why, times in touch.items())}); at "
                    f"{rays.size:.4g} mm the object is too small, thin or hollow for sensor '{self.sensor.name}': "
                    f"raise object_size, lower {self.hand.rule[0]} or leave the object out"
                )
            found.append(touch)
            touched = np.concatenate([touched, (touch.points - rays.to_object[:3, 3]) * rays.unit])
        if not self.hand.noise.shared:
            return found
        # No touch has a third number in its seed, so that the stream is no touch's, however many there are.
        shared = self.hand.noise.shared_error(np.random.default_rng((seed, 0, 1)))
        motion = rays.to_object @ shared @ np.linalg.inv(rays.to_object)
        return [
            replace(touch, points=touch.points @ motion[:3, :3].T + motion[:3, 3], poses=motion @ touch.poses)
            for touch in found
        ]

    def pose_error(self, name: str) -> PoseError:
        """Return the deviations of the noise of the poses, which are the same for all objects."""
        return self.hand.noise.expected_pose_error

    def fingertip(self) -> Fingertip:
        """Return the outline of the sensor."""
        return self.hand.fingertip

    def finger(self, item: ShapeItem) -> PressedFinger:
        """Return a finger that touches an object at given poses, pressed to the middle of `press`."""
        rays = MeshRays(item.mesh, self.object_size, item.name)
        self._check_size(rays, item.name)
        return PressedFinger(self.hand, rays)

    def _check_size(self, rays: MeshRays, name: str) -> None:
        width, height = self.sensor.width, self.sensor.height
        if rays.size >= min(width, height):
            return
        if self.object_size is None:
            remedy = "is the mesh in metres? give object_size, or the mesh in mm"
        else:
            remedy = "raise object_size"
        raise UserError(
            f"{name} is {rays.size:.3g} mm long, smaller than the gel of sensor '{self.sensor.name}' "
            f"({width:.4g} × {height:.4g} mm): {remedy}"
        )
