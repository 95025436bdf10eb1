"""Choice and progress of `pcsr upsample` for clouds that are read and written in parts."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from pcsr.errors import UserError

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

MOST_IN_MEMORY = 2_000_000
"""Clouds with more points are read and written in parts, where their formats allow it."""
PIPE = Path("-")


def is_streamed(
    cloud: Path,
    suffix: str | None,
    out: Path,
    asked: bool | None,
    *,
    mesh: Path | None,
    columns: str | None,
    denoise: bool,
) -> bool:
    """Return whether a cloud is read and written in parts.

    Args:
        cloud: path of the input, or `PIPE`.
        suffix: chosen format of the input.
        out: path of the result, or `PIPE`.
        asked: value of `--stream`; None if it was not given.
        mesh: value of `--mesh`.
        columns: value of `--columns`.
        denoise: whether `--denoise` was given.

    Raises:
        UserError: it was asked for, and is not possible.
    """
    from pcsr.clouds.formats.chunks import CHUNKED, REMEDY, open_chunks

    if asked is False:
        return False
    obstacle = ""
    if cloud == PIPE:
        obstacle = "IN is a pipe, which can be read only once: name a file"
    elif out == PIPE:
        obstacle = "OUT is a pipe, which cannot be continued after an interruption: name a file"
    elif mesh is not None:
        obstacle = "--mesh needs the whole cloud in memory: leave one of the two out"
    elif denoise:
        obstacle = "--denoise needs the whole cloud in memory: leave one of the two out"
    elif columns is not None:
        obstacle = f"--columns is for text, which cannot be read in parts: {REMEDY}"
    elif out.suffix.lower() not in CHUNKED:
        obstacle = f"{out} cannot be written in parts: name a {', '.join(CHUNKED)} file"
    if not obstacle and (asked or _is_chunked(cloud, suffix)):
        try:
            count = open_chunks(cloud, suffix).count
        except (UserError, OSError) as error:
            if asked and isinstance(error, OSError):
                raise UserError(f"--stream: {cloud} cannot be read in parts: {error.strerror}") from error
            if asked:
                raise
            return False  # the reader for clouds in memory reports what is wrong
        return asked or count > MOST_IN_MEMORY
    if asked:
        raise UserError(f"--stream: {obstacle}")
    return False


def _is_chunked(cloud: Path, suffix: str | None) -> bool:
    from pcsr.clouds.formats.chunks import CHUNKED
    from pcsr.clouds.formats.format_table import format_of

    try:
        return format_of(cloud, suffix) in CHUNKED and cloud.is_file()
    except (UserError, OSError):
        return False


def stages(progress: "Progress") -> Callable[[str, int, int], None]:
    """Return a function that shows the progress of `upsample_file`, with a bar for each kind of work."""
    tasks: dict[str, TaskID] = {}

    def advance(what: str, done: int, total: int) -> None:
        if what not in tasks:
            tasks[what] = progress.add_task(what, total=total, completed=done)
        progress.update(tasks[what], completed=done, total=total)

    return advance
