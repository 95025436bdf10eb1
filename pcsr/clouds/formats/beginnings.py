"""What files of each kind begin with: what is something else is refused before it is read."""

from pcsr.clouds.formats.digits import check_lines
from pcsr.errors import UserError

MAGIC = {
    b"ply\n": (".ply",),
    b"ply\r": (".ply",),
    b"# .PCD": (".pcd",),
    b"VERSION": (".pcd",),
    b"\x93NUMPY": (".npy",),
    b"PK\x03\x04": (".npz",),
    b"glTF": (".glb",),
    b"LASF": (".las", ".laz"),
}
"""What files of a kind begin with."""
FOREIGN = {
    b"\x1f\x8b": "gzip",
    b"BZh": "bzip2",
    b"\xfd7zXZ\0": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"\x89HDF": "HDF5",
    b"%PDF": "PDF",
}
"""What files begin with that no cloud is read from."""
BEGINNINGS = {
    ".ply": b"ply",
    ".npy": b"\x93NUMPY",
    ".npz": b"PK",
    ".glb": b"glTF",
    ".las": b"LASF",
    ".laz": b"LASF",
}
"""What a file of a kind must begin with."""
TEXT = (".xyz", ".txt", ".csv", ".obj", ".off")
"""Kinds that are text in any case."""


def check_start(head: bytes, suffix: str, name: str) -> None:
    """Refuse by its beginning what is another kind of file.

    Args:
        head: the first megabyte, or all that there is.
        suffix: of the kind that it should be: ".ply".
        name: what messages call it.

    Raises:
        UserError: it is empty, or of another kind.
    """
    suffix = suffix.lower()
    if not head:
        raise UserError(f"{name} cannot be read as a {suffix} file: it is empty (0 bytes) and holds no points")
    for magic, suffixes in MAGIC.items():
        if head.startswith(magic) and suffix not in suffixes:
            raise UserError(f"{name} is a {suffixes[0]} file by its content, not a {suffix}: rename it")
    for magic, kind in FOREIGN.items():
        if head.startswith(magic):
            raise UserError(f"{name} is a {kind} file by its content, not a {suffix}: unpack or convert it")
    if not head.startswith(BEGINNINGS.get(suffix, b"")):
        shown = BEGINNINGS[suffix].decode("ascii", "ignore")
        raise UserError(f"{name} cannot be read as a {suffix} file: it does not begin with '{shown}'")
    if suffix in TEXT:
        try:
            check_lines(head)
        except UserError as error:
            raise UserError(f"{name}: {error}") from error
