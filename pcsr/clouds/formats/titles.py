"""Names of the columns of a text file: from its first lines, from a comment, or given by the user."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from pcsr.clouds.formats.column_names import find_axes, has_axis, in_degrees, split_names
from pcsr.clouds.formats.preamble import Preamble
from pcsr.errors import UserError

SAY = "or say them by --columns, such as --columns x,y,z,-,intensity"
MARK = re.compile(r"^\s*(?:#|//|%)+[\s;,|]+")
"""Mark of a comment and a separator after it: "#;x;y;z", where the mark may be the name of a column too."""
LABEL = re.compile(r"[:=]")
"""End of a label ahead of names: "Columns: x y z"."""


@dataclass
class Names:
    """Names of columns, and where the coordinates are among them."""

    names: list[str] = field(default_factory=list)
    """Names by index of column; empty where a column has none."""
    axes: list[int] = field(default_factory=list)
    """Indices of the columns x, y and z."""
    line: str = ""
    """Line that holds the names."""
    header: bool = False
    """Whether that line is no comment."""
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


def find_names(head: Preamble) -> list[Names]:
    """Find the lines with names of columns, x, y and z among them: the last titles first, then the last comments.

    Raises:
        UserError: the file holds poses of cameras.
    """
    found: list[Names] = []
    for lines, header in ((head.titles, True), (head.comments, False)):
        for line in reversed(lines):
            bare = MARK.sub("", line)
            for text in dict.fromkeys((line, bare, LABEL.split(line, maxsplit=1)[-1])):
                names = split_names(text)
                if "IMAGE_ID" in names[:1]:
                    raise UserError("it holds the images of a COLMAP model, no points: name points3D.txt")
                if axes := find_axes(names):
                    rest = names.pop() if names[-1].endswith("[]") else ""
                    while names and not names[-1]:
                        names.pop()
                    found.append(Names(names, axes, line, header, rest=rest))
    return found


def choose_names(found: Sequence[Names], head: Preamble, rows: Sequence[Sequence[str]], *, must: bool) -> Names:
    """Return the names that the file has for its columns, as many as its lines have.

    Args:
        found: lines with names, x, y and z among them.
        head: lines ahead of the numbers.
        rows: words of the first lines with numbers.
        must: whether names, if there are any, must include x, y and z.

    Raises:
        UserError: the names do not fit the lines, or do not say which columns are the coordinates.
    """
    width = max(map(len, rows))
    filled = max(i + 1 for row in rows for i, word in enumerate(row) if word)
    fitting = [each for each in found if each.rest or filled <= len(each.names) <= width]
    if not found:
        return _without_axes(head, width, must=must)
    best = (fitting or found)[0]
    names, count = list(best.names), len(best.names)
    notes = _left_out([title for title in head.titles if title is not best.line])
    if best.rest:
        if count > min(map(len, rows)):
            raise UserError(f"its comment names {count} columns, and a line has {min(map(len, rows))}: {SAY[3:]}")
        if width > count:
            notes.append(f"the lists '{best.rest}' at the end of its lines are left out")
    elif not fitting:
        if best.header:
            raise UserError(f"its line of names has {count} columns, the line after it has {width}: correct it, {SAY}")
        if best.axes != [0, 1, 2]:
            raise UserError(f"its comment names {count} columns, its lines have {width}: correct it, {SAY}")
        if count > 3:
            notes.append(f"its comment names {count} columns, its lines have {width}: only x, y and z are named")
        names = names[:3]
    names += [""] * (0 if best.rest else width - len(names))
    return Names(names, best.axes, best.line, best.header, rest=best.rest, notes=notes)


def check_given(names: Sequence[str], head: Preamble, width: int) -> Names:
    """Return names that the user gave.

    Raises:
        UserError: there are more names than columns.
    """
    if len(names) > width:
        raise UserError(f"--columns names {len(names)} columns, line {head.line} has {width}: name as many")
    return Names(list(names), find_axes(names), given=True)


def _without_axes(head: Preamble, width: int, *, must: bool) -> Names:
    """Return the names that a last title has for all columns, none of which is a coordinate's, or none."""
    names = split_names(head.titles[-1]) if head.titles else []
    shown = ", ".join(names)[:200]
    if len(names) != width:
        if has_axis(names):
            raise UserError(
                f"its line of names, {shown}, does not name x, y and z of {width} columns: correct it, {SAY}"
            )
        return Names(axes=[0, 1, 2], notes=_left_out(head.titles))
    if in_degrees(names):
        raise UserError(f"its columns are {shown}, which are degrees: project them to metres, {SAY}")
    if must or has_axis(names):
        raise UserError(f"its columns are {shown}: name those of the coordinates x, y and z, {SAY}")
    note = f"its columns are {shown}: the first three were taken for x, y and z"
    return Names(names, [0, 1, 2], header=True, notes=[*_left_out(head.titles[:-1]), note])


def _left_out(titles: Sequence[str]) -> list[str]:
    if not titles:
        return []
    lines = "1 line ahead of its points is" if len(titles) == 1 else f"{len(titles)} lines ahead of its points are"
    return [f"{lines} left out, such as '{titles[0].strip()[:60]}'"]
