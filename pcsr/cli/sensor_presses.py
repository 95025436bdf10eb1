"""Presses of balls that are named in the command line of `pcsr sensor calibrate`, and their background."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pcsr.cli.sensor_images import image_files, name_of, reason
from pcsr.errors import UserError

if TYPE_CHECKING:
    from pcsr.sensors import PressImage
    from pcsr.sensors.images import Image

Group = tuple[list[Path], float]
"""Files of presses, and the diameter of their ball."""


def balls_of_tests(tests: Sequence[Path], test_balls: tuple[float, ...], balls: tuple[float, ...]) -> tuple[float, ...]:
    """Return the diameters of the balls of `--test`."""
    if test_balls and not tests:
        raise UserError("--test-ball: it is the ball of --test, which is not given")
    return balls if not test_balls and len(balls) == 1 else test_balls


def with_balls(
    groups: Sequence[tuple[list[Path], str]],
    balls: Sequence[float],
    option: str,
    each: str,
    without: Sequence[Path],
) -> list[Group]:
    """Return the files of each group with the diameter of its ball.

    Raises:
        UserError: there are neither as many balls as groups nor one; or a path leads nowhere.
    """
    if groups and len(balls) not in (1, len(groups)):
        plural = "s" if len(groups) > 1 else ""
        raise UserError(
            f"{option} is given {len(balls)} times for {len(groups)} group{plural} of presses: give it once for all, "
            f"or once for {each}, in their order"
        )
    diameters = balls if len(balls) == len(groups) else [balls[0]] * len(groups)
    return [
        (image_files(paths, what, without), diameter) for (paths, what), diameter in zip(groups, diameters, strict=True)
    ]


def read_presses(groups: Sequence[Group], unreadable: dict[str, str]) -> "list[PressImage]":
    """Read presses, and add the reasons of those that cannot be read to `unreadable`."""
    from pcsr.limits import check_memory
    from pcsr.sensors import PressImage, read_rgb
    from pcsr.sensors.calibration_inputs import MEMORY

    found = []
    pixels = 0
    for files, diameter in groups:
        for file in files:
            try:
                found.append(PressImage(name_of(file), read_rgb(file), diameter))
            except UserError as error:
                unreadable[name_of(file)] = reason(error, file)
                continue
            pixels += found[-1].image[..., 0].size
            check_memory(
                MEMORY * pixels,
                f"calibration with {len(found)} or more presses of {pixels // len(found)} pixels",
                "give fewer presses, such as 20, and make the images smaller, as 320 x 240 are enough",
            )
    return found


def background_of(path: Path | None, presses: "Sequence[PressImage]") -> "Image":
    """Read the background, or compute it from the presses of the most common size."""
    from pcsr.sensors import median_background, read_rgb

    if path is not None:
        return read_rgb(path)
    sizes = Counter(press.image.shape for press in presses).most_common(1)
    return median_background([press.image for press in presses if press.image.shape == sizes[0][0]])
