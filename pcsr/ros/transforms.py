"""Transforms between frames at any time, from the messages of /tf, /tf_static and of poses."""

from array import array
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial.transform import Rotation, Slerp

from pcsr.errors import UserError, printable
from pcsr.ros.doubts import AROUND, doubt

MAX_GAP = 0.1
"""Longest time to the nearest transform, by default, in seconds."""
TOLERANCE = 1e-3
"""Largest difference of a quaternion's norm from 1."""
FARTHEST = 1e7
"""Largest distance between two frames in metres: on the earth there is no larger one."""
MOST_LISTED = 20
"""Most frames that a message lists; further ones are counted."""


class _Series:
    """Transforms of one frame to its parents."""

    def __init__(self) -> None:
        self._stamps, self._values = array("q"), array("d")
        self._parents: list[str] = []
        self._sorted: tuple[Int64[np.ndarray, " n"], list[str], Float64[np.ndarray, "n 7"]] | None = None

    def add(self, stamp: int, parent: str, value: tuple[float, ...]) -> None:
        """Add a transform at a time in nanoseconds: translation x y z and quaternion x y z w."""
        self._stamps.append(stamp)
        self._parents.append(parent)
        self._values.extend(value)
        self._sorted = None

    @property
    def in_order(self) -> tuple[Int64[np.ndarray, " n"], list[str], Float64[np.ndarray, "n 7"]]:
        """Times, parents and transforms in the order of time; of those of the same time the last."""
        if self._sorted is None:
            stamps = np.array(self._stamps, np.int64)
            order = np.argsort(stamps, kind="stable")
            order = order[np.append(np.diff(stamps[order]) != 0, True)]
            parents = [self._parents[i] for i in order.tolist()]
            self._sorted = stamps[order], parents, np.array(self._values, np.float64).reshape(-1, 7)[order]
        return self._sorted


class Transforms:
    """Transforms between frames, interpolated in time: translations linearly, rotations by slerp.

    As in tf, each frame has one parent at a time, and a transform maps coordinates of the frame to those of its parent.
    A slash before the name of a frame, as in old bags, makes no difference.

    Args:
        max_gap: longest time from a query to the nearest transform of each frame, in seconds. Within it, the first and
            the last transform hold beyond their times.
    """

    def __init__(self, max_gap: float = MAX_GAP) -> None:
        self.max_gap = max_gap
        self._moving: dict[str, _Series] = {}
        self._static: dict[str, tuple[str, tuple[float, ...]]] = {}
        self._parents: dict[str, dict[str, str]] = {}
        """Parents of each frame at any time, by their names."""
        self._replaced: set[str] = set()
        """Frames with several static transforms that differ."""
        self.doubts: list[str] = []
        """What is odd about the transforms that `matrix` has used."""

    @property
    def frames(self) -> list[str]:
        """Names of all frames."""
        return sorted({*self._parents, *(parent for parents in self._parents.values() for parent in parents)})

    def add(self, child: str, parent: str, stamp: int | None, translation: Any, rotation: Any) -> None:
        """Add the transform from a frame to its parent.

        Args:
            child: name of the frame.
            parent: name of its parent.
            stamp: time in nanoseconds; None for a transform that always holds.
            translation: message with the numbers x, y and z, in metres.
            rotation: message with the quaternion x, y, z and w.
        """
        child, parent = plain(child), plain(parent)
        parent = self._parents.setdefault(child, {}).setdefault(parent, parent)  # one text for all transforms
        value = (translation.x, translation.y, translation.z, rotation.x, rotation.y, rotation.z, rotation.w)
        if stamp is None:
            if self._static.setdefault(child, (parent, value)) != (parent, value):
                self._replaced.add(child)
            self._static[child] = parent, value
            return
        self._moving.setdefault(child, _Series()).add(stamp, parent, value)

    def check(self, source: str, target: str) -> None:
        """Check that transforms lead from a frame to another at some time.

        Raises:
            UserError: one of the frames is unknown, or none do; the message names the frames.
        """
        known = self.frames
        for frame in (plain(source), plain(target)):
            if frame not in known:
                raise UserError(f"there is no frame '{frame}': {listed_frames(known)}")
        reached = self._reached(plain(source))
        if plain(target) not in reached:
            leads_to = listed_frames(sorted(reached))
            raise UserError(f"no transform leads from frame '{plain(source)}' to '{plain(target)}' but to {leads_to}")

    def matrix(self, source: str, target: str, stamp: int) -> Float64[np.ndarray, "4 4"]:
        """Return the matrix that maps coordinates of a frame to those of another at a time, in metres.

        Raises:
            UserError: no transforms lead there, a frame has none near this time, or one of them is no rigid motion.
        """
        source, target = plain(source), plain(target)
        self.check(source, target)
        up, obstacle = self._upward(source, target, stamp)
        down, other = self._upward(target, "", stamp, until=up)
        common = next((frame for frame in down if frame in up), None)
        if common is None:
            raise obstacle or other or UserError(f"no transform leads from frame '{source}' to '{target}' at this time")
        matrix: Float64[np.ndarray, "4 4"] = np.linalg.inv(down[common]) @ up[common]
        return matrix

    def _reached(self, source: str) -> set[str]:
        """Return the frames that are connected with one, by transforms of any time."""
        edges: dict[str, set[str]] = {}
        for child, parents in self._parents.items():
            for parent in parents:
                edges.setdefault(child, set()).add(parent)
                edges.setdefault(parent, set()).add(child)
        reached, new = {source}, {source}
        while new:
            new = set().union(*(edges.get(frame, set()) for frame in new)) - reached
            reached |= new
        return reached

    def _upward(
        self, frame: str, target: str, stamp: int, until: dict[str, Any] | None = None
    ) -> tuple[dict[str, Float64[np.ndarray, "4 4"]], UserError | None]:
        """Follow the parents of a frame, up to `target` or a frame of `until`.

        Returns:
            The matrices to the frames on the way, itself first, and the error that ended it, if any.
        """
        matrix = np.eye(4)
        found = {frame: matrix}
        while frame != target and not (until and frame in until):
            try:
                step = self._step(frame, stamp)
            except UserError as error:
                return found, error
            if step is None:
                break
            frame, local = step
            if frame in found:
                return found, UserError(f"the transforms lead from frame '{frame}' back to itself: rename a frame")
            matrix = local @ matrix
            found[frame] = matrix
        return found, None

    def _step(self, child: str, stamp: int) -> tuple[str, Float64[np.ndarray, "4 4"]] | None:
        """Return the parent of a frame at a time, and the matrix to it; None for a frame without parent.

        Raises:
            UserError: there is no transform near this time, or it is no rigid motion.
        """
        series = self._moving.get(child)
        if series is None:
            if child not in self._static:
                return None
            if child in self._replaced:
                self._doubt(f"frame '{child}' has several static transforms that differ: the last is used")
            parent, value = self._static[child]
            return parent, _matrix(value, child, parent)
        stamps, parents, found = series.in_order
        after = int(np.searchsorted(stamps, stamp))
        before = after - 1
        near = min((i for i in (before, after) if 0 <= i < len(stamps)), key=lambda i: abs(int(stamps[i]) - stamp))
        gap = abs(int(stamps[near]) - stamp) / 1e9
        if gap > self.max_gap:
            raise UserError(
                f"frame '{child}' has no transform within {self.max_gap:g} s of {stamp / 1e9:.3f} s: the nearest is "
                f"{gap:.3g} s away, and all are from {stamps[0] / 1e9:.3f} to {stamps[-1] / 1e9:.3f} s"
            )
        around = slice(*np.searchsorted(stamps, [stamp - AROUND * 1e9, stamp + AROUND * 1e9]).tolist())
        if text := doubt(child, parents[around], found[around, :3]):
            self._doubt(text)
        parent = parents[near]
        if self._static.get(child, (parent, tuple(found[near]))) != (parent, tuple(found[near])):
            self._doubt(f"frame '{child}' has another static transform beside those of /tf: it is not used")
        if gap == 0 or before < 0 or after == len(stamps) or parents[before] != parents[after]:
            return parent, _matrix(found[near], child, parent)
        first, last = (_matrix(found[i], child, parent) for i in (before, after))
        return parent, _between(first, last, int(stamp - stamps[before]) / int(stamps[after] - stamps[before]))

    def _doubt(self, text: str) -> None:
        if text not in self.doubts:
            self.doubts.append(text)


