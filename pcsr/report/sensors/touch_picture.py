"""Picture of a reading: the camera's image, the indentation and the contact, side by side."""

from io import BytesIO

import numpy as np
from PIL import Image as Pillow
from PIL import ImageDraw, ImageFont

from pcsr.report.colours import MARK, value_colours
from pcsr.sensors import Reading
from pcsr.sensors.images import Image

WIDTHS = (240, 640)
"""Least and greatest width of a panel in pixels."""
LINE = 20
"""Height of the captions in pixels."""
GAP = 4
"""Pixels between the panels."""
TINT = 0.6
"""Share of the colour that marks the contact."""


def touch_picture(image: Image, reading: Reading) -> bytes:
    """PNG file of an image, the indentation as colour, and the image with the contact marked.

    Args:
        image: camera image of the touch.
        reading: its reading.
    """
    deepest = float(reading.indentation[reading.contact].max())
    share = np.clip(reading.indentation / deepest, 0, 1)
    grey = np.repeat(image.mean(axis=2, keepdims=True), 3, axis=2)
    mark = np.array(list(bytes.fromhex(MARK[1:])))
    marked = np.where(reading.contact[..., None], (1 - TINT) * grey + TINT * mark, grey)
    panels = {
        "image": image,
        f"indentation, 0 to {deepest:.2f} mm": value_colours(share),
        f"contact, {reading.area:.1f} square mm": marked.round().astype(np.uint8),
    }
    rows, columns = image.shape[:2]
    width = int(np.clip(columns, *WIDTHS))
    height = max(1, round(rows * width / columns))
    picture = Pillow.new("RGB", (len(panels) * (width + GAP) - GAP, height + LINE), "white")
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(12)
    for number, (caption, levels) in enumerate(panels.items()):
        left = number * (width + GAP)
        draw.text((left + 2, 2), caption, fill="black", font=font)
        picture.paste(Pillow.fromarray(levels).resize((width, height), Pillow.Resampling.BILINEAR), (left, LINE))
    file = BytesIO()
    picture.save(file, "PNG")
    return file.getvalue()
