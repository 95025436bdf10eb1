"""Recognition of file formats by the first bytes, before a file is read."""

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
    b"ASTM-E57": (".e57",),
}
"""First bytes by which a supported format is recognised, and its suffixes."""
FOREIGN = {
    b"\x1f\x8b": "gzip",
    b"BZh": "bzip2",
    b"\xfd7zXZ\0": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"\x89HDF": "HDF5",
    b"%PDF": "PDF",
}
"""First bytes by which an unsupported format is recognised, and its name."""
BEGINNINGS = {
    ".ply": b"ply",
    ".npy": b"\x93NUMPY",
    ".npz": b"PK",
    ".glb": b"glTF",
    ".las": b"LASF",
    ".laz": b"LASF",
    ".e57": b"ASTM-E57",
}
"""First bytes that a file of a format must have, by suffix."""
TEXT = (".xyz", ".txt", ".asc", ".csv", ".pts", ".ptx", ".obj", ".off")
"""Suffixes of formats that are always text."""


def check_start(head: bytes, suffix: str, name: str) -> None:
    """Check by its beginning that a file has the format of its suffix.

    Args:
        head: beginning of the file, at most `pcsr.inputs.HEAD` bytes.
        suffix: suffix of the expected format, such as ".ply", or its name. A file of a format without suffix may begin
            with any bytes.
        name: name of the file in error messages.

    Raises:
        UserError: the file is empty or has another format.
    """
    suffix = suffix.lower()
    if not head:
        raise UserError(f"{name} cannot be read as a {suffix} file: it is empty (0 bytes) and holds no points")
    if not suffix.startswith("."):
        return
    for magic, suffixes in MAGIC.items():
        if head.startswith(magic) and suffix not in suffixes:
            raise UserError(
                f"{name} is a {suffixes[0]} file by its content, not a {suffix}: rename it, or correct --format"
            )
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
