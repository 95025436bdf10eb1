"""Contact of a gel with an object, found in a map of the gel's indentation."""

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from pcsr.errors import UserError

CONTACT_SHARE = 0.4
"""Share of the greatest indentation from which on a gel is in contact.

A membrane sinks in beside a contact too. In 36 images of a ball of 6.31 mm pressed onto a GelSight Mini, contact by
this rule has 1.10 of the area of the disc within the rim in the median, and by a fifth of the indentation 1.66:
benchmarks/contact_rules.py.
"""


class NoContactError(UserError):
    """A tactile image shows no contact."""


def in_contact(
    indentation: Float[np.ndarray, "h w"], share: float = CONTACT_SHARE, at_least: float = 0.0
) -> Bool[np.ndarray, "h w"]:
    """Find the pixels in contact: those indented by a share of the deepest, and connected with it.

    Args:
        indentation: indentation of the gel at each pixel; pixels that are not finite are not in contact.
        share: share of the greatest indentation.
        at_least: indentation that a pixel in contact exceeds in any case, in the unit of `indentation`.

    Returns:
        The mask of the contact; all False where no pixel exceeds `at_least`.
    """
    finite = np.where(np.isfinite(indentation), indentation, -np.inf)
    within: Bool[np.ndarray, "h w"] = finite > max(share * finite.max(initial=-np.inf), at_least)
    if not within.any():
        return within
    labels, _ = ndimage.label(within)
    contact: Bool[np.ndarray, "h w"] = labels == labels[np.unravel_index(np.argmax(finite), finite.shape)]
    return contact
