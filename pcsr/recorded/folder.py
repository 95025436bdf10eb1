"""Folder of a recording: its manifest and data files are written together or not at all."""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from pcsr.clouds.pose_error import PoseError
from pcsr.errors import RunError, UserError
from pcsr.files import inside, write_bytes, write_text
from pcsr.recorded.reading import MANIFEST

FILE_KEYS = ("cloud", "order", "height", "depth", "image", "background", "mask", "calibration")
"""Keys of a manifest and its entries that name data files."""


def manifest_text(head: dict[str, Any], entries: Sequence[dict[str, Any]], pose_error: PoseError | None = None) -> str:
    """Return the text of a manifest.

    Args:
        head: keys that all touches share.
        entries: entry of each touch.
        pose_error: error of the poses; None if it is unknown.
    """
    error = (
        {} if pose_error is None else {"position": float(pose_error.position), "rotation": float(pose_error.rotation)}
    )
    text = json.dumps(head | ({"pose_error": error} if error else {}), indent=1)[:-2] + ',\n "touches": [\n  '
    return text + ",\n  ".join(json.dumps(entry, allow_nan=False) for entry in entries) + "\n ]\n}\n"


def check_free(folder: Path, *, overwrite: bool) -> None:
    """Check that a recording can be written to a folder.

    Raises:
        UserError: it holds a recording already, which is not to be overwritten, or is a file.
    """
    if _files_of(folder / MANIFEST) is not None and not overwrite:
        raise UserError(f"{folder} holds a recording already: choose another folder, or overwrite it (--overwrite)")


def write_folder(folder: Path, manifest: str, files: Mapping[str, Callable[[], bytes]], *, overwrite: bool) -> None:
    """Write the files of a recording. The manifest is written last, so that a folder without one is not finished.

    Args:
        folder: folder to write to; it need not exist.
        manifest: text of `touches.json`.
        files: function that returns the content of each data file, by the file's name.
        overwrite: replace the recording in the folder.

    Raises:
        UserError: the folder holds a recording already, or a file that does not belong to one would be overwritten.
        RunError: a file cannot be written.
    """
    check_free(folder, overwrite=overwrite)
    old = _files_of(folder / MANIFEST) or set()
    foreign = [file for file in files.keys() - old if not _free(folder / file, files[file])]
    if foreign:
        raise UserError(f"{folder / foreign[0]} exists already and belongs to no recording: choose another folder")
    try:
        (folder / MANIFEST).unlink(missing_ok=True)  # first: it must never describe the new files
        for file in sorted(old - files.keys()):
            inside(folder, file).unlink(missing_ok=True)
    except OSError as error:
        raise RunError(f"{folder}: the old recording cannot be replaced: {error.strerror or error}") from error
    written: list[Path] = []
    new = not folder.exists()
    try:
        for file, content in files.items():
            written.append(folder / file)
            write_bytes(folder / file, content())
        write_text(folder / MANIFEST, manifest)
    except BaseException:  # KeyboardInterrupt too: an incomplete recording is removed
        for path in written:
            path.unlink(missing_ok=True)
        if new and folder.is_dir():
            folder.rmdir()
        raise


def _files_of(manifest: Path) -> set[str] | None:
    """Return the data files of the recording in a folder, or None if there is no recording.

    Raises:
        UserError: the folder is a file, or cannot be read.
    """
    try:
        if not manifest.exists():
            if manifest.parent.exists() and not manifest.parent.is_dir():
                raise UserError(f"{manifest.parent} is a file: a recording is a folder")
            return None
        plain = json.loads(manifest.read_text(encoding="utf-8"))
        entries = plain["touches"]
        parts = [plain, *(part for entry in entries for part in (entry, *entry.get("fingers", ())))]
        return {str(part[key]) for part in parts for key in FILE_KEYS if part.get(key)}
    except OSError as error:
        raise UserError(f"{manifest.parent} cannot be written to: {error.strerror or error}") from error
    except (ValueError, LookupError, TypeError, AttributeError):
        return set()  # a manifest that is damaged or of another layout: none of its files is removed


def _free(path: Path, content: Callable[[], bytes]) -> bool:
    """Return whether a file may be written: it does not exist, or an interrupted write left this very content."""
    if not path.exists():
        return True
    with suppress(OSError):
        return path.is_file() and path.read_bytes() == content()
    return False
