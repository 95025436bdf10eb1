"""Fits the network that guesses the far side of an object seen from one side, on generated training shapes.

python benchmarks/fit_far_side.py WORK [--views 20] [--epochs 16] [--save]

WORK keeps the images. Every eighth family of parts is left out, and shows the error on unseen families. Views differ in
direction, distance of the camera, number of points and noise; half of them are drawn along a direction that is up to 35
degrees off, as an estimated one may be; touched points are drawn on the far side of most. Depths are in half widths of
the cloud.
"""

import time
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
import torch
from rich.progress import track
from safetensors.torch import save_file
from torch.nn.functional import binary_cross_entropy_with_logits

from pcsr.errors import UserError
from pcsr.exploration.far_side.image import PIXELS, ViewFrame, image, pixel_centres
from pcsr.exploration.far_side.network import FILE, FarSideNetwork
from pcsr.files import write_whole
from pcsr.geometry.rays import MeshRays
from pcsr.plugins.loading import load_plugins

SHAPES = (("cad-parts", 640), ("blobs", 160))
"""Sources of training shapes, and their numbers."""
CAMERA = 96
"""Width of the camera's image."""
DISTANCES = (3.0, 5.0, 50.0)
"""Distances of the camera, in radii of the object."""
COUNTS = (128, 3000)
"""Smallest and largest number of points of a cloud; its logarithm is uniform."""
NOISES, CLEAN = (0.001, 0.01), 0.6
"""Smallest and largest noise of a cloud, in radii, and the share of clouds without noise."""
OFF, EXACT = 35.0, 0.5
"""Largest angle in degrees by which the direction is off, and the share of views of which it is exact."""
TOUCHES, UNTOUCHED = 5, 0.3
"""Largest number of touches, and the share of views without any."""
BATCH, RATE = 16, 3e-3
DEPTH = 0.3
"""Weight of the depths in the loss, beside that of the occupancy."""
Example = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Image, occupancy and depth of the far side."""


def axes_along(direction: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Axes as columns, turned at random about the last, which is the direction."""
    first = np.cross(np.eye(3)[np.abs(direction).argmin()], direction)
    first /= np.linalg.norm(first)
    angle = rng.uniform(0, 2 * np.pi)
    x = np.cos(angle) * first + np.sin(angle) * np.cross(direction, first)
    return np.column_stack([x, np.cross(direction, x), direction])


