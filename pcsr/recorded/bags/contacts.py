"""Contacts in the messages of a tactile sensor, found by how deep its gel is indented."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float64, Int64
from scipy import ndimage

SHARE = 0.4
"""A contact ends where the indentation falls below this share of its greatest."""
LEAST = 0.1
"""Smallest indentation of a contact, in mm."""
LEAST_SHARE = 0.1
"""Smallest indentation of a contact, as a share of the greatest of all messages."""
NOISES = 5.0
"""Smallest indentation of a contact, in standard deviations of the noise from message to message."""
SURE = 2.5
"""Where the greatest indentation exceeds this many deviations of the noise, `SHARE` of it is a contact in any case.

With few messages a second the presses themselves look like noise. Noise alone reaches 2 deviations, since medians are
taken.
"""
SMOOTHED = 5
"""Number of messages whose median is taken."""
STRAY = 1.2
"""A message that is this many times as deep as the median around it is no deepest one."""
PAUSE = 2.0
"""Messages that are more seconds apart belong to different contacts."""


def contacts(depths: Float64[np.ndarray, " n"], times: Int64[np.ndarray, " n"]) -> list[int]:
    """Return the index of the deepest message of each contact.

    A contact begins where the indentation exceeds `threshold` after having been below `SHARE` of it, and ends where it
    falls below `SHARE` of its greatest. So light touches are found beside deep ones, and one touch with an uneven
    pressure is one contact. A message alone that is deeper or less deep than its neighbours has no effect.

    Args:
        depths: greatest indentation in each message, in mm.
        times: times of the messages in nanoseconds, ascending.
    """
    least = threshold(depths, times)
    found = []
    for part in _parts(times):
        smooth = _smoothed(depths[part])
        found += [part.start + _deepest(depths[part], smooth, peak) for peak in _peaks(smooth, least)]
    return found


def threshold(depths: Float64[np.ndarray, " n"], times: Int64[np.ndarray, " n"]) -> float:
    """Return the indentation in mm from which on there is contact, by the noise and the greatest indentation.

    Args:
        depths: as in `contacts`.
        times: as in `contacts`.
    """
    parts = _parts(times)
    steps = np.concatenate([np.abs(np.diff(depths[part])) for part in parts]) if parts else np.zeros(0)
    # The median of a normal distribution's absolute values is 0.6745; a step is the difference of two values.
    noise = float(np.median(steps)) / 0.6745 / np.sqrt(2) if len(steps) else 0.0
    greatest = max((float(_smoothed(depths[part]).max()) for part in parts), default=0.0)
    above_noise = min(NOISES * noise, SHARE * greatest) if greatest > SURE * noise else NOISES * noise
    return max(LEAST, LEAST_SHARE * greatest, above_noise)


def _parts(times: Int64[np.ndarray, " n"]) -> list[slice]:
    """Return the ranges of messages without a pause."""
    if len(times) == 0:
        return []
    ends = np.flatnonzero(np.diff(times) > PAUSE * 1e9) + 1
    return [slice(start, stop) for start, stop in pairwise([0, *ends.tolist(), len(times)])]


def _smoothed(depths: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    width = min(SMOOTHED, len(depths) - 1 + len(depths) % 2)  # an odd number
    smooth: Float64[np.ndarray, " n"] = ndimage.median_filter(depths, width, mode="mirror")
    return smooth


def _peaks(depths: Float64[np.ndarray, " n"], least: float) -> list[int]:
    """Return the index of the deepest message of each contact, of depths without noise."""
    found = []
    best: int | None = None
    lowest = 0.0
    for index, depth in enumerate(depths.tolist()):
        if best is None:
            lowest = min(lowest, depth)
            if depth > least and lowest < SHARE * depth:
                best = index
        elif depth > depths[best]:
            best = index
        elif depth < SHARE * depths[best]:
            found.append(_middle(depths, best))
            best, lowest = None, depth
    return found if best is None else [*found, _middle(depths, best)]


def _middle(depths: Float64[np.ndarray, " n"], first: int) -> int:
    """Return the middle of the messages from `first` on that are equally deep, as those of whole millimetres are."""
    last = first
    while last + 1 < len(depths) and depths[last + 1] == depths[first]:
        last += 1
    return (first + last) // 2


def _deepest(depths: Float64[np.ndarray, " n"], smooth: Float64[np.ndarray, " n"], peak: int) -> int:
    """Return the deepest message around a peak of the medians, without those that are far deeper than it."""
    near = range(max(0, peak - SMOOTHED // 2), min(len(depths), peak + SMOOTHED // 2 + 1))
    return max((i for i in near if depths[i] <= STRAY * smooth[peak]), key=lambda i: (depths[i], -abs(i - peak)))
