"""The kinds of part, and what passes between them. Read this file first.

A network is encoder, fusion, backbone and upsampler in a row; touch enters at the fusion, through an encoder
of its own (TAPSR, Sec. 3.1, Fig. 1)::

    P (b n 3) ──► encoder ──► Fp ──┐
                                   ├─► fusion ──► Ff ──► backbone ──► F ──► upsampler ──► Q (b r·n 3)
    T (b a m 3) ─► touch encoder ─► Ft ┘

The constructor of a network part takes the `Widths` that the host hands in, then its own hyperparameters:
keyword-only, typed, defaulted. The recipe's schema is read off that signature.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, ClassVar, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float
from torch import Tensor, nn

from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.tensors import Dense, Features, Mesh, Points, TouchFeatures, TouchMask, TouchPoints

if TYPE_CHECKING:
    import trimesh  # which takes ray caster and solid modeller with it, and networks need none


class Trait(StrEnum):
    """What a part claims about itself. The conformance tests hold it to its claims.

    Examples:
        >>> pcsr.Trait.PERMUTATION_EQUIVARIANT.value
        'permutation-equivariant'
        >>> frozenset({pcsr.Trait.ANY_RATE}) <= frozenset(pcsr.Trait)
        True
    """

    PERMUTATION_EQUIVARIANT = "permutation-equivariant"
    """Permuting the input's points permutes the output alike (or, for an upsampler, leaves the set as it was)."""
    TOUCH_PERMUTATION_INVARIANT = "touch-permutation-invariant"
    """The order of the touches does not matter."""
    ANY_RATE = "any-rate"
    """One instance serves every rate, not only the one it was built for."""


@dataclass(frozen=True)
class Widths:
    """Channel counts that the host knows when it builds a part. A count that is not known yet is 0.

    Examples:
        >>> pcsr.Widths(visual=128, touch=32).visual
        128
        >>> pcsr.Widths().refined
        0
    """

    visual: int = 0
    """Channels of the visual features: what the encoder gives, the fusion keeps and the backbone takes."""
    touch: int = 0
    """Channels of the touch features."""
    refined: int = 0
    """Channels that the backbone gives and the upsampler takes."""
    rate: int = 1
    """Output points for each input point."""


@dataclass(frozen=True)
class TouchBatch:
    """A batch of touches with their features, as a fusion receives it.

    A row of the batch may hold fewer touches than another: `mask` is True where there is one. The host never
    hands a fusion a row without any touch.

    Examples:
        >>> touches = pcsr.TouchBatch(torch.ones(2, 3, 5, 3), torch.ones(2, 3, 5, 8), torch.ones(2, 3).bool())
        >>> touches.flat.shape, touches.flat_points.shape, touches.flat_padding.shape
        (torch.Size([2, 15, 8]), torch.Size([2, 15, 3]), torch.Size([2, 15]))
    """

    points: TouchPoints
    features: TouchFeatures
    mask: TouchMask

    @property
    def flat(self) -> Float[Tensor, "b am c"]:
        """The features of all touches in one row of points."""
        return self.features.flatten(1, 2)

    @property
    def flat_points(self) -> Float[Tensor, "b am 3"]:
        """The coordinates in the order of `flat`."""
        return self.points.flatten(1, 2)

    @property
    def flat_padding(self) -> Bool[Tensor, "b am"]:
        """True where `flat` holds no touch: what attention layers call a key padding mask."""
        return ~self.mask.repeat_interleave(self.points.shape[2], dim=1)


class Part:
    """What every part has, whatever its kind.

    Examples:
        >>> issubclass(pcsr.Encoder, pcsr.contracts.Part)
        True
        >>> pcsr.Encoder.version
        1
    """

    traits: frozenset[Trait] = frozenset()
    """What the part claims; an instance may claim less than its class."""
    version: ClassVar[int] = 1
    """Raise it when the same options come to give something else: data and weights made before are then stale."""
    path_options: ClassVar[frozenset[str]] = frozenset()
    """Options that say where files lie, not what is in them: data sets are the same wherever they are built."""
    needs: ClassVar[frozenset[str]] = frozenset()
    """Packages that the part imports only when it works, as Python names them; pcsr looks for them before it begins."""


