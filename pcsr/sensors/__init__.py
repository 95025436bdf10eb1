"""Camera-based tactile sensors, such as DIGIT and GelSight: their calibration, and touches from their images."""

from pcsr.sensors.calibrate import Calibrated, calibrate, median_background
from pcsr.sensors.calibration import Calibration
from pcsr.sensors.figures import Figures, PressFigures
from pcsr.sensors.fitting import Place
from pcsr.sensors.gels import GELS, Gel, gel
from pcsr.sensors.images import read_rgb
from pcsr.sensors.presses import PressImage
from pcsr.sensors.reading import Reading
from pcsr.sensors.shading import ball_indentation, shaded

__all__ = [
    "GELS",
    "Calibrated",
    "Calibration",
    "Figures",
    "Gel",
    "Place",
    "PressFigures",
    "PressImage",
    "Reading",
    "ball_indentation",
    "calibrate",
    "gel",
    "median_background",
    "read_rgb",
    "shaded",
]
