"""Kinds of columns: averaged at new points, taken from the nearest point, or directions."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pcsr.clouds.columns import colour_names, normal_groups, vectors

LABEL_WORDS = re.compile(
    "beam|bin|camera|category|channel|cls|code|count|echo|flags?|frame|gps|group|hits?|ids?|idx|indices|invalid|laser|"
    "line|mask|material|num|object|part|plane|ring|scan|scanner|sem|seg|seq|source|stamp|state|status|tag|tile|times?|"
    "track|type|user|valid|view|visible"
)
"""Words in the names of columns whose values cannot be averaged: classes, identifiers, counts, flags and times."""
LABEL_PARTS = re.compile(
    "class|label|semantic|instance|segment|cluster|timestamp|gpstime|scanid|pointid|objectid|sourceid|userdata|"
    "number|return|original_?cloud|index|edge|synthetic|withheld|overlap|key_?point"
)
"""Parts of such names, for names without separators."""
ANGLE_WORDS = re.compile(
    "angles?|azimuth|bearing|course|dip|direction|euler|heading|hsl|hsv|hue|longitude|phase|phi|pitch|roll|rot|"
    "rotation|strike|theta|yaw"
)
"""Words in the names of angles, whose mean is wrong where they wrap around."""
PACKED = re.compile("bgra?|rgba?")
"""Names of single columns that hold all channels of a colour in one number."""
MEASURED_WORDS = re.compile(
    "amplitude|brightness|curvature|gray|grey|infrared|intensity|luminance|nir|reflectance|reflectivity|roughness|"
    "temperature"
)
"""Words in the names of measured quantities, which are averaged even if they are whole numbers."""
QUATERNION_STEMS = frozenset(("orientation", "q", "quat", "quaternion", "quaternions", "rot", "rotation"))
"""Names of quaternions without the component."""
CHANNEL = re.compile(r"(.*?)(red|green|blue)", re.IGNORECASE)
"""Name of a colour's channel with any prefix."""
FEW = 16
"""Largest number of distinct values of a float column that is taken for a label."""
EACH = 8
"""Smallest mean number of points with the same value in such a column."""
SAMPLE = 1 << 14
"""Number of rows among which distinct values are counted first."""
UNIT = 0.01
"""Largest deviation of the length of a direction from 1."""


@dataclass(frozen=True)
class ColumnKinds:
    """Names of a cloud's columns by the way in which they are carried to new points."""

    nearest: list[str]
    """Columns whose values are those of the nearest point."""
    averaged: list[str]
    """Columns that are averaged."""
    rounded: frozenset[str]
    """Averaged columns of whole numbers, which stay whole."""
    directions: list[list[str]]
    """Groups of columns that hold the components of a direction or quaternion, or one column with all of them."""


