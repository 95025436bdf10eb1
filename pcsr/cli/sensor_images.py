"""Camera images that are named in a command line, one by one or by their folders, and reasons why some are not used."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import click

from pcsr.errors import UserError, printable

MOST_LISTED = 20
"""Most images whose reasons are printed."""


def image_files(given: Sequence[Path], what: str, without: Iterable[Path] = ()) -> list[Path]:
    """Return files that are named, and the images in folders that are named, sorted by name.

    Of a folder without images those in its folders are returned, as some programs write a folder for each press.

    Args:
        given: files and folders.
        what: what names them, for the message: "IMAGE", "--press".
        without: files that a folder may contain, but which are not meant by it, such as the background.

    Raises:
        UserError: there is no such file or folder, or a folder has no image.
    """
    from pcsr.sensors.images import SUFFIXES

    other = {path.resolve() for path in without}
    found = []
    for path in given:
        if not path.is_dir():
            if not path.exists():
                raise UserError(f"{what} {path}: there is no such file or folder")
            found.append(path)
            continue
        inside = _images(path.glob("*"), other) or _images(path.glob("*/*"), other)
        if not inside:
            raise UserError(f"{what} {path}: the folder has no image ({', '.join(SUFFIXES)})")
        found += inside
    return found


def _images(files: Iterable[Path], without: set[Path]) -> list[Path]:
    from pcsr.sensors.images import SUFFIXES

    return sorted(
        one
        for one in files
        if one.suffix.lower() in SUFFIXES and one.name[0] != "." and one.is_file() and one.resolve() not in without
    )


def check_distinct(files: Iterable[Path]) -> None:
    """Check that no file is given twice.

    Raises:
        UserError: one is.
    """
    seen: dict[Path, Path] = {}
    for file in files:
        first = seen.setdefault(file.resolve(), file)
        if first is not file:
            also = "" if str(first) == str(file) else f", also as {first}"
            raise UserError(f"{file} is given twice{also}: give each image once")


def name_of(file: Path) -> str:
    """Return the path of an image as a name on one line; control characters and bytes that are no text are escapes."""
    return printable(str(file), lines=False)


def reason(error: UserError, file: Path) -> str:
    """Return the message about a file without its path, which the line begins with."""
    return str(error).replace(f"{name_of(file)} ", "it ", 1)


def echo_reasons(reasons: Mapping[str, str], verb: str) -> None:
    """Print a line for each image that is not used, of at most `MOST_LISTED`, to standard error.

    Args:
        reasons: reason by name.
        verb: what becomes of the image: "is refused".
    """
    for name, why in list(reasons.items())[:MOST_LISTED]:
        click.echo(f"{name} {verb}: {why}", err=True)
    if len(reasons) > MOST_LISTED:
        click.echo(f"and {len(reasons) - MOST_LISTED} more", err=True)
