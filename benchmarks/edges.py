"""Error at sharp edges: generated mechanical parts, 2048 points to 8192, through `Model.upsample`.

python benchmarks/edges.py [MODEL…] [--parts 12] [--save]

The parts are the first of the test split of `cad-parts`, in the unit sphere around their truth, which has 8192 points;
clouds are random subsets of it; seed 0. An edge is sharp where the normals of its faces differ by more than 30°. `at
edges` are the points within one spacing of the cloud (the mean distance to the nearest neighbour) of a sharp edge.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import click
import numpy as np
import trimesh
from rich.progress import track
from saved import save, show
from scipy.spatial import cKDTree

import pcsr
from pcsr.errors import PcsrError
from pcsr.geometry.frames import UnitSphere
from pcsr.geometry.sampling import poisson_points
from pcsr.model import INTERPOLATION
from pcsr.plugins.loading import load_plugins
from pcsr.weights import DEFAULT

COUNT, RATE = 2048, 4
ANGLE = np.radians(30)
"""Angle of normals from which on an edge is sharp."""
STEP = 0.002
"""Distance of the points that stand for an edge, in radii."""
SEED = 0
COLUMNS = ("model", "p2f at edges", "p2f elsewhere", "edge to cloud", "cd")
Cloud = np.ndarray


@dataclass(frozen=True)
class Part:
    """A part in the unit sphere."""

    mesh: trimesh.Trimesh
    truth: Cloud
    sparse: Cloud
    edges: Cloud
    """Points of the sharp edges, `STEP` apart."""
    spacing: float
    """Mean distance from a point of the sparse cloud to the nearest other one."""

    @classmethod
    def of(cls, mesh: trimesh.Trimesh, name: str) -> "Part":
        """Sample a part; its name is part of the seed."""
        rng = np.random.default_rng([SEED, *name.encode()])
        truth = poisson_points(mesh, COUNT * RATE, rng)
        sphere = UnitSphere.fit(truth)
        mesh = trimesh.Trimesh((mesh.vertices - sphere.centre) / sphere.radius, mesh.faces, process=True)
        truth = (truth - sphere.centre) / sphere.radius
        sparse = truth[rng.choice(len(truth), COUNT, replace=False)]
        spacing = float(cKDTree(sparse).query(sparse, k=[2])[0].mean())
        return cls(mesh, truth, sparse, sharp_edges(mesh), spacing)


def sharp_edges(mesh: trimesh.Trimesh) -> Cloud:
    """Points on the edges of a mesh whose faces meet at more than `ANGLE`."""
    sharp = mesh.face_adjacency_edges[mesh.face_adjacency_angles > ANGLE]
    starts, ends = mesh.vertices[sharp[:, 0]], mesh.vertices[sharp[:, 1]]
    lines = []
    for start, end in zip(starts, ends, strict=True):
        steps = max(2, int(np.linalg.norm(end - start) / STEP))
        lines.append(start + np.linspace(0, 1, steps)[:, None] * (end - start))
    return np.concatenate(lines) if lines else np.zeros((0, 3))


def errors(model: pcsr.Model, part: Part) -> list[float]:
    """Distances ×10³ of a part: new points at edges and elsewhere to the surface, edges to the cloud; cd ×10³."""
    dense = model.upsample(part.sparse, rate=RATE)
    new = dense[COUNT:]
    near = cKDTree(part.edges).query(new)[0] < part.spacing
    p2f = [
        pcsr.evaluate(points, part.truth, part.mesh, frame="none", metrics="p2f")["p2f"]
        for points in (new[near], new[~near])
    ]
    reach = cKDTree(dense).query(part.edges)[0].mean()
    cd = pcsr.evaluate(dense, part.truth, frame="none", metrics="cd")["cd"]
    return [1e3 * float(value) for value in (*p2f, reach, cd)]


@click.command()
@click.argument("models", nargs=-1)
@click.option("--parts", "count", type=click.IntRange(1), default=12, show_default=True)
@click.option("--save", "saving", is_flag=True, help="Write docs/numbers/edges.json.")
def main(models: Sequence[str], count: int, saving: bool) -> None:
    """Print a row for each MODEL (names, run folders, weights): the default, `frames` and interpolation if none."""
    rows = []
    try:
        shapes = load_plugins().get("shapes", "cad-parts")()
        names = shapes.names("test")[:count]
        parts = [Part.of(shapes.item(name).mesh, name) for name in track(names, "parts", transient=True)]
        parts = [part for part in parts if len(part.edges)]
        for name in models or (DEFAULT, "frames", INTERPOLATION):
            model = pcsr.load(name)
            found = np.array([errors(model, part) for part in track(parts, name, transient=True)])
            spread = found.std(0, ddof=1) if len(found) > 1 else np.full(found.shape[1], np.nan)
            rows.append([f"`{name}`", *(f"{m:.2f} ± {s:.2f}" for m, s in zip(found.mean(0), spread, strict=True))])
    except PcsrError as error:
        raise click.ClickException(str(error)) from error
    show(COLUMNS, rows, f"{len(parts)} parts, ×10³")
    if saving:
        save("edges", " ".join(["python benchmarks/edges.py", *models, "--save"]), COLUMNS, rows)


if __name__ == "__main__":
    main()