def seen(rays: MeshRays, direction: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Points that a camera sees, at random among its pixels, with noise."""
    distance, radius = float(rng.choice(DISTANCES)), rays.reach / 2
    at = (2 * (np.arange(CAMERA) + 0.5) / CAMERA - 1) * 1.02 / np.sqrt(distance**2 - 1)
    x, y = np.meshgrid(at, at)
    sight = np.column_stack([x.ravel(), y.ravel(), -np.ones(x.size)]) @ axes_along(direction, rng).T
    starts = np.broadcast_to(distance * radius * direction, sight.shape)
    depths = rays.depths(starts, sight)
    points = (starts + sight * np.where(np.isfinite(depths), depths, 0)[:, None])[np.isfinite(depths)]
    points = rng.permutation(points)[: int(np.exp(rng.uniform(*np.log(COUNTS))))]
    noise = 0.0 if rng.random() < CLEAN else float(np.exp(rng.uniform(*np.log(NOISES))))
    return points + noise * radius * rng.normal(size=points.shape)


def far_depths(rays: MeshRays, frame: ViewFrame) -> np.ndarray:
    """Depth of the last surface on the line of sight of each pixel; NaN where there is none."""
    behind = -3 * rays.reach / frame.scale
    starts = frame.back(np.column_stack([pixel_centres(), np.full(PIXELS**2, behind)]))
    depths = rays.depths(starts, np.broadcast_to(frame.axes[:, 2], starts.shape))
    return np.where(np.isfinite(depths), behind + depths / frame.scale, np.nan)


def touched(depths: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Points of the far side that a few touches would find, in the frame of the image."""
    at, rows = pixel_centres(), np.flatnonzero(np.isfinite(depths))
    patches = [np.zeros((0, 3))]
    for _ in range(0 if rng.random() < UNTOUCHED else rng.integers(1, TOUCHES + 1)):
        near = rows[(np.abs(at[rows] - at[rng.choice(rows)]) < rng.uniform(0.05, 0.35)).all(1)]
        if len(near):
            near = near[depths[near] < depths[near].min() + rng.uniform(0.02, 0.15)]
            patches.append(np.column_stack([at[near], depths[near]]))
    return np.concatenate(patches)


def example(rays: MeshRays, rng: np.random.Generator) -> Example | None:
    """A random view of a mesh; None if it shows too little."""
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    points = seen(rays, direction, rng)
    if len(points) < 64:
        return None
    if rng.random() >= EXACT:
        angle = np.radians(rng.uniform(0, OFF))
        direction = np.cos(angle) * direction + np.sin(angle) * axes_along(direction, rng)[:, 0]
    frame = ViewFrame.along(points, axes_along(direction, rng))
    depths = far_depths(rays, frame)
    if not np.isfinite(depths).any():
        return None
    drawn = image(frame.local(points), touched(depths, rng))
    square = depths.reshape(PIXELS, PIXELS)
    return drawn, np.isfinite(square), np.nan_to_num(square, nan=0.0).astype(np.float32)


def make(work: Path, views: int) -> Iterator[tuple[str, list[Example]]]:
    """Yield the family of each shape, and its views; they are made where the folder lacks them."""
    registry = load_plugins()
    for name, count in SHAPES:
        source = registry.get("shapes", name)()
        for number, shape in enumerate(track(source.names("train")[:count], name, transient=True)):
            file = work / f"{name}-{number:04d}-{views}.npz"
            if not file.exists():
                rng = np.random.default_rng([3, number, *name.encode()])
                try:
                    rays = MeshRays(source.item(shape).mesh, 1.0, shape)
                except UserError:
                    continue
                found = [one for one in (example(rays, rng) for _ in range(views)) if one is not None]
                arrays = {key: np.stack(one) for key, one in zip("iod", zip(*found, strict=True), strict=True)}
                write_whole(file, lambda part, arrays=arrays: _save(part, arrays))
            kept = np.load(file)
            family = shape.split("/")[1] if name == "cad-parts" else name
            yield family, list(zip(kept["i"], kept["o"], kept["d"], strict=True))


def _save(part: Path, arrays: dict[str, np.ndarray]) -> None:
    with part.open("wb") as file:
        np.savez_compressed(file, **arrays)


def losses(network: FarSideNetwork, images: torch.Tensor, occupied: torch.Tensor, depths: torch.Tensor) -> list:
    """The loss, the cross entropy of the occupancy, and the mean absolute error of the depths."""
    logits, guessed, error = network(images)
    mask = occupied.float()
    entropy = binary_cross_entropy_with_logits(logits, mask)
    off = (guessed - depths).abs()
    depth = ((off / error.exp() + error) * mask).sum() / mask.sum()  # of a Laplace distribution
    return [entropy + DEPTH * depth, entropy, (off * mask).sum() / mask.sum()]


def turned(batch: list[torch.Tensor]) -> list[torch.Tensor]:
    """The batch turned by a multiple of 90 degrees, and mirrored, at random."""
    turns, mirror = int(torch.randint(4, ())), bool(torch.rand(()) < 0.5)
    quarter = [torch.rot90(one, turns, (-2, -1)) for one in batch]
    return [one.flip(-1) for one in quarter] if mirror else quarter


@click.command()
@click.argument("work", type=click.Path(path_type=Path, file_okay=False))
@click.option("--views", default=20, show_default=True, help="Views of each shape.")
@click.option("--epochs", default=16, show_default=True)
@click.option("--save", "saving", is_flag=True, help="Write the weights that pcsr ships.")
def main(work: Path, views: int, epochs: int, saving: bool) -> None:
    """Fit the network, and print its errors on families that are left out."""
    work.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    families, examples = [], []
    for family, found in make(work, views):
        examples += found
        families += [family] * len(found)
    data = [torch.from_numpy(np.stack(one)) for one in zip(*examples, strict=True)]
    left_out = np.isin(families, sorted(set(families))[::8])
    train = np.flatnonzero(~left_out)
    test = torch.from_numpy(np.flatnonzero(left_out))
    torch.manual_seed(0)
    network = FarSideNetwork()
    optimizer = torch.optim.AdamW(network.parameters(), RATE, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, RATE, epochs * (len(train) // BATCH))
    for epoch in range(epochs):
        start = time.monotonic()
        torch.manual_seed(epoch)
        order = np.random.default_rng(epoch).permutation(train)
        for first in range(0, len(order) - BATCH + 1, BATCH):
            rows = torch.from_numpy(order[first : first + BATCH])
            optimizer.zero_grad()
            losses(network, *turned([one[rows] for one in data]))[0].backward()
            optimizer.step()
            schedule.step()
        with torch.no_grad():
            found = [torch.stack(losses(network, *[one[rows] for one in data])) for rows in test.split(64)]
        loss, entropy, off = torch.stack(found).mean(0).tolist()
        seconds = time.monotonic() - start
        click.echo(f"epoch {epoch + 1}: loss {loss:.4f}, occupancy {entropy:.4f}, depth {off:.4f}, {seconds:.0f} s")
    if saving:
        half = {name: tensor.half() for name, tensor in network.state_dict().items()}
        write_whole(FILE, lambda part: save_file(half, part))


if __name__ == "__main__":
    main()