def plain(frame: str) -> str:
    """Return the name of a frame without the slash of old bags."""
    return frame.removeprefix("/")


def _between(
    first: Float64[np.ndarray, "4 4"], last: Float64[np.ndarray, "4 4"], share: float
) -> Float64[np.ndarray, "4 4"]:
    matrix = np.eye(4)
    matrix[:3, 3] = (1 - share) * first[:3, 3] + share * last[:3, 3]
    rotations = Rotation.from_matrix(np.stack([first[:3, :3], last[:3, :3]]))
    matrix[:3, :3] = Slerp([0.0, 1.0], rotations)(share).as_matrix()
    return matrix


def _matrix(value: Any, child: str, parent: str) -> Float64[np.ndarray, "4 4"]:
    """Return the matrix of a translation x y z and a quaternion x y z w.

    Raises:
        UserError: a number is not finite, or the quaternion does not have norm 1.
    """
    numbers = np.array(value, np.float64)
    name = f"the transform from frame '{child}' to '{parent}'"
    if not np.isfinite(numbers).all():
        raise UserError(f"{name} is not finite: {numbers.tolist()}")
    if np.abs(numbers[:3]).max() > FARTHEST:
        raise UserError(f"{name} is longer than the earth is large: {numbers[:3].tolist()} m")
    norm = float(np.linalg.norm(numbers[3:]))
    if abs(norm - 1) > TOLERANCE:
        raise UserError(f"{name} has the quaternion {numbers[3:].tolist()}, whose norm is {norm:.6g}, not 1")
    matrix = np.eye(4)
    matrix[:3, 3] = numbers[:3]
    matrix[:3, :3] = Rotation.from_quat(numbers[3:]).as_matrix()
    return matrix


def listed_frames(frames: list[str]) -> str:
    """Return the names of frames for a message."""
    more = len(frames) - MOST_LISTED
    shown = printable(", ".join(f"'{frame}'" for frame in frames[:MOST_LISTED]), lines=False)
    return f"the frames {shown}{f' and {more} more' if more > 0 else ''}" if frames else "there are no frames at all"
