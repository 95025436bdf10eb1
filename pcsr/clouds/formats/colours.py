"""Colours of clouds, converted to the range that a format has for them."""

from collections.abc import Mapping

import numpy as np

from pcsr.clouds.columns import COLOURS, SHORT_COLOURS, colour_names


def unpacked(packed: np.ndarray) -> np.ndarray:
    """Unpack red, green, blue and alpha (n, 4) from 32-bit numbers 0xAARRGGBB, as the Point Cloud Library packs them.

    Args:
        packed: integers, or floats with the same bits.
    """
    bits = packed.view(np.uint32) if packed.dtype.kind == "f" else packed.astype(np.uint32)
    return np.stack([(bits >> shift).astype(np.uint8) for shift in (16, 8, 0, 24)], axis=-1)


def brightest(columns: Mapping[str, np.ndarray], names: list[str]) -> float | None:
    """Return the number that stands for full brightness: 1, 255 or 65535; None if these are no colours in such a range.

    Args:
        columns: columns of a cloud.
        names: names of those that hold the channels.
    """
    values = [columns[name] for name in names]
    if any(value.dtype.kind not in "iuf" for value in values):
        return None
    if all(value.dtype == np.uint8 for value in values):
        return 255.0
    lowest = min((float(value.min()) for value in values if value.size), default=0.0)
    highest = max((float(value.max()) for value in values if value.size), default=0.0)
    if not lowest >= 0:  # also NaN
        return None
    floats = all(value.dtype.kind == "f" for value in values)
    return next((most for most in ((1.0,) if floats else ()) + (255.0, 65535.0) if highest <= most), None)


def in_bytes(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Convert colours to 8 bits under the names red, green, blue and alpha, as most programs expect.

    Colours from 0 to 1 and of 16 bits are scaled. Columns of other ranges are kept, as is everything else.

    Args:
        columns: columns of a cloud, each (n,).
    """
    names = [name for name in colour_names(columns) if columns[name].ndim == 1]
    most = brightest(columns, names) if names else None
    if most is None:
        return dict(columns)
    long = dict(zip(SHORT_COLOURS, COLOURS, strict=False))
    lower = {name.lower() for name in columns}
    converted: dict[str, np.ndarray] = {}
    for name, column in columns.items():
        if name not in names:
            converted[name] = column
            continue
        standard = name.lower()
        if standard in long and long[standard] not in lower:
            standard = long[standard]
        taken = standard != name and (standard in columns or standard in converted)
        converted[name if taken else standard] = _bytes(column, most)
    return converted


def _bytes(column: np.ndarray, most: float) -> np.ndarray:
    if column.dtype == np.uint8:
        return column
    if most > 255:  # the high byte, whether 8 bits were multiplied by 256 or by 257
        return (column.astype(np.float64) // 256).astype(np.uint8)
    return np.rint(column.astype(np.float64) * (255 / most)).astype(np.uint8)
