"""Pictures in rows, with their captions and the scale of their colours, as one picture."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw

from pcsr.report.lettering import INK, LINE, PAPER, SOFT, fitted, font
from pcsr.report.pictures import error_colours

GAP = 10
CAPTION, TITLE = 24, 34
"""Heights of their lines."""
BAR = (240, 12)
"""Width and height of the scale of colours."""


@dataclass(frozen=True)
class Panel:
    """A picture and what it shows."""

    caption: str
    image: UInt8[np.ndarray, "h w 3"]


def sheet(title: str, rows: Sequence[Sequence[Panel]], end: float | None = None) -> Image.Image:
    """Set panels of one size in rows.

    Args:
        title: above all of them.
        rows: at least one panel; a row may be shorter than another.
        end: the error at the end of the scale of colours, ×10⁻³; None: nothing is coloured by its error.
    """
    high, wide, _ = rows[0][0].image.shape
    columns = max(map(len, rows))
    size = (
        GAP + columns * (wide + GAP),
        TITLE + len(rows) * (CAPTION + high + GAP) + (0 if end is None else CAPTION + GAP),
    )
    page = Image.new("RGB", size, PAPER)
    pen = ImageDraw.Draw(page)
    pen.text((GAP, 8), fitted(title, 16, size[0] - 2 * GAP), INK, font(16))
    for i, row in enumerate(rows):
        for j, panel in enumerate(row):
            x, y = GAP + j * (wide + GAP), TITLE + i * (CAPTION + high + GAP)
            pen.text((x, y + 4), fitted(panel.caption, 13, wide), SOFT, font(13))
            page.paste(Image.fromarray(panel.image), (x, y + CAPTION))
            pen.rectangle((x, y + CAPTION, x + wide - 1, y + CAPTION + high - 1), outline=LINE)
    if end is not None:
        _bar(page, (GAP, size[1] - CAPTION), end)
    return page


def _bar(page: Image.Image, place: tuple[int, int], end: float) -> None:
    width, height = BAR
    colours = np.round(255 * error_colours(np.linspace(0, end, width), end)).astype(np.uint8)
    x, y = place
    pen = ImageDraw.Draw(page)
    pen.text((x, y + height / 2), "0", SOFT, font(13), "lm")
    page.paste(Image.fromarray(np.broadcast_to(colours, (height, width, 3)).copy()), (x + 16, y))
    said = fitted(f"{end:.3g} ×10⁻³ from the nearest true point", 13, page.width - x - width - 30)
    pen.text((x + 24 + width, y + height / 2), said, SOFT, font(13), "lm")