class Encoder(nn.Module, Part):
    """Coordinates to features for each point. One serves the cloud; another, narrower, serves each touch.

    Examples:
        >>> class Scaled(pcsr.Encoder):
        ...     def __init__(self, widths: pcsr.Widths, *, scale: float = 2.0) -> None:
        ...         super().__init__()
        ...         self.channels, self.scale = 3, scale
        ...
        ...     def forward(self, points):
        ...         return self.scale * points
        >>> Scaled(pcsr.Widths())(torch.ones(1, 1, 3))
        tensor([[[2., 2., 2.]]])
    """

    channels: int
    """Channels of the features that it gives."""

    def forward(self, points: Points) -> Features:
        """Encode a cloud."""
        raise NotImplementedError


class Fusion(nn.Module, Part):
    """Folds the touches into the visual features.

    Without any touch the host does not call it: the visual features go on as they are.

    Examples:
        >>> class Mean(pcsr.Fusion):
        ...     def __init__(self, widths: pcsr.Widths) -> None:
        ...         super().__init__()
        ...
        ...     def forward(self, points, features, touches):
        ...         return features + touches.features.mean((1, 2))[:, None]
        >>> touches = pcsr.TouchBatch(torch.ones(1, 2, 3, 3), torch.ones(1, 2, 3, 4), torch.ones(1, 2).bool())
        >>> Mean(pcsr.Widths(visual=4, touch=4))(torch.ones(1, 5, 3), torch.zeros(1, 5, 4), touches).shape
        torch.Size([1, 5, 4])
    """

    uses_touch_features: ClassVar[bool] = True
    """False where the fusion ignores touch features, so that no touch encoder is needed."""
    keeps_touched_points: ClassVar[bool] = False
    """True where touched points are part of the dense cloud, in the place of what the network made around them."""

    def forward(self, points: Points, features: Features, touches: TouchBatch) -> Features:
        """Fuse the touches into `features`, which keep their shape."""
        raise NotImplementedError

    def join(self, points: Points, touches: TouchPoints, mask: TouchMask) -> Float[Tensor, "b joined 3"]:
        """A second door, before the encoder: the raw touch points may join the cloud. Unchanged by default."""
        return points


class Backbone(nn.Module, Part):
    """Refines the fused features; sees the coordinates too.

    Examples:
        >>> class Layer(pcsr.Backbone):
        ...     def __init__(self, widths: pcsr.Widths, *, channels: int = 8) -> None:
        ...         super().__init__()
        ...         self.channels = channels
        ...         self.layer = torch.nn.Linear(widths.visual, channels)
        ...
        ...     def forward(self, points, features):
        ...         return self.layer(features)
        >>> Layer(pcsr.Widths(visual=4))(torch.ones(1, 5, 3), torch.ones(1, 5, 4)).shape
        torch.Size([1, 5, 8])
    """

    channels: int
    """Channels of the features that it gives."""

    def forward(self, points: Points, features: Features) -> Float[Tensor, "b n refined"]:
        """Refine the features of each point."""
        raise NotImplementedError


