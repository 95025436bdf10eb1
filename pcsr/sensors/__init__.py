"""Camera-based tactile sensors: their calibration, and touches from their images."""
