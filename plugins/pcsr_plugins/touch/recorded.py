"""Touch source `recorded`: touches that people recorded, as docs/recorded.md describes."""

import hashlib
from pathlib import Path, PurePosixPath
from typing import Annotated

import numpy as np
from jaxtyping import Float
from pydantic import Field

from pcsr import PoseError, ShapeItem, Touch, TouchSource, UserError
from pcsr.recorded import MANIFEST, read


class Recorded(TouchSource):
    """The touches of a folder for each object, or of one folder for one object, in random order.

    Each touch is thinned with a random stream of its own, so that fewer are a prefix of more.
    """

    path_options = frozenset({"folder"})

    def __init__(self, *, folder: str, points: Annotated[int, Field(ge=1, le=1 << 20)] = 512) -> None:
        """Look at nothing but whether the folder is there.

        Args:
            folder: holds a recording of its own, or a folder with one for each object, of the object's name with
                or without its suffix.
            points: kept of each touch, drawn at random; where it has fewer, they are repeated.

        Raises:
            UserError: no such folder.
        """
        self.folder = Path(folder).expanduser()
        self.points = points
        if not self.folder.is_dir():
            raise UserError(f"touch 'recorded': folder '{folder}' is not there: give one with a {MANIFEST}")

    def touches(self, item: ShapeItem, cloud: Float[np.ndarray, "n 3"], count: int, seed: int) -> list[Touch]:
        """`count` of the recorded touches of `item`.

        Raises:
            UserError: there is no recording of it, it has mistakes, or it holds fewer touches.
        """
        if count == 0:
            return []
        folder = self._folder_of(item.name)
        recording = read(folder)
        there = len(recording.touches)
        if there < count:
            reasons = "; ".join(f"{name}: {reason}" for name, reason in recording.skipped.items())
            left = f"; left out were {reasons}" if reasons else ""
            raise UserError(f"{item.name}: {count} touches are asked for, and {folder} holds {there} of use{left}")
        order = np.random.default_rng(seed).permutation(there)[:count]
        return [
            recording.touches[index].resampled(self.points, np.random.default_rng((seed, number)))
            for number, index in enumerate(order)
        ]

    def digest(self, name: str) -> str:
        """Hash of the recording: of its files' names and contents."""
        try:
            folder = self._folder_of(name)
        except UserError:
            return "missing"
        whole = hashlib.sha256()
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            with path.open("rb") as file:
                content = hashlib.file_digest(file, "sha256").hexdigest()
            whole.update(f"{path.relative_to(folder).as_posix()} {content}\n".encode())
        return whole.hexdigest()

    def pose_error(self, name: str) -> PoseError | None:
        """Return the error that the recording states.

        Raises:
            UserError: there is no recording of the object, or it has mistakes.
        """
        return read(self._folder_of(name)).pose_error

    def _folder_of(self, name: str) -> Path:
        if (self.folder / MANIFEST).is_file():
            return self.folder
        inner = PurePosixPath(name)
        if inner.is_absolute() or ".." in inner.parts:
            raise UserError(f"touch 'recorded': '{name}' leads out of '{self.folder}'")
        tried = list(dict.fromkeys(self.folder / name for name in (inner.with_suffix(""), inner)))
        for folder in tried:
            if (folder / MANIFEST).is_file():
                return folder
        folders = " nor ".join(str(folder / MANIFEST) for folder in [self.folder, *tried])
        raise UserError(f"{name}: touch 'recorded' finds no recording of it: neither {folders} is there")
