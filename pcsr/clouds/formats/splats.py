"""Gaussian splats: a PLY whose vertices have the parameters of Gaussians, read as a cloud of positions and colours."""

import re

import numpy as np

from pcsr.clouds.columns import NORMALS

DEGREE_0 = 0.28209479177387814
"""Value of the spherical harmonic of degree 0."""
COLOUR = ("f_dc_0", "f_dc_1", "f_dc_2")
"""Coefficients of that harmonic for red, green and blue."""
OTHERS = re.compile(r"f_rest_\d+|opacity|(scale|rot)_\d+|filter_3D")
"""Names of the other parameters."""


def is_splats(names: set[str]) -> bool:
    """Return whether vertices with these properties are Gaussian splats."""
    return names.issuperset(COLOUR) and any(OTHERS.fullmatch(name) for name in names)


def as_colours(columns: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], str]:
    """Convert the columns of Gaussian splats to colours.

    Args:
        columns: columns of the splats by name.

    Returns:
        Red, green and blue in 8 bits with the columns that are no parameters of Gaussians, and a note on the rest.
    """
    colours: dict[str, np.ndarray] = {}
    if not {"red", "green", "blue"} & columns.keys():
        for name, source in zip(("red", "green", "blue"), COLOUR, strict=True):
            share = np.nan_to_num(0.5 + DEGREE_0 * columns[source].astype(np.float64)).clip(0, 1)
            colours[name] = np.rint(255 * share).astype(np.uint8)
    normals = [name for name in NORMALS if name in columns]  # 0 in most such files
    normals = [] if any(columns[name].any() for name in normals) else normals
    left_out = [name for name in columns if name in COLOUR or OTHERS.fullmatch(name) or name in normals]
    rest = {name: column for name, column in columns.items() if name not in left_out}
    kinds = dict.fromkeys(re.sub(r"\d+$", "*", name) for name in left_out if name not in COLOUR)
    note = f"it holds Gaussian splats: positions and colours were read, and {', '.join(kinds)} left out"
    return colours | rest, note
