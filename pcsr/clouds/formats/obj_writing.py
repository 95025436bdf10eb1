"""Writer of OBJ files: vertices with colours and normals, without faces."""

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import COLOURS, NORMALS, spread
from pcsr.clouds.formats.colours import brightest
from pcsr.clouds.formats.digits import words
from pcsr.errors import UserError


def write(cloud: Cloud) -> bytes:
    """Encode a cloud as an OBJ file without faces: vertices with colours from 0 to 1, and normals.

    Raises:
        UserError: the cloud has columns that the format cannot hold.
    """
    columns = spread(cloud.columns, rest=True)
    colours = [columns.pop(name) for name in COLOURS if name in columns]
    normals = [columns.pop(name) for name in NORMALS if name in columns]
    if columns or len(normals) not in (0, 3) or len(colours) not in (0, 3, 4):
        raise UserError(
            f"an .obj holds points, complete colours and complete normals, not the columns "
            f"{', '.join(columns) or 'of this cloud'}: write a .ply"
        )
    shares = _shares(colours)
    lines = ["v " + " ".join(row) + "\n" for row in zip(*map(words, [*cloud.points.T, *shares]), strict=True)]
    if normals:
        lines += ["vn " + " ".join(row) + "\n" for row in zip(*map(words, normals), strict=True)]
    return "".join(lines).encode()


def _shares(colours: list[np.ndarray]) -> list[np.ndarray]:
    """Return integer colours as shares of full brightness."""
    if all(each.dtype.kind == "f" for each in colours):
        return colours
    named = dict(zip(COLOURS, colours, strict=False))
    most = brightest(named, list(named)) or 1.0
    return [each / most for each in colours]
