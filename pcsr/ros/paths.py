"""Paths of bags, and of topics in them: `scan.mcap:/camera/points`."""

import os
import re
from contextlib import suppress
from pathlib import Path

SUFFIXES = (".bag", ".mcap", ".db3")
"""Suffixes of bags: of ROS 1, and the two kinds of files of ROS 2."""
METADATA = "metadata.yaml"
"""File that describes the bag of ROS 2 in a folder."""
TOPIC = re.compile(r"(?P<bag>.{2,}):(?P<topic>[^:]*)", re.DOTALL)
"""A path with a topic. No bag has a name of one letter, so that the drive of `C:/scan.ply` is none."""


def is_bag(path: Path) -> bool:
    """Return whether a path is that of a bag: by its suffix, or a folder with the files of ROS 2."""
    if path.suffix.lower() in SUFFIXES:
        return True
    with suppress(OSError):
        return os.path.isdir(path) and bool(files_of(path))
    return False


def files_of(folder: Path) -> list[Path]:
    """Return what is read of a folder: itself if it has a `metadata.yaml`, otherwise its files of ROS 2, by name."""
    if (folder / METADATA).is_file():
        return [folder]
    return sorted(path for path in folder.iterdir() if path.suffix in (".mcap", ".db3") and path.is_file())


def bag_and_topic(path: Path) -> tuple[Path, str | None] | None:
    """Split a path into the bag that it names, and a topic.

    Args:
        path: path of a cloud as people write it.

    Returns:
        Path of the bag, and the topic or None; None for the path of another file.

    Examples:
        >>> bag_and_topic(Path("scan.mcap:/camera/points"))[1]
        '/camera/points'
        >>> bag_and_topic(Path("scan.bag"))[1] is None, bag_and_topic(Path("scan.ply")) is None
        (True, True)
    """
    if is_bag(path):
        return path, None
    parts = split(path.as_posix())
    if parts is None or os.path.lexists(path) or not is_bag(Path(parts[0])):
        return None
    return Path(parts[0]), parts[1]


def split(text: str) -> tuple[str, str] | None:
    """Split a path with slashes at its last colon, into what may be a bag and a topic; None if there is no such colon.

    Examples:
        >>> split("C:/scan.mcap:/camera/points"), split("C:/scan.ply")
        (('C:/scan.mcap', '/camera/points'), None)
    """
    match = TOPIC.fullmatch(text)
    return None if match is None else (match["bag"], f"/{match['topic'].strip('/')}")
