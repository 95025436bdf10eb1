"""Faults of scanned clouds: points that are not finite, sentinels of invalid pixels, far outliers, exact duplicates."""

from pcsr.clouds.faults.find import Fault, find_faults
from pcsr.clouds.faults.screening import Bad, ScreenedCloud, screen, warn_of_faults

__all__ = ["Bad", "Fault", "ScreenedCloud", "find_faults", "screen", "warn_of_faults"]
