"""Fits the networks that predict the errors of points, on generated training shapes.

python benchmarks/fit_errors.py WORK [--clouds 2400] [--save]

Clouds are upsampled by the default model, by another one, and every fourth by interpolation too; WORK keeps them with
the true errors of some points, so that the command continues after an interruption. One network is fitted to all
points, another one to those whose errors the default model predicts. A fifth of the clouds, those of other shapes, show
the loss on unseen ones; the networks that are saved are fitted to all.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import error_clouds
import numpy as np
import torch
from rich.progress import track
from safetensors.numpy import save_file

from pcsr.errors import PcsrError
from pcsr.files import write_whole
from pcsr.plugins.loading import load_plugins
from pcsr.uncertainty.features import PREDICTED, Patch, features, of_prediction
from pcsr.uncertainty.fitted import FILE
from pcsr.uncertainty.quantile_network import LIMIT, RESOLUTION
from pcsr.upsample.candidates import Candidates
from pcsr.weights import DEFAULT

QUANTILE = 0.68
"""Share of the points that lie within their expected error."""
EVERY = 4
"""Every so many clouds, one is upsampled by interpolation too."""
EACH = 500
"""Number of points of a cloud and model that are fitted."""
HIDDEN = 64
EPOCHS, BATCH, RATE = 20, 1024, 3e-3
TARGET = "target"


@dataclass(frozen=True)
class Sample:
    """A cloud with the points that a model added to it, and the true errors of some of them."""

    points: np.ndarray
    removed: np.ndarray
    new: np.ndarray
    predicted: np.ndarray
    chosen: np.ndarray
    errors: np.ndarray
    """Errors of the chosen new points."""

    def rows(self) -> dict[str, np.ndarray]:
        """Features of the chosen points, and the logarithms of their errors in spacings."""
        found, unit = features(Patch(self.points, self.new, float(self.removed)), self.chosen)
        predicted = self.predicted[self.chosen]
        found[PREDICTED] = np.where(predicted > 0, of_prediction(predicted, unit), np.nan)
        return {**found, TARGET: np.log(self.errors / unit + RESOLUTION)}


def make(work: Path, count: int) -> list[Path]:
    """Make the samples that the folder lacks, and return the files of all."""
    work.mkdir(parents=True, exist_ok=True)
    shapes = {name: load_plugins().get("shapes", name)() for name in sorted(set(error_clouds.SHAPES))}
    models = error_clouds.sources_of([DEFAULT, error_clouds.INTERPOLATION, *error_clouds.OTHERS])
    wanted = {number: [work / name for name in names_of(number)] for number in range(count)}
    missing = [number for number, files in wanted.items() if not files[-1].exists()]
    for number, case, rng in error_clouds.usable(track(missing, "clouds", transient=True), shapes):
        other, own = str(rng.choice(error_clouds.OTHERS)), rng.spawn(1)[0]
        first, second, *third = wanted[number]
        if not second.exists():
            _save(first, sample(case, models[DEFAULT], rng))
            _save(second, sample(case, models[other], rng))
        for file in third:
            _save(file, sample(case, models[error_clouds.INTERPOLATION], own))
    return [file for files in wanted.values() for file in files if file.exists()]


def sample(case: error_clouds.Case, source: Candidates, rng: np.random.Generator) -> Sample:
    """A cloud that is upsampled at a random rate, and the errors of some of the new points."""
    rate = error_clouds.random_rate(len(case.points), rng)
    added = error_clouds.upsampled(case, source, rate, keep=rng.random() >= error_clouds.REPLACED)
    chosen = rng.permutation(len(added.points))[:EACH]
    errors = error_clouds.distances(added.points[chosen], case.mesh)
    return Sample(case.points, np.array(case.removed), added.points, added.predicted, chosen, errors)


def names_of(number: int) -> list[str]:
    """The names of a cloud's files: of the default model, of another one, and of interpolation at some clouds."""
    return [f"{number:05d}-{which}.npz" for which in range(2 if number % EVERY else 3)]


def _save(path: Path, sample: Sample) -> None:
    def written(part: Path) -> None:
        with part.open("wb") as file:
            np.savez_compressed(file, **vars(sample))

    write_whole(path, written)


