"""Names of the columns of a text file: from its first lines, from a comment, or given by the user."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from pcsr.clouds.formats.column_names import find_axes, has_axis, in_degrees, split_names
from pcsr.clouds.formats.preamble import Preamble
from pcsr.errors import UserError

SAY = "or say them by --columns, such as --columns x,y,z,-,intensity"


@dataclass
class Names:
    """Names of columns, and where the coordinates are among them."""

    names: list[str] = field(default_factory=list)
    """Names by index of column; empty where a column has none."""
    axes: list[int] = field(default_factory=list)
    """Indices of the columns x, y and z; nothing if no name says it."""
    header: bool = False
    """Whether a line that is no comment holds the names."""
    given: bool = False
    """Whether the user gave the names."""
    rest: str = ""
    """Name of a list of varying length at the end of each line, such as COLMAP's TRACK[]."""
    notes: list[str] = field(default_factory=list)
    """What was guessed or left out."""

    @property
    def named(self) -> bool:
        """Whether a column beside the coordinates has a name."""
        return any(name for i, name in enumerate(self.names) if i not in self.axes)

    @property
    def width(self) -> int | None:
        """Number of columns, as far as the names say it."""
        return len(self.names) if self.axes and not self.rest else None


def find_names(head: Preamble, given: Sequence[str] | None) -> Names:
    """Find the names of columns that include those of the coordinates.

    The user's names come first, then the last line without a comment mark, then the last comment.

    Raises:
        UserError: the file holds poses of cameras.
    """
    if given is not None:
        return Names(list(given), find_axes(given), bool(head.titles), given=True)
    for lines, header in ((head.titles, True), (head.comments, False)):
        for line in reversed(lines):
            names = split_names(line)
            if "IMAGE_ID" in names[:1]:
                raise UserError("it holds the images of a COLMAP model, no points: name points3D.txt")
            if axes := find_axes(names):
                rest = names.pop() if names[-1].endswith("[]") else ""
                notes = _left_out([title for title in head.titles if title is not line])
                return Names(names, axes, header, rest=rest, notes=notes)
    return Names()


def settle(found: Names, head: Preamble, width: int, *, must: bool) -> Names:
    """Return names of as many columns as the lines have.

    Args:
        found: names that include those of the coordinates, or none.
        head: lines ahead of the numbers.
        width: number of columns of the lines.
        must: whether names, if there are any, must include x, y and z.

    Raises:
        UserError: the names do not fit the lines, or do not say which columns are the coordinates.
    """
    if not found.axes:
        found = _without_axes(head, width, must=must)
    names = list(found.names)
    if found.given:
        if len(names) > width:
            raise UserError(f"--columns names {len(names)} columns, its lines have {width}: name as many")
        return found
    while len(names) > width and not names[-1]:
        names.pop()
    if found.rest:
        if len(names) > width:
            raise UserError(f"its comment names {len(names)} columns, line {head.line} has {width}")
        found.notes.append(f"the lists '{found.rest}' at the end of its lines are left out")
        return found
    notes = list(found.notes)
    if found.axes and len(names) != width and not _only_empty_beyond(head, len(names)):
        if found.header:
            raise UserError(
                f"its line of names has {len(names)} columns, the line after it has {width}: correct it, {SAY}"
            )
        if found.axes != [0, 1, 2]:
            raise UserError(f"its comment names {len(names)} columns, its lines have {width}: correct it, {SAY}")
        if len(names) > 3:
            notes.append(f"its comment names {len(names)} columns, its lines have {width}: only x, y and z are named")
        names = names[:3]
    names += [""] * (width - len(names))
    return Names(names, found.axes or [0, 1, 2], found.header, notes=notes)


def _without_axes(head: Preamble, width: int, *, must: bool) -> Names:
    """Return the names that a last title has for all columns, none of which is a coordinate's, or none."""
    names = split_names(head.titles[-1]) if head.titles else []
    shown = ", ".join(names)[:200]
    if len(names) != width:
        if has_axis(names):
            raise UserError(
                f"its line of names, {shown}, does not name x, y and z of {width} columns: correct it, {SAY}"
            )
        return Names(notes=_left_out(head.titles))
    if in_degrees(names):
        raise UserError(f"its columns are {shown}, which are degrees: project them to metres, {SAY}")
    if must or has_axis(names):
        raise UserError(f"its columns are {shown}: name those of the coordinates x, y and z, {SAY}")
    note = f"its columns are {shown}: the first three were taken for x, y and z"
    return Names(names, [0, 1, 2], True, notes=[*_left_out(head.titles[:-1]), note])


def _only_empty_beyond(head: Preamble, count: int) -> bool:
    """Return whether the first lines have only separators beyond a number of columns."""
    return all(line.rstrip(" \t,;|").count(mark) < count for line in head.sample for mark in ",;|\t" if mark in line)


def _left_out(titles: Sequence[str]) -> list[str]:
    if not titles:
        return []
    lines = "1 line" if len(titles) == 1 else f"{len(titles)} lines"
    return [f"{lines} ahead of its points are left out, such as '{titles[0].strip()[:60]}'"]
