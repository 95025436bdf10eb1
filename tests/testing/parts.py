"""Parts that keep their contract: each broken one is one of these with one thing wrong."""

import numpy as np
import torch
import trimesh
from torch import nn

from pcsr import (
    Backbone,
    Encoder,
    Fusion,
    Logger,
    Objective,
    Policy,
    ShapeItem,
    ShapeSource,
    Touch,
    TouchSource,
    Trait,
    Upsampler,
    UserError,
)


class Lift(Encoder):
    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(self, widths, *, channels: int = 6) -> None:
        super().__init__()
        self.channels = channels
        self.layer = nn.Linear(3, channels)

    def forward(self, points):
        return torch.tanh(self.layer(points))


class Attend(Fusion):
    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.TOUCH_PERMUTATION_INVARIANT})

    def __init__(self, widths) -> None:
        super().__init__()
        self.layer = nn.Linear(widths.touch, widths.visual)

    def forward(self, points, features, touches):
        there = touches.mask[:, :, None, None].to(features.dtype)
        messages = (self.layer(touches.features) * there).sum((1, 2)) / there.sum((1, 2)) / touches.points.shape[2]
        return features + torch.tanh(messages).unsqueeze(1)


class Join(Fusion):
    """Joins the touches to the cloud, whatever their number in each row: missing ones are copies of a point."""

    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.TOUCH_PERMUTATION_INVARIANT})
    uses_touch_features = False

    def __init__(self, widths) -> None:
        super().__init__()

    def join(self, points, touches):
        most = int(touches.mask.sum(1).max()) if touches.mask.numel() else 0
        rows = []
        for row, there, own in zip(points, touches.mask, touches.points, strict=True):
            touched = own[there].flatten(0, 1)
            missing = (most - int(there.sum())) * touches.points.shape[2]
            rows.append(torch.cat([row, touched, row[:1].expand(missing, -1)]))
        return torch.stack(rows)


class Refine(Backbone):
    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(self, widths, *, channels: int = 7) -> None:
        super().__init__()
        self.channels = channels
        self.layer = nn.Linear(widths.visual + 3, channels)

    def forward(self, points, features):
        return torch.tanh(self.layer(torch.cat([points, features], -1)))


class Copy(Upsampler):
    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    def __init__(self, widths) -> None:
        super().__init__()
        self.rate = widths.rate
        self.layer = nn.Linear(widths.refined, 3 * widths.rate)

    def forward(self, points, features, rate):
        if rate != self.rate:
            raise UserError(f"upsampler 'copy' was built for rate {self.rate}, not {rate}")
        offsets = self.layer(features)
        return points.repeat_interleave(rate, 1) + offsets.reshape(points.shape[0], -1, 3)


class Squares(Objective):
    def __init__(self, *, weight: float = 1.0) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.tensor(weight))

    def forward(self, prediction, target):
        gaps = torch.cdist(prediction, target.detach()).argmin(2)
        met = target.gather(1, gaps.unsqueeze(-1).expand(-1, -1, 3))
        return {"squares": (self.weight * (prediction - met).square().sum(-1)).mean()}


class Pats(TouchSource):
    """The vertices around one of the mesh's."""

    def __init__(self, *, points: int = 12) -> None:
        self.points = points

    def touches(self, item, cloud, count, seed):
        return [self.touch(item, np.random.default_rng((seed, number))) for number in range(count)]

    def touch(self, item, rng):
        vertices = np.asarray(item.mesh.vertices)
        middle = vertices[rng.integers(len(vertices))]
        near = np.linalg.norm(vertices - middle, axis=1).argsort()[: self.points]
        return Touch.single(vertices[near], np.eye(4), 1.0, "pat")


class Boxes(ShapeSource):
    def __init__(self, *, count: int = 3) -> None:
        self.counts = {"train": count, "validation": 1}

    def names(self, split):
        if split not in self.counts:
            raise UserError(f"shapes 'boxes' have no split '{split}'")
        return [f"{split}/{number}" for number in range(self.counts[split])]

    def item(self, name):
        return ShapeItem(name, "box", trimesh.creation.box([1.0, 2.0, 3.0 + int(name[-1])]))


class Notes(Logger):
    """A line for each call of `log`; those of later steps go when a training goes on."""

    def start(self, folder, recipe, step):
        self.path = folder / "notes.txt"
        lines = self.path.read_text().splitlines() if self.path.exists() else []
        if kept := [line for line in lines if int(line.split()[0]) <= step]:
            self.path.write_text("\n".join(kept) + "\n")

    def log(self, step, values):
        with self.path.open("a") as file:
            file.write(f"{step} {dict(values)}\n")


class Far(Policy):
    """The distance to the middle of all known points."""

    def scores(self, candidates, cloud, touched):
        return np.linalg.norm(candidates.points - np.concatenate([cloud, touched]).mean(0), axis=1)


SOUND = {
    "encoder": Lift,
    "fusion": Attend,
    "backbone": Refine,
    "upsampler": Copy,
    "objective": Squares,
    "touch": Pats,
    "shapes": Boxes,
    "logger": Notes,
    "policy": Far,
}
