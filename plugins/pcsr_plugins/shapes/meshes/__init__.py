"""Shapes `meshes`: the mesh files of a folder, split so that variants of one object stay together."""

import hashlib
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import Annotated

import numpy as np
import trimesh
from pydantic import Field

from pcsr import ShapeItem, ShapeSource, UserError, read_mesh
from pcsr_plugins.shapes.meshes.table import read_table
from pcsr_plugins.shapes.shared.soundness import check_mesh

SUFFIXES = (".glb", ".obj", ".off", ".ply", ".stl")
SPLITS = ("train", "validation", "test")


class Meshes(ShapeSource):
    """STL, OBJ, PLY, OFF and GLB files anywhere under a folder.

    Files of one sub-folder are one group and fall to one split, so that variants of an object never straddle
    two; a file at the top is a group of its own. The split depends on the group's name and the seed alone:
    adding or removing files moves no other file. A table may give both instead.
    """

    path_options = frozenset({"folder", "table"})

    def __init__(
        self,
        *,
        folder: str,
        table: str | None = None,
        validation: float = 0.1,
        test: float = 0.1,
        seed: Annotated[int, Field(ge=-(2**63), lt=2**63)] = 0,
    ) -> None:
        """Look at nothing but the table and whether the folder is there.

        Args:
            folder: where the files are.
            table: a CSV file with the columns `file`, `split` and, if wanted, `group`; shares and seed then mean
                nothing. An empty split leaves a file out.
            validation: the share of groups that validate, 0 to 1.
            test: the share of groups that test, 0 to 1.
            seed: another seed, another split.

        Raises:
            UserError: no such folder or table, or the shares leave nothing to train on.
        """
        self.folder = Path(folder).expanduser()
        self.validation, self.test, self.seed = validation, test, seed
        if not self.folder.is_dir():
            raise UserError(f"meshes: folder '{folder}' is not there: give one with {_suffixes()} files")
        if not (0 <= validation < 1 and 0 <= test < 1 and validation + test < 1):
            raise UserError(
                f"meshes: validation {validation} and test {test} must be shares of 1, together less than 1"
            )
        self.rows = None if table is None else read_table(Path(table).expanduser(), self.folder)

    def names(self, split: str) -> Sequence[str]:
        """Paths below the folder, with forward slashes, sorted.

        Raises:
            UserError: an unknown split, a folder without meshes, a split that no group fell to, or files that the
                table doesn't name.
        """
        if split not in SPLITS:
            raise UserError(f"meshes has no split '{split}': it has {', '.join(SPLITS)}")
        found = sorted(
            path.relative_to(self.folder).as_posix()
            for path in self.folder.rglob("*")
            if path.suffix.lower() in SUFFIXES and path.is_file()
        )
        if not found:
            raise UserError(f"meshes: no {_suffixes()} file is anywhere under '{self.folder}'")
        if self.rows is not None:
            unnamed = sorted(set(found) - self.rows.keys())
            if unnamed:
                raise UserError(
                    f"meshes: the table doesn't name {len(unnamed)} of the {len(found)} files under '{self.folder}', "
                    f"such as '{unnamed[0]}': add them, with an empty split to leave them out"
                )
            # A row whose file is missing stays: it is counted among those that could not be used.
            return sorted(name for name, row in self.rows.items() if row.split == split)
        names = [name for name in found if self._split(group_of(name)) == split]
        if not names and (split == "train" or getattr(self, split) > 0):
            groups = len({group_of(name) for name in found})
            raise UserError(
                f"meshes: none of the {groups} groups under '{self.folder}' fell to "
                f"'{split}': take another seed, another share, or sort the files into more sub-folders"
            )
        return names

    def item(self, name: str) -> ShapeItem:
        """Load one file; the meshes of a scene are joined into one.

        Raises:
            UserError: no such file, one that cannot be read, or a mesh that `check_mesh` refuses.
        """
        inside = PurePosixPath(name)
        path = self.folder / inside
        if inside.is_absolute() or ".." in inside.parts or not path.is_file():
            raise UserError(f"meshes: '{name}' is not a file under '{self.folder}'")
        group = group_of(name) if self.rows is None or name not in self.rows else self.rows[name].group
        return ShapeItem(name, group, _load(path))

    def digest(self, name: str) -> str:
        """Hash of the file and of its group."""
        path = self.folder / name
        if not path.is_file():
            return "missing"
        with path.open("rb") as file:
            content = hashlib.file_digest(file, "sha256").hexdigest()
        return content if self.rows is None else f"{content} {self.rows[name].group}"

    def _split(self, group: str) -> str:
        digest = hashlib.sha256(f"{self.seed}/{group}".encode()).digest()
        place = int.from_bytes(digest[:8], "big") / 2**64
        if place < self.test:
            return "test"
        return "validation" if place < self.test + self.validation else "train"


def group_of(name: str) -> str:
    """The sub-folder that a file is in, or the file itself at the top."""
    parent = PurePosixPath(name).parent.as_posix()
    return name if parent == "." else parent


def _suffixes() -> str:
    return ", ".join(SUFFIXES)


def _load(path: Path) -> trimesh.Trimesh:
    """The file's triangles, checked, then with equal corners merged: STL repeats each for every face."""
    mesh = check_mesh(read_mesh(path), str(path))
    # Equal to the last bit: trimesh's own merging has a grid of 1e-8, in whatever unit the file is.
    corners, of = np.unique(np.asarray(mesh.vertices, np.float64), axis=0, return_inverse=True)
    return trimesh.Trimesh(corners, of.reshape(-1)[np.asarray(mesh.faces)], process=False)
