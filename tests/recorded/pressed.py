"""Indentation of a gel by a ball, with the membrane that sinks in around the contact."""

import numpy as np

PITCH = 0.0634
RADIUS = 3.155


def pressed(press=0.84, *, middle=(60.0, 80.0), shape=(120, 160), bulge=0.0):
    """The indentation in mm, and the pixels in contact, whose rim lies at 0.4 of the press."""
    v, u = np.mgrid[: shape[0], : shape[1]].astype(float)
    away = np.hypot(v - middle[0], u - middle[1]) * PITCH
    rim = np.sqrt(RADIUS**2 - (RADIUS - 0.6 * press) ** 2)
    ball = np.sqrt(np.maximum(RADIUS**2 - away**2, 0)) - (RADIUS - press)
    around = 0.4 * press * np.exp(-(away - rim) / (0.5 * press))
    return np.where(away < rim, ball, around) - bulge, away < rim
