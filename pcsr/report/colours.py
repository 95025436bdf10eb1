"""Colours of the report's pages and figures, safe for colour-blind readers."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, UInt8

SERIES = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9"]
"""Colours of lines and bars, one for each series, after Okabe and Ito (2008, https://jfly.uni-koeln.de/color/)."""
ERROR_SCALE: list[tuple[float, str]] = [(0.0, "#8fabc6"), (0.5, "#dc861f"), (1.0, "#b3161f")]
"""Colour scale of errors: fraction of the scale, and colour. Lightness falls along the scale."""
VALUE_SCALE: list[tuple[float, str]] = [
    (0.0, "#46409c"),
    (0.25, "#2a7a9e"),
    (0.5, "#22a884"),
    (0.75, "#7ad151"),
    (1.0, "#f2d024"),
]
"""Colour scale of any numbers, after viridis: fraction of the scale, and colour. Lightness rises along the scale."""
CLASSES = [
    *SERIES,
    *("#882255", "#8c8c2b", "#44aa99", "#6f4bb2", "#b15928", "#7fb93a"),
    *("#00456b", "#9a6b00", "#006b4e", "#96476f", "#8f3f00", "#2a7ca8"),
    *("#e0579a", "#c2b83a", "#1c7c80", "#a98be0", "#7a4a2a", "#4a7a1c"),
]
"""Colours of classes; the first ones are the easiest to distinguish."""
MARK = "#e69f00"
"""Colour of recorded touches beside points of any other colours."""
INPUT, TOUCH, TRUTH = "#1f6fb2", "#d0202b", "#4a5560"
"""Colours of clouds, equal to those of page.css in a bright room."""
INK, SOFT, LINE = "#1c2024", "#5d6670", "#d9dee3"
"""Colours of text, secondary text and frames, equal to those of page.css in a bright room."""


def value_colours(share: Float[np.ndarray, "*shape"]) -> UInt8[np.ndarray, "*shape 3"]:
    """Return red, green and blue on `VALUE_SCALE` for shares from 0 to 1."""
    places = [place for place, _ in VALUE_SCALE]
    colours = np.array([list(bytes.fromhex(colour[1:])) for _, colour in VALUE_SCALE])
    channels = [np.interp(share, places, colours[:, k]) for k in range(3)]
    return np.stack(channels, axis=-1).round().astype(np.uint8)


def row_colours(rows: Sequence[object]) -> list[str]:
    """Colours of the rows of a comparison, in their order: a method has the same one in each table and figure."""
    return [CLASSES[k % len(CLASSES)] for k in range(len(rows))]
