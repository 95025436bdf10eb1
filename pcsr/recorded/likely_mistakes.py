"""Checks of tactile images for likely mistakes: wrong sign or unit, and no level of the untouched gel."""

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from pcsr.errors import UserError

THICKEST = 30.0
"""Greatest indentation of a gel in mm; no fingertip's gel is thicker."""
KNOWN_GELS = ("digit", "gelsight")
"""First letters of the names of sensors whose gels are known."""
THICKEST_KNOWN = 5.0
"""Greatest indentation of a known gel in mm. The gel of a GelSight Mini is 4.25 mm thick."""
MOST_COVERED = 0.9
"""Greatest share of an image that can be in contact, unless the height of the untouched gel is known."""
OTHER_SIGN = 2.0
"""An indentation that is this many times as deep with the other sign has that sign."""
NOTICED = 0.05
"""Depth in mm from which on an indentation of the other sign is a mistake."""


def check_indentation(indentation: float, sensor: str, cause: str) -> None:
    """Check that a gel can be indented so far.

    Args:
        indentation: greatest indentation, in mm.
        sensor: name of the sensor.
        cause: likely cause of an indentation that is too large, and its remedy, for the message.

    Raises:
        UserError: the indentation exceeds the thickness of the gel.
    """
    most = THICKEST_KNOWN if sensor.lower().startswith(KNOWN_GELS) else THICKEST
    if indentation > most:
        gel = "any gel" if most == THICKEST else f"the gel of {sensor}"
        raise UserError(
            f"the gel is indented by {indentation:.4g} mm, more than the {most:g} mm that {gel} is thick: {cause}"
        )


def check_sign(indentation: Float[np.ndarray, "h w"]) -> None:
    """Check that the indentation of a gel has the right sign.

    Args:
        indentation: indentation in mm; pixels that do not count are NaN.

    Raises:
        UserError: it is far deeper with the other sign.
    """
    this, other = _depth(indentation), _depth(-indentation)
    if other > max(NOTICED, OTHER_SIGN * this):
        raise UserError(
            f"indentation: the surface goes {max(this, 0):.3g} mm into the gel and {other:.3g} mm the other way: give "
            f"the other sign, or correct the height of the untouched gel (rest or background)"
        )


def check_coverage(contact: Bool[np.ndarray, "h w"]) -> None:
    """Check that an image has pixels without contact, if nothing else tells the height of the untouched gel.

    Raises:
        UserError: nearly all pixels are in contact.
    """
    share = float(contact.mean())
    if share > MOST_COVERED:
        raise UserError(
            f"{share:.0%} of the pixels are in contact, so the height of the untouched gel is probably not 0: give it "
            f"in mm as rest (0 if it is right), or an image of it as background"
        )


def _depth(indentation: Float[np.ndarray, "h w"]) -> float:
    """Return the depth that a patch of 3 × 3 pixels reaches, so that single wrong pixels do not count."""
    finite = np.where(np.isfinite(indentation), indentation, -np.inf)
    return float(ndimage.minimum_filter(finite, 3, mode="nearest").max())
