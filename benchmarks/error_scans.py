"""Clouds of test shapes, and touches of them: what benchmarks/expected_errors.py measures expected errors on."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
import pugan
import trimesh
from error_clouds import distances, noisy, radius

import pcsr
from pcsr.clouds.cloud import Cloud
from pcsr.data.sample import make_sample
from pcsr.errors import UserError
from pcsr.geometry.sampling import surface_points
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr_plugins.shapes.cad_parts import CadParts
from pcsr_plugins.touch.digit import Digit
from pcsr_plugins.touch.digit.noise import Noise

RECIPE = Path(__file__).parents[1] / "pcsr/recipes" / "touch" / "parts.yaml"
RATE = 4
NOISE = 0.01
LONGEST = 30.0
"""Longest side of a part, in mm."""
ARM = pcsr.PoseError(position=1.0, rotation=2.0)
TOUCHES = 4
PARTS = {
    "parts, random": (),
    "parts, random, 1 % noise": (),
    "parts, one camera": ("data.sampling=view",),
    "parts, four cameras, 1 % noise": ("data.sampling=view", "data.view.cameras=4", f"data.view.noise={NOISE}"),
    "parts, 2048 random, 1 % noise, --denoise": ("data.points=2048", "data.rate=4"),
}
"""Kinds of clouds of parts, with the settings of the recipe."""
TOGETHER = "parts, all kinds together"
SHAPES = ("PU-GAN's shapes", "PU-GAN's shapes, 1 % noise")
TOUCHED = "touched points, arm of 1 mm and 2°"


@dataclass(frozen=True)
class Scan:
    """A cloud of a known surface."""

    mesh: trimesh.Trimesh
    points: np.ndarray
    denoise: bool = False


@dataclass(frozen=True)
class Errors:
    """Expected and true errors of points of one shape."""

    expected: np.ndarray
    true: np.ndarray


def scans_of_parts(kind: str, count: int, split: str = "test") -> Iterator[Scan]:
    """Clouds of the first parts of a split."""
    registry = load_plugins()
    (recipe,) = load(RECIPE, registry, PARTS[kind])
    shapes = recipe.data.shapes.build(registry, "shapes")
    touch = recipe.data.touch.build(registry, "touch")
    for name in shapes.names(split)[:count]:
        item = shapes.item(name)
        sample = make_sample(item, touch, recipe.data, 0, recipe.data_seed)
        mesh, scale = scaled(item.mesh)
        points = scale * sample.sphere.denormalize(sample.points)
        if "random" in kind and "noise" in kind:
            points = noisy(points, NOISE, np.random.default_rng([0, *name.encode()]))
        yield Scan(mesh, points, "denoise" in kind)


def scans_of_shapes(file: Path, kind: str) -> Iterator[Scan]:
    """Clouds of PU-GAN's shapes, with a radius of 1."""
    for number, shape in enumerate(pugan.read(file)):
        points = shape.sparse[RATE]
        scale = 1 / radius(points)
        mesh = trimesh.Trimesh(scale * shape.mesh.vertices, shape.mesh.faces, process=False)
        points = scale * points
        yield Scan(mesh, noisy(points, NOISE, np.random.default_rng([0, number])) if "noise" in kind else points)


def scaled(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, float]:
    """A part with a longest side of `LONGEST`, and the factor."""
    vertices = np.asarray(mesh.vertices)
    scale = LONGEST / float(np.ptp(vertices, axis=0).max())
    return trimesh.Trimesh(scale * vertices, mesh.faces, process=False), scale


def upsampled(model: pcsr.Model, scan: Scan) -> Errors:
    """The errors of the points that a model adds to a cloud."""
    dense = model.upsample(Cloud(scan.points), rate=RATE, fields=["error"], denoise=scan.denoise)
    new = len(scan.points)
    return Errors(dense.columns["error"][new:], distances(dense.points[new:], scan.mesh))


def joined(some: Sequence[Errors]) -> Errors:
    """The errors of several clouds of one shape as one."""
    return Errors(*(np.concatenate([getattr(one, name) for one in some]) for name in ("expected", "true")))


def touched(count: int) -> Iterator[Errors]:
    """The errors of touched points after the registration, of the first parts of the test split."""
    for name in CadParts().names("test")[:count]:
        mesh, _ = scaled(CadParts().item(name).mesh)
        item = pcsr.ShapeItem(name, name, mesh)
        cloud = surface_points(mesh, 512, np.random.default_rng([0, *name.encode()]))
        noise = Noise(position_noise=ARM.position, rotation_noise=ARM.rotation)
        try:
            touches = Digit(object_size=LONGEST, noise=noise).touches(item, cloud, TOUCHES, 0)
        except UserError as error:
            click.echo(f"left out: {error}", err=True)
            continue
        used = [one for one in pcsr.register(touches, cloud, pose_error=ARM).touches if one.verdict != "refused"]
        points = [one.touch.points * one.touch.unit for one in used]
        if used:
            errors = np.concatenate([one.errors * one.touch.unit for one in used])
            yield Errors(errors, distances(np.concatenate(points), mesh))
