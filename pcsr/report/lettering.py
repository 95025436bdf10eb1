"""Words on pictures, and pictures as files: what charts and figures share."""

from functools import cache
from io import BytesIO
from pathlib import Path

from PIL import Image, ImageColor, ImageDraw, ImageFont

from pcsr.files import write_whole

INK, SOFT, LINE, PAPER = "#1c2024", "#5d6670", "#d9dee3", "#ffffff"
"""Of text, of text beside it, of frames and of the ground, as on the pages in a bright room."""

Number = float | int

_POWERS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_PLAIN = str.maketrans({"×": "x", "–": "-", "—": "-", "−": "-", "µ": "u", "…": "..."})


@cache
def font(size: int) -> ImageFont.FreeTypeFont:
    """The one that Pillow brings, so that a picture is the same wherever it is made; `size` in pixels."""
    found = ImageFont.load_default(size)
    assert isinstance(found, ImageFont.FreeTypeFont), "Pillow's wheels all have FreeType"
    return found


def plain(text: str) -> str:
    """The text in letters that the font has: ``×10⁻³`` becomes ``x10^-3``."""
    shown = ""
    for before, letter in zip(" " + text, text, strict=False):
        power = letter.translate(_POWERS)
        if power == letter:
            shown += letter.translate(_PLAIN)
        else:
            shown += power if before.translate(_POWERS) != before else f"^{power}"
    return shown


def fitted(text: str, size: int, width: Number) -> str:
    """The text in letters that the font has, its end cut off where it is wider than `width` pixels."""
    text = plain(text)
    if font(size).getlength(text) <= width:
        return text
    while text and font(size).getlength(text + "...") > width:
        text = text[:-1]
    return text + "..."


def sideways(text: str, size: int, colour: str = INK) -> Image.Image:
    """A text that reads upwards, on a ground that can't be seen."""
    left, top, right, bottom = map(int, font(size).getbbox(plain(text)))
    image = Image.new("RGBA", (right - left + 2, bottom - top + 2), (*rgb(PAPER), 0))
    ImageDraw.Draw(image).text((1 - left, 1 - top), plain(text), colour, font(size))
    return image.transpose(Image.Transpose.ROTATE_90)


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of ``#rrggbb``."""
    red, green, blue = ImageColor.getrgb(colour)[:3]
    return red, green, blue


def png(image: Image.Image, colours: int | None = None) -> bytes:
    """A picture as the bytes of a PNG file, with at most `colours` of them where that is given."""
    file = BytesIO()
    shown = image.convert("RGB")
    if colours is not None:
        shown = shown.quantize(colours, dither=Image.Dither.NONE)
    shown.save(file, "PNG", optimize=True)
    return file.getvalue()


def save_png(image: Image.Image, path: Path) -> None:
    """Write a picture as a PNG file, whole or not at all.

    Raises:
        RunError: it can't be written.
    """
    encoded = png(image)
    write_whole(path, lambda part: _write(part, encoded))


def _write(part: Path, encoded: bytes) -> None:
    part.write_bytes(encoded)
