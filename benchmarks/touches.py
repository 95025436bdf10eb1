"""The tables of docs/touch.md: what sensors feel, what policies cover, and how much of an object is felt at its size.

python benchmarks/touches.py
"""

from collections.abc import Iterator

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from pcsr import ShapeItem, Touch, UserError
from pcsr.clouds.touch import coverage
from pcsr.geometry.sampling import surface_points
from pcsr_plugins.shapes.cad_parts import CadParts
from pcsr_plugins.touch.digit import Digit
from pcsr_plugins.touch.digit.policies import PolicyOptions
from pcsr_plugins.touch.digit.sensors import SensorOptions

SENSORS = ("digit", "digit-tacto", "gelsight-mini", "smith-2020", "smith-2021")
POLICIES = ("uniform", "spread", "sparse", "grasp")
SIZES = (30.0, 60.0, 120.0, 320.0)


def felt(digit: Digit, items: list[ShapeItem], count: int) -> Iterator[tuple[ShapeItem, list[Touch] | None]]:
    """The touches of each object, None where it was refused; the cloud is 512 random points."""
    for item in track(items, console=Console(stderr=True), transient=True):
        cloud = surface_points(item.mesh, 512, np.random.default_rng(0))
        try:
            yield item, digit.touches(item, cloud, count, 0)
        except UserError:
            yield item, None


def covered(digit: Digit, items: list[ShapeItem]) -> tuple[list[str], str, str]:
    """Median share of the surface that 1 to 5 touches cover; their contacts; how many objects were refused."""
    kept = [(item, touches) for item, touches in felt(digit, items, 5) if touches]
    shares = [[coverage(touches[:k], item.mesh.area) for k in range(1, 6)] for item, touches in kept]
    median = [f"{share:.2%}" for share in np.median(shares, axis=0)]
    return median, contacts([touches for _, touches in kept]), str(len(items) - len(kept))


def contacts(found: list[list[Touch]]) -> str:
    """Contact in mm², at 10, 50 and 90 %."""
    areas = [touch.contact_area or 0.0 for touches in found for touch in touches]
    return " / ".join(f"{area:.0f}" for area in np.percentile(areas, (10, 50, 90)))


if __name__ == "__main__":
    shapes = CadParts()
    parts = [shapes.item(name) for name in shapes.names("test")[:48]]
    table = Table(
        "sensor", "at 60 mm", "at 320 mm", title="contact in mm², at 10, 50 and 90 %, 24 parts, two touches each"
    )
    for sensor in SENSORS:
        digits = [Digit(sensor=SensorOptions(use=sensor), object_size=size) for size in (60.0, 320.0)]
        found = [[touches for _, touches in felt(digit, parts[:24], 2) if touches] for digit in digits]
        table.add_row(sensor, *map(contacts, found))
    Console().print(table)
    table = Table("policy", *(str(k) for k in range(1, 6)), title="median share covered by 1 to 5 touches at 60 mm")
    for policy in POLICIES:
        table.add_row(policy, *covered(Digit(policy=PolicyOptions(use=policy)), parts)[0])
    Console().print(table)
    table = Table(
        "longest side", *(str(k) for k in range(1, 6)), "contact in mm²", "refused", title="median share covered, digit"
    )
    for size in SIZES:
        shares, contact, refused = covered(Digit(object_size=size), parts)
        table.add_row(f"{size:.0f} mm", *shares, contact, refused)
    Console().print(table)
