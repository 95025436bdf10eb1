"""The tables of docs/touch-sensors.md: contacts by sensor, coverage by policy, and coverage by the size of the object.

python benchmarks/touches.py [--save]
"""

import sys
from collections.abc import Iterator, Sequence

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from saved import save

from pcsr import ShapeItem, Touch, UserError
from pcsr.clouds.touch import covered_area_share
from pcsr.geometry.sampling import surface_points
from pcsr_plugins.shapes.cad_parts import CadParts
from pcsr_plugins.touch.digit import Digit
from pcsr_plugins.touch.digit.policies import PolicyOptions
from pcsr_plugins.touch.digit.sensors import SensorOptions

SENSORS = ("digit", "digit-tacto", "gelsight-mini", "smith-2020", "smith-2021")
POLICIES = ("uniform", "spread", "sparse", "grasp")
SIZES = (30.0, 60.0, 120.0, 320.0)


def touched(digit: Digit, items: list[ShapeItem], count: int) -> Iterator[tuple[ShapeItem, list[Touch] | None]]:
    """The touches of each object, None where it was refused; the cloud is 512 random points."""
    for item in track(items, console=Console(stderr=True), transient=True):
        cloud = surface_points(item.mesh, 512, np.random.default_rng(0))
        try:
            yield item, digit.touches(item, cloud, count, 0)
        except UserError:
            yield item, None


def covered(digit: Digit, items: list[ShapeItem]) -> tuple[list[str], str, str]:
    """Median share of the surface that 1 to 5 touches cover; their contacts; how many objects were refused."""
    kept = [(item, touches) for item, touches in touched(digit, items, 5) if touches]
    shares = [[covered_area_share(touches[:k], item.mesh.area) for k in range(1, 6)] for item, touches in kept]
    median = [f"{100 * share:.2f} %" for share in np.median(shares, axis=0)]
    return median, contacts([touches for _, touches in kept]), str(len(items) - len(kept))


def contacts(found: list[list[Touch]]) -> str:
    """Contact in mm², at 10, 50 and 90 %."""
    areas = [touch.contact_area or 0.0 for touches in found for touch in touches]
    return " / ".join(f"{area:.0f}" for area in np.percentile(areas, (10, 50, 90)))


def show(name: str, title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table; with --save write it too."""
    table = Table(*columns, title=title)
    for row in rows:
        table.add_row(*row)
    Console().print(table)
    if "--save" in sys.argv:
        save(name, "python benchmarks/touches.py --save", columns, rows)


if __name__ == "__main__":
    shapes = CadParts()
    parts = [shapes.item(name) for name in shapes.names("test")[:48]]
    counts = ("1 touch", *(str(k) for k in range(2, 6)))
    rows = []
    for sensor in SENSORS:
        digits = [Digit(sensor=SensorOptions(use=sensor), object_size=size) for size in (60.0, 320.0)]
        found = [[touches for _, touches in touched(digit, parts[:24], 2) if touches] for digit in digits]
        rows.append([f"`{sensor}`", *map(contacts, found)])
    title = "contact in mm², at 10, 50 and 90 %, 24 parts, two touches each"
    show("sensors", title, ("sensor", "at 60 mm", "at 320 mm"), rows)
    rows = [[f"`{policy}`", *covered(Digit(policy=PolicyOptions(use=policy)), parts)[0]] for policy in POLICIES]
    show("policies", "median share covered by 1 to 5 touches at 60 mm", ("policy", *counts), rows)
    rows = []
    for size in SIZES:
        shares, contact, refused = covered(Digit(object_size=size), parts)
        rows.append([f"{size:.0f} mm", *shares, refused])
        Console().print(f"contact at {size:.0f} mm, in mm², at 10, 50 and 90 %: {contact}")
    show("sizes", "median share covered, digit", ("longest side", *counts, "refused"), rows)
