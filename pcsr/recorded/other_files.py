"""Remedies where a folder holds tactile data, but no recording that pcsr can read."""

import os
from pathlib import Path

from pcsr.errors import UserError
from pcsr.recorded.images import CAMERA, VIDEOS

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
FILES_OF_LAYOUTS = {
    "gsrobotics": ("pc_*.pcd", "pointcloud_*.pcd"),
    "normalflow": ("gradient_maps.npy",),
    "pterotactyl": ("*/*_ref_frame.npy",),
    "ycb-slide": ("tactile_data.pkl", "synced_data.npy"),
}
"""Files by which the folder of a layout is recognized."""
CAMERAS = ("9dtact", "digit", "gelsight", "gelslim", "py3dcal", "tacto")
"""First letters of the names of sensors, and of programs for them, whose data are camera images."""


def check_is_recording(folder: Path, manifest: str) -> None:
    """Check that a folder without a manifest does not hold other tactile data.

    Args:
        folder: folder without a manifest.
        manifest: name of a recording's manifest.

    Raises:
        UserError: it holds images, videos or the files of a layout, or is no folder; the message says what to do.
    """
    if os.path.isfile(folder):
        raise UserError(f"{folder} is a file: a recording is a folder with a {manifest}{_remedy([folder])}")
    if not os.access(folder, os.R_OK | os.X_OK) or not os.path.isdir(folder):
        return
    for layout, patterns in FILES_OF_LAYOUTS.items():
        if any(next(folder.glob(pattern), None) for pattern in patterns):
            raise UserError(
                f"{folder} has no {manifest}, and its files look like those of the layout {layout}: write one that "
                f"names it, with its options"
            )
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in (*PICTURES, *VIDEOS))
    if files:
        several = f"{len(files)} files such as {files[0].name}" if len(files) > 1 else files[0].name
        raise UserError(
            f"{folder} has no {manifest}, but {several}: a recording has one, with an entry and a pose for each touch"
            f"{_remedy(files)}"
        )


def remedy_for_layout(name: str) -> str | None:
    """Return what to do with the data of a sensor or program that somebody takes for a layout; None if it is none."""
    plain = name.lower().replace("_", "-")
    if plain.startswith("gs-sdk"):
        return 'save its height maps as .npy and list them as entries with the key height and "integration": "gs_sdk"'
    return CAMERA if plain.startswith(CAMERAS) else None


def _remedy(files: list[Path]) -> str:
    if any(path.suffix.lower() in VIDEOS for path in files):
        return f"; of a video save the frame of each touch as PNG; {CAMERA}"
    return f"; {CAMERA}" if any(path.suffix.lower() in PICTURES for path in files) else ""
