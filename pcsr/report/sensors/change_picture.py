"""Picture of the change of colour that a press causes."""

import base64
from io import BytesIO

import numpy as np
from PIL import Image as Pillow

from pcsr.sensors.colour import colour_change
from pcsr.sensors.images import Image

WIDEST = 240
"""Most pixels along the longer side of a picture."""
GREATEST = 60.0
"""Change of colour in per cent that is shown as black or white."""


def change_picture(image: Image, background: Image) -> str:
    """JPEG file of the change of colour, as the text of a data URL; grey where the colour is unchanged.

    Args:
        image: image of a press.
        background: image of the untouched gel, of the same size.

    Raises:
        UserError: the change of colour cannot be computed.
    """
    change = colour_change(image, background)
    levels = np.clip(127.5 * (1 + change / GREATEST), 0, 255).round().astype(np.uint8)
    picture = Pillow.fromarray(levels)
    picture.thumbnail((WIDEST, WIDEST), Pillow.Resampling.BOX)
    file = BytesIO()
    picture.save(file, "JPEG", quality=85)
    return f"data:image/jpeg;base64,{base64.b64encode(file.getvalue()).decode()}"