class Upsampler(nn.Module, Part):
    """Features to `rate` times as many points.

    Examples:
        >>> class Copies(pcsr.Upsampler):
        ...     def __init__(self, widths: pcsr.Widths) -> None:
        ...         super().__init__()
        ...
        ...     def forward(self, points, features, rate):
        ...         return points.repeat_interleave(rate, dim=1)
        >>> Copies(pcsr.Widths())(torch.ones(1, 5, 3), torch.ones(1, 5, 4), 2).shape
        torch.Size([1, 10, 3])
    """

    max_rate_per_pass: ClassVar[int | None] = None
    """The greatest rate that is made in one pass, in use: a greater one is made of what was made. None: any is."""

    def prepare(self, points: Points, rate: int) -> Dense:
        """The cloud that the network sees: as a rule the sparse one.

        An upsampler that only refines an interpolated cloud gives that one, of k times as many points. Features and
        touches are then its points', and `rate` / k is left to make. Patches are cut from it too, so that nothing
        is interpolated across their borders. At rate 1 it gives the points themselves.
        """
        return points

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """Make the dense cloud. A part built for one rate refuses another with a `UserError`.

        It may give more than `rate` times as many points: in use the host keeps the farthest of them.
        """
        raise NotImplementedError

    def stages(self, points: Points, features: Features, rate: int) -> list[Dense]:
        """The clouds on the way, the coarsest first and the result last: for objectives that judge all of them."""
        return [self(points, features, rate)]


@runtime_checkable
class UpsamplingNetwork(Protocol):
    """A whole network, as an objective sees it.

    Examples:
        >>> isinstance(pcsr.load("tapsr").network, pcsr.UpsamplingNetwork)
        True
    """

    upsampler: Upsampler

    def __call__(
        self, points: Points, rate: int, touches: TouchPoints | None = None, mask: TouchMask | None = None
    ) -> Dense:
        """Sparse clouds and touches to dense clouds."""

    def stages(
        self, points: Points, rate: int, touches: TouchPoints | None = None, mask: TouchMask | None = None
    ) -> list[Dense]:
        """The clouds on the way, the result last."""

    def refine(
        self, points: Points, touches: TouchPoints | None = None, mask: TouchMask | None = None
    ) -> tuple[Float[Tensor, "b joined 3"], Float[Tensor, "b joined c"]]:
        """What the upsampler is handed: the cloud, to which touches may have been joined, and its features."""


class Objective(nn.Module, Part):
    """What training minimises. It may own networks of its own, such as a discriminator.

    Examples:
        >>> class Shift(pcsr.Objective):
        ...     def forward(self, prediction, target):
        ...         return {"shift": (prediction.mean(1) - target.mean(1)).norm()}
        >>> Shift()(torch.ones(1, 4, 3), torch.ones(1, 6, 3))
        {'shift': tensor(0.)}
    """

    lr_multiplier: ClassVar[float] = 1.0
    """The learning rate of its own weights, as a multiple of the network's."""

    def forward(
        self, prediction: Float[Tensor, "b rn 3"], target: Float[Tensor, "b g 3"]
    ) -> dict[str, Float[Tensor, ""]]:
        """Named losses; training minimises their sum."""
        raise NotImplementedError

    def losses(
        self,
        network: UpsamplingNetwork,
        points: Points,
        truth: Float[Tensor, "b g 3"],
        rate: int,
        touches: TouchPoints | None = None,
        mask: TouchMask | None = None,
    ) -> dict[str, Float[Tensor, ""]]:
        """What training calls; to be overridden where more than the network's result is judged."""
        losses: dict[str, Float[Tensor, ""]] = self(network(points, rate, touches, mask), truth)
        return losses


@dataclass(frozen=True)
class ShapeItem:
    """One object: a mesh in its own frame and unit.

    Examples:
        >>> import trimesh
        >>> item = pcsr.ShapeItem("box", group="boxes", mesh=trimesh.creation.box())
        >>> item.mesh.is_watertight
        True
    """

    name: str
    """Unique within its `ShapeSource`, and the same on every machine."""
    group: str
    """Objects of one group are variants of each other: a family, a product line, a source file."""
    mesh: "trimesh.Trimesh"


SPLITS = ("train", "validation", "test")
"""The splits of a data set."""


