"""`pcsr touch simulate`: simulate touches on a mesh and write them as a recording."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pcsr.cli.options import FILE, OUTPUT_FOLDER, columns_option, complete_part, plugin_option
from pcsr.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    import trimesh
    from jaxtyping import Float

    from pcsr.plugins.registry import Registry


def _complete_option(option: str) -> "Callable[[click.Context, click.Parameter, str], list[str]]":
    """Return a shell completion for the values that an option of the touch source allows."""

    def complete(context: click.Context, _param: click.Parameter, incomplete: str) -> list[str]:
        from pcsr.plugins.loading import load_plugins
        from pcsr.recipe.schema import options_model

        model = options_model(load_plugins().get("touch", context.params.get("source") or "digit"))
        schema = model.model_json_schema()
        found = schema["properties"].get(option, {})
        found = schema.get("$defs", {}).get(found.get("$ref", "").rpartition("/")[2], found)
        allowed = found.get("anyOf", [found])[0].get("enum", [])  # a group's first form is its bare name
        return [value for value in allowed if value.startswith(incomplete)]

    return complete


@click.command()
@click.argument("mesh", type=FILE)
@click.option("-o", "--out", "folder", required=True, type=OUTPUT_FOLDER, metavar="DIR", help="Folder to write to.")
@click.option(
    "--count", type=click.IntRange(1, 2000), default=5, show_default=True, metavar="N", help="Number of touches."
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, metavar="N", help="Seed of the touches.")
@click.option(
    "--sensor",
    default=None,
    metavar="NAME",
    shell_complete=_complete_option("sensor"),
    help="Preset of the sensor, such as digit or gelsight-mini.  [default: the source's]",
)
@click.option(
    "--policy",
    default=None,
    metavar="NAME",
    shell_complete=complete_part("policy"),
    help="Policy that chooses where to touch, such as sparse or expected-error.  [default: the source's]",
)
@click.option(
    "--object-size",
    default=None,
    metavar="MM",
    help="Longest side of the object in mm; null if the mesh is in mm.  [default: 60]",
)
@click.option(
    "--cloud",
    type=FILE,
    default=None,
    metavar="FILE",
    help="Cloud that a camera sees, in the mesh's frame and unit.  [default: random points of the surface]",
)
@click.option(
    "--format",
    "suffix",
    default=None,
    help="Format of the cloud, whatever its suffix: ply, xyz, kitti, nuscenes, colmap …  [default: by the suffix]",
)
@columns_option
@click.option(
    "--source",
    default="digit",
    show_default=True,
    metavar="NAME",
    shell_complete=complete_part("touch"),
    help="Touch source.",
)
@click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Set an option of the touch source, such as press=[0.5,1]. The value is YAML. May be repeated.",
)
@click.option("--overwrite", is_flag=True, help="Replace a recording that exists in DIR.")
@plugin_option
def simulate(
    mesh: Path,
    folder: Path,
    count: int,
    seed: int,
    sensor: str | None,
    policy: str | None,
    object_size: str | None,
    cloud: Path | None,
    suffix: str | None,
    columns: str | None,
    source: str,
    overrides: tuple[str, ...],
    overwrite: bool,
    registry: "Registry",
) -> None:
    """Simulate touches on a mesh and write them as a recording.

    MESH is a file of a mesh. The touches are written in its frame and unit.
    """
    import numpy as np

    from pcsr.clouds.faults import warn_of_faults
    from pcsr.clouds.formats import read_points
    from pcsr.clouds.formats.format_table import check_columns, format_of
    from pcsr.clouds.touch import covered_area_share
    from pcsr.contracts import ShapeItem, TouchSource
    from pcsr.extras import require
    from pcsr.geometry.sampling import surface_points
    from pcsr.recipe import for_data
    from pcsr.recorded import write

    if any(override.partition("=")[0].strip() == "use" for override in overrides):
        raise UserError("--set use=…: name the source with --source")
    if suffix is not None and cloud is None:
        raise UserError(f"--format {suffix[:80]}: it is the format of --cloud, which is not given")
    if columns is not None and cloud is None:
        raise UserError(f"--columns {columns[:200]}: they are the columns of --cloud, which is not given")
    if not mesh.is_file():
        raise UserError(f"mesh {mesh}: {'that is a folder' if mesh.is_dir() else 'there is no such file'}")
    if mesh.resolve().parent == folder.resolve():
        raise UserError(f"-o {folder}: it contains the mesh itself: name a folder for the recording alone")
    given = [f"use={source}"]
    for key, value in (("sensor", sensor), ("policy", policy), ("object_size", object_size)):
        given += [] if value is None else [f"{key}={value}"]
    recipe = for_data("meshes", {"folder": str(mesh.parent)}, registry, [*given, *overrides], part="touch")
    require(recipe.data.touch.needs(registry, "touch"))
    touch_source: TouchSource = recipe.data.touch.build(registry, "touch")
    item: ShapeItem = recipe.data.shapes.build(registry, "shapes").item(mesh.name)
    if cloud is not None:
        check_columns(columns, format_of(cloud, suffix), str(cloud))
        seen = read_points(cloud, suffix, columns=columns)
        warn_of_faults(seen, f"--cloud {cloud}")
        _check_same_frame(seen, item.mesh, cloud, mesh)
    else:
        seen = surface_points(item.mesh, recipe.data.points, np.random.default_rng(seed))
    touches = touch_source.touches(item, seen, count, seed)
    if len(touches) != count:
        raise UserError(f"{mesh}: touch '{source}' gave {len(touches)} touches instead of {count}")
    areas = [one.contact_area for one in touches if one.contact_area is not None]
    covered = (
        f", {covered_area_share(touches, item.mesh.area):.2%} of its surface" if len(areas) == len(touches) else ""
    )
    length = item.mesh.extents.max() * touches[0].unit
    error = touch_source.pose_error(item.name)
    # Last, so that a command that fails leaves nothing behind.
    write(folder, touches, overwrite=overwrite, pose_error=error)
    click.echo(
        f"{folder}: {count} touches of {mesh.name} ({length:.4g} mm long) by {touches[0].sensor}, "
        f"{len(touches[0].points)} points each"
        + (f", contacts of {min(areas):.0f} to {max(areas):.0f} mm²{covered}" if areas else "")
    )


def _check_same_frame(
    cloud: "Float[np.ndarray, 'n 3']", mesh: "trimesh.Trimesh", cloud_file: Path, mesh_file: Path
) -> None:
    """Check that a cloud can be in the frame and unit of a mesh.

    Raises:
        UserError: the cloud is more than ten times as long as the mesh, or farther away than its length.
    """
    import numpy as np

    low, high = mesh.bounds
    length = float((high - low).max())
    cloud_length = float(np.ptp(cloud, axis=0).max())
    distance = float(np.maximum(np.maximum(low - cloud.max(0), cloud.min(0) - high), 0).max())
    if cloud_length > 10 * length or distance > length:
        raise UserError(
            f"--cloud {cloud_file} is {cloud_length:.4g} long and lies {distance:.4g} away from {mesh_file}, which is "
            f"{length:.4g} long: it is in another unit or frame; convert it to the mesh's"
        )
