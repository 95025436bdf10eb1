"""Clouds of known surfaces, upsampled: what expected errors are fitted to and measured on."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

import pcsr
from pcsr.data.view import seen_points
from pcsr.errors import UserError
from pcsr.geometry.sampling import poisson_points, surface_points
from pcsr.metrics.p2f import point_to_surface
from pcsr.model import candidates
from pcsr.recipe.schema import View
from pcsr.upsample.candidates import Candidates
from pcsr.upsample.denoise import denoise
from pcsr.upsample.dense import densify

SAMPLINGS = ("random", "thinned", "even", "one view", "four views")
"""Samplings of a surface: at random; at random among four times as many even points; even; by depth cameras."""
SHAPES = ("cad-parts", "cad-parts", "blobs")
"""Shapes in turn; the objects of each source are taken in their order."""
COUNTS = (180, 2900)
"""Smallest and largest number of points of a training cloud; its logarithm is uniform."""
NOISES = (0.001, 0.025)
"""Smallest and largest noise of a training cloud, in radii of the cloud; its logarithm is uniform."""
CLEAN, DENOISED = 0.4, 0.35
"""Share of the training clouds without noise, and share of the others from which noise is removed."""
ALONG = 0.5
"""Share of the noisy clouds of cameras whose noise is along the rays only."""
REPLACED = 0.15
"""Share of the training clouds whose given points are replaced by the new ones."""
RATES, MOST = (2, 4, 4, 4, 8, 16), 12_000
"""Rates of the training clouds, and the largest number of their points at rates above 4."""
OTHERS = ("midpoint", "tapsr", "frames", "pu-transformer")
"""Models of which one upsamples each training cloud, besides the default one and interpolation."""
INTERPOLATION = "midpoint"
Points = np.ndarray


@dataclass(frozen=True)
class Case:
    """A sparse cloud of a known surface."""

    mesh: trimesh.Trimesh
    points: Points
    removed: float = 0.0
    """Standard deviation of the noise that was removed."""


@dataclass(frozen=True)
class Added:
    """Points that a model added to a cloud."""

    points: Points
    predicted: np.ndarray
    """Error that the network predicts of each; 0 where it predicts none."""


def sampled(
    mesh: trimesh.Trimesh, sampling: str, count: int, rng: np.random.Generator, name: str, noise: float = 0.0
) -> Points:
    """Distinct points of a surface; a sampling is one of `SAMPLINGS`. Cameras have noise along their rays, in radii."""
    if sampling == "random":
        points = surface_points(mesh, count, rng)
    elif sampling == "even":
        points = poisson_points(mesh, count, rng)
    elif sampling == "thinned":
        points = rng.permutation(poisson_points(mesh, 4 * count, rng))[:count]
    else:
        view = View(cameras={"one view": 1, "four views": 4}[sampling], noise=noise)
        points = seen_points(mesh, count, view, rng, name)
    return np.unique(points, axis=0)


def noisy(points: Points, noise: float, rng: np.random.Generator) -> Points:
    """Points with Gaussian noise, whose standard deviation along each axis is given in radii of the cloud."""
    return points + noise * radius(points) * rng.normal(size=points.shape)


def radius(points: Points) -> float:
    """Radius of a cloud around its centroid."""
    return float(np.linalg.norm(points - points.mean(0), axis=1).max())


def training_case(number: int, sources: dict[str, pcsr.ShapeSource]) -> tuple[Case, np.random.Generator]:
    """A training cloud, and the random numbers for what is done with it.

    Raises:
        UserError: cameras see too few points of the shape.
    """
    rng = np.random.default_rng([7, number])
    turn, place = divmod(number, len(SHAPES))
    kind = SHAPES[place]
    source = sources[kind]
    name = source.names("train")[turn * SHAPES.count(kind) + SHAPES[:place].count(kind)]
    mesh = source.item(name).mesh
    sampling = str(rng.choice(SAMPLINGS))
    count = int(np.exp(rng.uniform(*np.log(COUNTS))))
    noise = 0.0 if rng.random() < CLEAN else float(np.exp(rng.uniform(*np.log(NOISES))))
    if "view" in sampling and rng.random() < ALONG:
        points = sampled(mesh, sampling, count, rng, name, noise)
    else:
        points = noisy(sampled(mesh, sampling, count, rng, name), noise, rng)
    if not noise or rng.random() >= DENOISED:
        return Case(mesh, points), rng
    found = denoise(points, noise * radius(points) if rng.random() < 0.5 else None)
    return Case(mesh, found.points, found.level), rng


def upsampled(case: Case, source: Candidates, rate: float, *, keep: bool = True) -> Added:
    """The points that a source adds to a cloud, or replaces it by."""
    new = densify(case.points, round(rate * len(case.points)), source, keep=keep)
    return Added(new.points, new.errors)


def random_rate(count: int, rng: np.random.Generator) -> float:
    """One of the rates that suit a cloud of so many points."""
    return float(rng.choice([rate for rate in RATES if rate <= 4 or rate * count <= MOST]))


def distances(points: Points, mesh: trimesh.Trimesh) -> np.ndarray:
    """Distance of each point from a surface."""
    return point_to_surface(points, np.asarray(mesh.vertices), np.asarray(mesh.faces))


def sources_of(models: Sequence[str]) -> dict[str, Candidates]:
    """The candidates of models by their names."""
    return {name: candidates(pcsr.load(name), alone=True) for name in models}


def usable(
    numbers: Sequence[int], sources: dict[str, pcsr.ShapeSource]
) -> Iterator[tuple[int, Case, np.random.Generator]]:
    """Training clouds of these numbers, without those that cannot be made."""
    for number in numbers:
        try:
            case, rng = training_case(number, sources)
        except UserError:
            continue
        yield number, case, rng
