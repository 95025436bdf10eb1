"""Folders as others lay them out, one file a layout. docs/recorded.md describes each."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pcsr.clouds.touch import Touch
from pcsr.errors import UserError, did_you_mean
from pcsr.recorded.layouts import gsrobotics, normalflow, pterotactyl, smith_2020, ycb_slide
from pcsr.recorded.manifest import Strict, checked
from pcsr.validation_messages import shown

Read = Callable[[Path, Any], Iterator[tuple[str, Touch | str]]]

LAYOUTS: dict[str, tuple[type[Strict], Read]] = {
    "gsrobotics": (gsrobotics.Options, gsrobotics.read),
    "normalflow": (normalflow.Options, normalflow.read),
    "pterotactyl": (pterotactyl.Options, pterotactyl.read),
    "smith-2020": (smith_2020.Options, smith_2020.read),
    "ycb-slide": (ycb_slide.Options, ycb_slide.read),
}
"""Of each layout its options, and what reads it."""


def read(folder: Path, layout: dict[str, Any]) -> Iterator[tuple[str, Touch | str]]:
    """Each touch of a folder with its name, or the reason why it is none.

    Args:
        folder: with the files of one object.
        layout: what the manifest says: its name, and options of its own.

    Raises:
        UserError: an unknown layout, wrong options, or a folder that holds nothing of it.
    """
    name = layout.get("name")
    if not isinstance(name, str) or name not in LAYOUTS:
        raise UserError(f"touches.json: layout.name: no layout {shown(name)}: {did_you_mean(shown(name), LAYOUTS)}")
    options, read_folder = LAYOUTS[name]
    options_written = {key: value for key, value in layout.items() if key != "name"}
    return read_folder(folder, checked(options, options_written, "layout"))
