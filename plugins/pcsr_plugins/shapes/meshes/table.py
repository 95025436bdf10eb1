"""A table of the split and group of each mesh file: CSV with the columns file, split and group."""

import csv
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from pcsr import UserError

SPLITS = {
    "train": "train",
    "training": "train",
    "val": "validation",
    "valid": "validation",
    "validation": "validation",
    "test": "test",
    "": "",
}
"""What people write for a split; an empty one leaves the file out."""


class Row(NamedTuple):
    """A file's row of the table."""

    split: str
    group: str


def read_table(path: Path, folder: Path) -> dict[str, Row]:
    """The rows of a table by the file's path below `folder`; other columns are ignored.

    A path may also begin with the folder's own name, as it does in a table that lies beside the folder. Without a
    group a file is one of its own.

    Raises:
        UserError: the table can't be read, lacks a column, names an unknown split, a path outside the folder, or a
            file twice, or puts one group into two splits.
    """
    rows: dict[str, Row] = {}
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            missing = {"file", "split"} - set(reader.fieldnames or ())
            if missing:
                raise UserError(f"{path} lacks the columns {', '.join(sorted(missing))}: it needs file and split")
            for written in reader:
                name = _below(str(written["file"] or "").strip(), folder)
                place = f"{path}:{reader.line_num}"
                if name is None:
                    raise UserError(f"{place}: '{written['file']}' is not a path below '{folder}'")
                if name in rows:
                    raise UserError(f"{place}: '{name}' is there already: remove one of the two")
                split = str(written["split"] or "").strip().lower()
                if split not in SPLITS:
                    raise UserError(f"{place}: there is no split '{split}': write train, validation, test or nothing")
                rows[name] = Row(SPLITS[split], str(written.get("group") or "").strip() or name)
    except OSError as error:
        raise UserError(f"the table {path} cannot be read: {error.strerror}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"the table {path} is not CSV in UTF-8: {error}") from error
    splits: dict[str, str] = {}
    for name, row in rows.items():
        if row.split and splits.setdefault(row.group, row.split) != row.split:
            raise UserError(
                f"{path}: the group '{row.group}' is in {splits[row.group]} and, with '{name}', in {row.split}: "
                f"what is alike must not straddle two splits"
            )
    if not rows:
        raise UserError(f"the table {path} has no rows")
    return rows


def _below(written: str, folder: Path) -> str | None:
    """A path below the folder, or None."""
    path = PurePosixPath(written.replace("\\", "/"))
    if not path.parts or path.is_absolute() or ".." in path.parts:
        return None
    own = folder.resolve().name
    if path.parts[0] == own and len(path.parts) > 1 and not (folder / path).is_file():
        path = path.relative_to(own)
    return path.as_posix()
