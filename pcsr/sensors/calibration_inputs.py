"""Checks of what a calibration is made from."""

from collections import Counter
from collections.abc import Sequence
from hashlib import sha256

from pcsr.errors import UserError
from pcsr.limits import check_memory
from pcsr.sensors.calibration_file import LARGEST, LONGEST_NAME
from pcsr.sensors.colour import check_exposure
from pcsr.sensors.gels import Gel, check_view
from pcsr.sensors.images import Image
from pcsr.sensors.presses import PressImage

FEWEST = 5
"""Least number of usable presses."""
MEMORY = 60
"""Bytes that a pixel of each press takes."""


def check_arguments(
    presses: Sequence[PressImage],
    test: Sequence[PressImage],
    background: Image,
    mm_per_pixel: float,
    sensor: str,
    gel: Gel,
    count: int | None,
) -> None:
    """Check the arguments of `calibrate`.

    Raises:
        UserError: one is out of range, two presses have one name, the background is black, saturated or grey, or the
            images do not fit into the memory.
    """
    if not 0 < mm_per_pixel <= LARGEST:
        raise UserError(f"mm_per_pixel is {mm_per_pixel:g}: it must be more than 0 and at most {LARGEST:g}")
    if not 0 < len(sensor) <= LONGEST_NAME:
        raise UserError(f"the sensor's name has {len(sensor)} characters: it must have 1 to {LONGEST_NAME}")
    if not sensor.isprintable():
        raise UserError(f"the sensor's name is {sensor!r}: it must have no control characters")
    if count is not None and count < FEWEST:
        raise UserError(f"{count} presses are no calibration: fit at least {FEWEST}, better 12")
    names = Counter(press.name for press in (*presses, *test))
    for name, times in names.items():
        if times > 1:
            raise UserError(f"{times} presses are called '{name}': give each a name of its own")
    for press in (*presses, *test):
        if not 0 < press.diameter <= LARGEST:
            raise UserError(
                f"{press.name}: a ball of {press.diameter:g} mm: the diameter must be more than 0 and at most "
                f"{LARGEST:g} mm"
            )
    rows, columns = background.shape[:2]
    check_view(gel, columns, rows, mm_per_pixel)
    check_exposure(background, "the background")
    check_memory(
        MEMORY * rows * columns * names.total(),
        f"calibration with {names.total()} presses of {columns} x {rows} pixels",
        "make the images smaller, as 320 x 240 are enough",
    )


def copies(presses: Sequence[PressImage]) -> dict[str, str]:
    """Return the reasons of presses with the image of an earlier one, by name: errors on them would mean nothing."""
    first: dict[bytes, str] = {}
    reasons = {}
    for press in presses:
        content = sha256(press.image.tobytes()).digest()
        if first.setdefault(content, press.name) != press.name:
            reasons[press.name] = f"it is the same image as {first[content]}"
    return reasons
