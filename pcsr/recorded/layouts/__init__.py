"""Readers of the folder layouts of published data sets, one file for each. docs/recorded.md describes them."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pcsr.clouds.touch import Touch
from pcsr.errors import UserError, did_you_mean
from pcsr.recorded.fields import LayoutOptions
from pcsr.recorded.layouts import gsrobotics, normalflow, pterotactyl, smith_2020, ycb_slide
from pcsr.recorded.manifest import checked
from pcsr.recorded.other_files import remedy_for_layout
from pcsr.validation_messages import shown

Read = Callable[[Path, Any], Iterator[tuple[str, Touch | str]]]

LAYOUTS: dict[str, tuple[type[LayoutOptions], Read]] = {
    "gsrobotics": (gsrobotics.Options, gsrobotics.read),
    "normalflow": (normalflow.Options, normalflow.read),
    "pterotactyl": (pterotactyl.Options, pterotactyl.read),
    "smith-2020": (smith_2020.Options, smith_2020.read),
    "ycb-slide": (ycb_slide.Options, ycb_slide.read),
}
"""Layouts by name: model of the options, and reader."""


def options(layout: dict[str, Any]) -> LayoutOptions:
    """Validate the name and the options of a layout, from the manifest.

    Raises:
        UserError: the layout is unknown, or its options have mistakes.
    """
    name = layout.get("name")
    if not isinstance(name, str) or name not in LAYOUTS:
        remedy = remedy_for_layout(name) if isinstance(name, str) else None
        remedy = remedy or did_you_mean(shown(name), LAYOUTS)
        raise UserError(f"touches.json: layout.name: no layout {shown(name)}: {remedy}")
    written = {key: value for key, value in layout.items() if key != "name"}
    return checked(LAYOUTS[name][0], written, "layout")


def read(folder: Path, options: LayoutOptions) -> Iterator[tuple[str, Touch | str]]:
    """Read the touches of a folder: yield the name of each, with the touch or the reason why it is unusable.

    Args:
        folder: folder with the files of one object.
        options: options of the layout.

    Raises:
        UserError: the folder holds no files of this layout.
    """
    return next(read_folder for kind, read_folder in LAYOUTS.values() if type(options) is kind)(folder, options)