class ShapeSource(Part):
    """Gives the objects. Cheap to construct and to pickle: workers load one item each, by name.

    Examples:
        >>> import trimesh
        >>> class Balls(pcsr.ShapeSource):
        ...     def names(self, split):
        ...         return [f"{split}/{number}" for number in range(2)]
        ...
        ...     def item(self, name):
        ...         return pcsr.ShapeItem(name, group=name, mesh=trimesh.creation.icosphere())
        >>> Balls().names("test")
        ['test/0', 'test/1']
    """

    def names(self, split: str) -> Sequence[str]:
        """The objects of `split` ("train", "validation" or "test"), in a fixed order."""
        raise NotImplementedError

    def item(self, name: str) -> ShapeItem:
        """Load or generate one object.

        Raises:
            UserError: the object cannot be used; the message says which and why.
        """
        raise NotImplementedError

    def digest(self, name: str) -> str:
        """What decides the object `name`, as a hash or a name; the same wherever its files lie.

        By default the mesh itself, or the reason why there is none. Override it where something is known that
        costs less than loading each object.
        """
        try:
            mesh = self.item(name).mesh
        except UserError as error:
            return f"refused: {error}"
        arrays = (np.ascontiguousarray(mesh.vertices, np.float64), np.ascontiguousarray(mesh.faces, np.int64))
        return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


class TouchSource(Part):
    """Gives the touches of an object, simulated or recorded.

    Examples:
        >>> class Corner(pcsr.TouchSource):
        ...     def touches(self, item, cloud, count, seed):
        ...         corner = np.asarray(item.mesh.vertices[:1])
        ...         return [pcsr.Touch.single(corner, None, unit=1.0, sensor="point")] * count
        >>> import trimesh
        >>> item = pcsr.ShapeItem("box", "boxes", trimesh.creation.box())
        >>> len(Corner().touches(item, np.zeros((1, 3)), count=2, seed=0))
        2
    """

    def touches(self, item: ShapeItem, cloud: Float[np.ndarray, "n 3"], count: int, seed: int) -> list[Touch]:
        """`count` touches of `item`, in its frame and unit; `cloud` is what the camera sees of it.

        The same arguments give the same touches, and fewer are a prefix of more.

        Raises:
            UserError: the object cannot be touched that often; the message says which and why.
        """
        raise NotImplementedError

    def digest(self, name: str) -> str:
        """What decides the touches of the object `name` besides the options: a hash of its recording, say.

        Nothing does, by default: a simulation follows from its options and the seed.
        """
        return ""


class Metric(Part):
    """Error of a dense cloud beside the truth. Lower is better, and 0 is perfect. The constructor takes nothing."""

    description: ClassVar[str]
    """What it measures, in a line of a table."""
    scale: ClassVar[int] = 1000
    """Factor of the values in tables."""
    needs_mesh: ClassVar[bool] = False
    """True where `measure` needs the true surface."""

    def measure(
        self, prediction: Float[Tensor, "p 3"], target: Float[Tensor, "t 3"], mesh: Mesh | None = None
    ) -> float:
        """Error of one cloud, unscaled.

        Args:
            prediction: the cloud to judge.
            target: the true cloud; it may have another number of points.
            mesh: vertices and faces of the true surface, in the frame of the clouds. None where it is not known.

        Raises:
            UserError: these clouds cannot be compared by it.
        """
        raise NotImplementedError


class Baseline(Part):
    """Upsampling without learning, which networks are compared with. The constructor takes nothing."""

    needs_mesh: ClassVar[bool] = False
    """True where `upsample` needs the true surface: a bound then, rather than a method."""

    def upsample(
        self, points: Float[np.ndarray, "n 3"], rate: int, mesh: Mesh | None, rng: np.random.Generator
    ) -> Float[np.ndarray, "rn 3"]:
        """Dense cloud of `rate` times as many points.

        Args:
            points: the sparse cloud.
            rate: points of the dense cloud for each of them.
            mesh: vertices and faces of the true surface, in the frame of the cloud; None unless `needs_mesh`.
            rng: of the object alone, independent of the truth.
        """
        raise NotImplementedError