def stacked(clouds: Sequence[Mapping[str, np.ndarray]], names: Sequence[str]) -> tuple[torch.Tensor, torch.Tensor]:
    """The features with these names as a matrix, and the targets; rows without one of them are left out."""
    inputs = np.concatenate([np.stack([cloud[name] for name in names], 1) for cloud in clouds]).astype(np.float32)
    targets = np.concatenate([cloud[TARGET] for cloud in clouds]).astype(np.float32)
    known = np.isfinite(inputs).all(1)
    return torch.from_numpy(inputs[known]), torch.from_numpy(targets[known])


def pinball(errors: torch.Tensor) -> torch.Tensor:
    """The loss whose least mean is at the quantile."""
    return torch.maximum(QUANTILE * errors, (QUANTILE - 1) * errors).mean()


class Fit:
    """A network in training."""

    def __init__(self, inputs: torch.Tensor, targets: torch.Tensor, title: str) -> None:
        torch.manual_seed(0)
        self.mean, self.deviation = inputs.mean(0), inputs.std(0).clamp_min(1e-6)
        linear, silu = torch.nn.Linear, torch.nn.SiLU
        self.layers = torch.nn.Sequential(
            linear(inputs.shape[1], HIDDEN), silu(), linear(HIDDEN, HIDDEN), silu(), linear(HIDDEN, 1)
        )
        with torch.no_grad():
            self.layers[-1].bias.fill_(float(np.quantile(targets.numpy(), QUANTILE)))
        steps = EPOCHS * (len(targets) // BATCH)
        optimizer = torch.optim.AdamW(self.layers.parameters(), RATE, weight_decay=1e-3)
        schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, RATE, steps)
        for _ in track(range(EPOCHS), title, transient=True):
            order = torch.randperm(len(targets))
            for start in range(0, len(order) - BATCH + 1, BATCH):
                rows = order[start : start + BATCH]
                optimizer.zero_grad()
                pinball(targets[rows] - self(inputs[rows])).backward()
                optimizer.step()
                schedule.step()

    def __call__(self, inputs: torch.Tensor) -> torch.Tensor:
        """The predicted logarithms."""
        standard = ((inputs - self.mean) / self.deviation).clamp(-LIMIT, LIMIT)
        return self.layers(standard)[:, 0]

    def loss(self, inputs: torch.Tensor, targets: torch.Tensor) -> float:
        """The mean loss of points."""
        with torch.no_grad():
            return float(pinball(targets - self(inputs)))

    def tensors(self) -> dict[str, np.ndarray]:
        """The arrays of the network's file."""
        linear = [layer for layer in self.layers if isinstance(layer, torch.nn.Linear)]
        found = {"mean": self.mean, "deviation": self.deviation}
        for number, layer in enumerate(linear):
            found |= {f"weight.{number}": layer.weight.detach(), f"bias.{number}": layer.bias.detach()}
        return {name: tensor.numpy().copy() for name, tensor in found.items()}


@click.command()
@click.argument("work", type=click.Path(path_type=Path, file_okay=False))
@click.option("--clouds", "count", type=click.IntRange(10, 2400), default=2400, show_default=True)
@click.option("--save", "saving", is_flag=True, help="Write the networks to pcsr/uncertainty.")
def main(work: Path, count: int, saving: bool) -> None:
    """Fit the networks, print their losses, and save them."""
    torch.set_num_threads(1)
    try:
        files = track(make(work, count), "features", transient=True)
        clouds = [Sample(**np.load(file)).rows() for file in files]
    except PcsrError as error:
        raise click.ClickException(str(error)) from error
    every = [name for name in clouds[0] if name not in (TARGET, PREDICTED)]
    names, tensors = {"plain": every, "rated": [*every, PREDICTED]}, {}
    fifth = len(clouds) // 5
    for kind, own in names.items():
        trial = Fit(*stacked(clouds[fifth:], own), f"{kind}, trial")
        losses = [trial.loss(*stacked(part, own)) for part in (clouds[fifth:], clouds[:fifth])]
        click.echo(f"{kind}: loss {losses[0]:.4f}, on other shapes {losses[1]:.4f}")
        if saving:
            fitted = Fit(*stacked(clouds, own), kind).tensors()
            tensors |= {f"{kind}.{name}": array for name, array in fitted.items()}
    if saving:
        write_whole(FILE, lambda part: save_file(tensors, part, {"names": json.dumps(names)}))


if __name__ == "__main__":
    main()
