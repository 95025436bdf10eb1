"""Reading and writing of cloud files, whose formats `format_table` lists; of meshes the vertices are read."""

from pcsr.clouds.formats.format_table import CLOUD_READERS, CLOUD_WRITERS, NAMED_READERS, TEXT_READERS
from pcsr.clouds.formats.reading import read_cloud, read_cloud_pipe, read_points
from pcsr.clouds.formats.writing import check_finite_only, cloud_bytes, writable, write_cloud, write_points

__all__ = [
    "CLOUD_READERS",
    "CLOUD_WRITERS",
    "NAMED_READERS",
    "TEXT_READERS",
    "check_finite_only",
    "cloud_bytes",
    "read_cloud",
    "read_cloud_pipe",
    "read_points",
    "writable",
    "write_cloud",
    "write_points",
]
