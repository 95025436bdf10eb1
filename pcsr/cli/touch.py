"""`pcsr touch`: simulate touches on a mesh and write them as a recording."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pcsr.cli.options import FILE, plugin_option
from pcsr.errors import UserError

if TYPE_CHECKING:
    import numpy as np
    import trimesh
    from jaxtyping import Float

    from pcsr.plugins.registry import Registry


@click.command()
@click.argument("mesh", type=FILE)
@click.option("-o", "--out", "folder", required=True, type=FILE, metavar="DIR", help="Where to put the recording.")
@click.option("--count", type=click.IntRange(1, 2000), default=5, show_default=True, help="Touches.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Another seed, other touches.")
@click.option("--sensor", default=None, metavar="NAME", help="A preset, such as digit or gelsight-mini.")
@click.option("--policy", default=None, metavar="NAME", help="Where to touch: uniform, spread, sparse or grasp.")
@click.option(
    "--object-size",
    default=None,
    metavar="MM",
    help="Longest side of the object in mm; null: the mesh is in mm.  [default: 60]",
)
@click.option("--cloud", type=FILE, default=None, help="What the camera sees, in the mesh's frame and unit.")
@click.option("--source", default="digit", show_default=True, metavar="NAME", help="The touch source.")
@click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Any other option of the source: --set press=[0.5,1]. May be repeated.",
)
@click.option("--overwrite", is_flag=True, help="Replace a recording that is in DIR already.")
@plugin_option
def touch(
    mesh: Path,
    folder: Path,
    count: int,
    seed: int,
    sensor: str | None,
    policy: str | None,
    object_size: str | None,
    cloud: Path | None,
    source: str,
    overrides: tuple[str, ...],
    overwrite: bool,
    registry: "Registry",
) -> None:
    """Simulate touches on a mesh and write them as a recording."""
    import numpy as np

    from pcsr.clouds.formats import read_points
    from pcsr.clouds.touch import coverage
    from pcsr.contracts import ShapeItem, TouchSource
    from pcsr.extras import require
    from pcsr.geometry.sampling import surface_points
    from pcsr.recipe import for_data
    from pcsr.recorded import write

    if any(override.partition("=")[0].strip() == "use" for override in overrides):
        raise UserError("--set use=…: name the source with --source")
    if not mesh.is_file():
        raise UserError(f"mesh {mesh}: {'that is a folder' if mesh.is_dir() else 'there is no such file'}")
    if mesh.resolve().parent == folder.resolve():
        raise UserError(f"-o {folder}: the mesh itself is in there: take a folder for the recording alone")
    given = [f"use={source}"]
    for key, value in (("sensor", sensor), ("policy", policy), ("object_size", object_size)):
        given += [] if value is None else [f"{key}={value}"]
    recipe = for_data("meshes", {"folder": str(mesh.parent)}, registry, [*given, *overrides], part="touch")
    require(recipe.data.touch.needs(registry, "touch"))
    feeler: TouchSource = recipe.data.touch.build(registry, "touch")
    item: ShapeItem = recipe.data.shapes.build(registry, "shapes").item(mesh.name)
    if cloud is not None:
        seen = read_points(cloud)
        _check_beside(seen, item.mesh, cloud, mesh)
    else:
        seen = surface_points(item.mesh, recipe.data.points, np.random.default_rng(seed))
    touches = feeler.touches(item, seen, count, seed)
    if len(touches) != count:
        raise UserError(f"{mesh}: touch '{source}' gave {len(touches)} touches where {count} were asked for")
    areas = [one.contact_area for one in touches if one.contact_area is not None]
    covered = f", {coverage(touches, item.mesh.area):.2%} of its surface" if len(areas) == len(touches) else ""
    length = item.mesh.extents.max() * touches[0].unit
    write(folder, touches, overwrite=overwrite)  # last, so that nothing is left of a command that was stopped before
    click.echo(
        f"{folder}: {count} touches of {mesh.name} ({length:.4g} mm long) by {touches[0].sensor}, "
        f"{len(touches[0].points)} points each"
        + (f", contacts of {min(areas):.0f} to {max(areas):.0f} mm²{covered}" if areas else "")
    )


def _check_beside(cloud: "Float[np.ndarray, 'n 3']", mesh: "trimesh.Trimesh", file: Path, of: Path) -> None:
    """Refuse a cloud that cannot be of this mesh.

    Raises:
        UserError: it is of another size, or lies elsewhere; the message gives both sizes.
    """
    import numpy as np

    from pcsr.geometry.checks import check_frame

    low, high = mesh.bounds
    length = float((high - low).max())
    own = float(np.ptp(cloud, axis=0).max())
    away = float(np.maximum(np.maximum(low - cloud.max(0), cloud.min(0) - high), 0).max())
    check_frame(f"--cloud {file}", str(of), distance=away, extent=length, most_distance=1.0, size=own, most_size=10.0)