def column_kinds(columns: Mapping[str, np.ndarray]) -> ColumnKinds:
    """Determine how each column is carried to new points.

    The first rule that fits a column holds:

    1. Colours, by name (see `colour_names`; red, green and blue may have a prefix), are averaged.
    2. Normals (nx, normal_x, normals …) and quaternions (rot_0, qw, quat_x …), by name, are directions if they are
       floats.
    3. Labels, by name, are taken from the nearest point whatever their type: classes, segments, instances, rings,
       returns, times, identifiers, counts and flags. So are angles (hue, heading …) and colours packed into one number.
    4. Three or four float columns that differ only in the component (dir_x, dir_y, dir_z), and float columns (n, 3) or
       (n, 4), are directions if all rows have length 1.
    5. Measured quantities, by name (intensity, reflectance, temperature, curvature …), are averaged whatever their
       type.
    6. Integers, booleans, floats that are all whole, and floats with few distinct values are taken from the nearest
       point.
    7. Other floats are averaged.

    Averaged columns whose values are all whole stay whole, except colours from 0 to 1.
    """
    floats = {name for name, column in columns.items() if column.dtype.kind == "f"}
    colours = [name for name in _colours(columns) if columns[name].dtype.kind != "b"]
    taken = set(colours)
    directions: list[list[str]] = []

    def take(group: Sequence[str]) -> None:
        if floats.issuperset(group) and taken.isdisjoint(group):
            taken.update(group)
            directions.append(list(group))

    for group in normal_groups(columns):
        take(group)
    for group in _quaternions(columns):
        take(group)
    nearest = {name for name in columns if name not in taken and _is_label(name, columns[name])}
    taken |= nearest
    blocks = [[name] for name, column in columns.items() if column.ndim == 2 and column.shape[1] in (3, 4)]
    for group in [names for size in (4, 3) for *_, names in vectors(columns, size)] + blocks:
        if floats.issuperset(group) and taken.isdisjoint(group):
            values = np.column_stack([columns[name] for name in group])
            if not _whole(values) and _unit_length(values):
                take(group)
    averaged = list(colours)
    for name, column in columns.items():
        if name not in taken:
            measured = column.dtype.kind != "b" and _has_word(name, MEASURED_WORDS)
            is_number = name in floats and not _whole(column) and not _few(column)
            if measured or is_number:
                averaged.append(name)
            else:
                nearest.add(name)
    shares = {name for name in colours if name in floats and bool((columns[name] <= 1).all())}
    rounded = frozenset(name for name in averaged if name not in shares and _whole(columns[name]))
    return ColumnKinds([name for name in columns if name in nearest], averaged, rounded, directions)


def _colours(columns: Mapping[str, np.ndarray]) -> list[str]:
    """Return the names of the columns that hold colours, with prefixes such as diffuse_red too."""
    by_prefix: dict[str, dict[str, str]] = {}
    for name, column in columns.items():
        if column.ndim == 1 and (match := CHANNEL.fullmatch(name)):
            by_prefix.setdefault(match[1].lower(), {})[match[2].lower()] = name
    prefixed = [name for channels in by_prefix.values() if len(channels) == 3 for name in channels.values()]
    return list(dict.fromkeys([*colour_names(columns), *prefixed]))


def _quaternions(columns: Mapping[str, np.ndarray]) -> list[list[str]]:
    groups = [names for stem, _, names in vectors(columns, 4) if stem in QUATERNION_STEMS]
    blocks = [[name] for name, column in columns.items() if column.ndim == 2 and column.shape[1] == 4]
    return groups + [[name] for (name,) in blocks if name.lower().removeprefix("scalar_") in QUATERNION_STEMS]


def _is_label(name: str, column: np.ndarray) -> bool:
    """Return whether a column's name says that its values cannot be averaged."""
    return (
        _has_word(name, LABEL_WORDS)
        or LABEL_PARTS.search(name.lower()) is not None
        or _has_word(name, ANGLE_WORDS)
        or (column.ndim == 1 and _has_word(name, PACKED))
    )


def _has_word(name: str, words: re.Pattern[str]) -> bool:
    """Return whether one of a name's words matches; scalar_GpsTime has the words scalar, gps and time."""
    return any(words.fullmatch(word.lower()) for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name))


def _whole(values: np.ndarray) -> bool:
    """Return whether all finite values are whole numbers."""
    if values.dtype.kind != "f":
        return True
    with np.errstate(invalid="ignore"):  # of signalling NaN
        return bool(((values == np.rint(values)) | ~np.isfinite(values)).all())


def _few(column: np.ndarray) -> bool:
    """Return whether a column has so few distinct values that they look like labels."""
    most = min(FEW, len(column) // EACH)
    sample = column[:: max(1, len(column) // SAMPLE)]
    return len(np.unique(sample)) <= most and len(np.unique(column)) <= most


def _unit_length(values: np.ndarray) -> bool:
    """Return whether all rows have length 1, but for rows of zeros and rows that are not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.linalg.norm(values.astype(np.float64), axis=1)
    length = length[np.isfinite(length) & (length > 0)]
    return len(length) > 0 and bool((np.abs(length - 1) <= UNIT).all())
