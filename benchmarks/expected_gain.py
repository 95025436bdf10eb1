"""What touches chosen by policies take off the error, beside what `expected-error` expects of its own.

python benchmarks/expected_gain.py [--split test] [--parts 24] [--seeds 3] [--one-side] [--guessed] [--tries 400]
    [--policy NAME …] [--work FOLDER] [--save]

Parts of 30 mm of `cad-parts`, 512 random points or the view of one camera, four touches, model `field`. The candidates
lie on the true surface, as in recipes; with --guessed the touches are those that `pcsr touch next` proposes, from the
cloud and the touches so far alone. All policies have the same number of candidates. The table has the mean Chamfer
distance over parts and seeds without and with touches, the change of these means with its standard deviation over
seeds, the mean change of a part, the poses at which the finger failed (candidates on the true surface at which it would
fail are left out), and the ratio of the expected gains to the measured ones: their means over parts, that of shares of
each part's error, and the number of parts on which it is within a factor of 1.5. FOLDER keeps what is measured, so that
the command continues after an interruption.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import numpy as np
from jaxtyping import Float
from saved import save, show
from scipy.spatial import cKDTree

import pcsr
from pcsr.contracts import Policy, ShapeItem
from pcsr.data.sample import Sample, make_sample
from pcsr.errors import UserError
from pcsr.exploration.loop import explore
from pcsr.files import write_text
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import Data, PartSpec
from pcsr.testing.policies import scene
from pcsr.upsample.protocol import upsample_as
from pcsr_plugins.touch.digit import Digit
from pcsr_plugins.touch.digit.policies import PolicyOptions

HEADS = [
    "policy",
    "cd ×10³ without touch",
    "with touches",
    "change",
    "of a part",
    "failed",
    "expected / measured",
    "of shares",
    "within 1.5",
]
SIZE = 30.0
"""Longest side of the parts, in mm."""
TOUCHES = 4


@dataclass
class Measured:
    """Chamfer distances ×10³ of one policy before and after the touches, and the expected gains ×10³."""

    before: list[float] = field(default_factory=list)
    after: list[float] = field(default_factory=list)
    expected: list[float] = field(default_factory=list)
    failed: list[int] = field(default_factory=list)
    """Poses at which the finger could not touch."""
    seeds: list[int] = field(default_factory=list)

    @property
    def seed(self) -> np.ndarray:
        """The seed of each value."""
        return np.array(self.seeds)

    def extend(self, other: Mapping[str, list[Any]], seed: int) -> None:
        """Append the values of a part."""
        for name, values in other.items():
            getattr(self, name).extend(values)
        self.seeds.append(seed)


class Recorded(Policy):
    """A policy whose scores are kept, to find those of the touches that were made."""

    def __init__(self, policy: Policy) -> None:
        self.policy, self.uses_cloud = policy, policy.uses_cloud  # type: ignore[misc]
        self.calls: list[tuple[Float[np.ndarray, "p 3 3"], Float[np.ndarray, " p"]]] = []

    def scores(self, candidates, cloud, touched):  # type: ignore[no-untyped-def]
        """Return the scores of the policy."""
        scores = self.policy.scores(candidates, cloud, touched)
        self.calls.append((candidates.frames, scores))
        return scores


def expected(recorded: Recorded, touches: Sequence[pcsr.Touch]) -> float:
    """Sum of the scores of the touches, in mm²."""
    total = 0.0
    for touch, (frames, scores) in zip(touches, recorded.calls, strict=True):
        frame = touch.poses[0][:3, :3] * touch.unit
        total += float(scores[np.abs(frames - frame).sum((1, 2)).argmin()])
    return total


def distance(dense: Float[np.ndarray, "n 3"], truth: Float[np.ndarray, "g 3"]) -> float:
    """The Chamfer distance."""
    one, other = cKDTree(truth).query(dense)[0], cKDTree(dense).query(truth)[0]
    return float((one**2).mean() + (other**2).mean())


@dataclass(frozen=True)
class Made:
    """Touches of one part, with what was expected of them."""

    sample: Sample
    touches: list[Float[np.ndarray, "m 3"]]
    """In the frame of the sample."""
    expected: float
    """Sum of the expected gains, in units of the sample; NaN if the policy does not expect any."""
    failed: int = 0


Way = Callable[[ShapeItem, str, Data, int, int], Made]
"""How a part is touched."""


def on_the_surface(item: ShapeItem, name: str, data: Data, tries: int, seed: int) -> Made:
    """Touch a part as recipes do: the candidates lie on the true surface, and those that fail are left out."""
    source = Digit(object_size=SIZE, policy=PolicyOptions(use=name, tries=tries))
    recorded = Recorded(source.hand.policy)
    object.__setattr__(source.hand, "policy", recorded)
    made: list[pcsr.Touch] = []
    original = source.touches

    def touches(*args):  # type: ignore[no-untyped-def]
        made.extend(original(*args))
        return made

    source.touches = touches  # type: ignore[method-assign]
    sample = make_sample(item, source, data, TOUCHES, seed)
    scale = (sample.sphere.radius * made[0].unit) ** 2
    gains = expected(recorded, made) / scale if recorded.policy.error(*scene()) is not None else np.nan
    return Made(sample, list(sample.touches), gains)


def on_the_guess(item: ShapeItem, name: str, data: Data, tries: int, seed: int) -> Made:
    """Touch a part as `pcsr touch next` proposes, from the cloud and the touches so far alone."""
    source = Digit(object_size=SIZE)
    sample = make_sample(item, source, data, 0, seed)
    policy = load_plugins().get("policy", name)()
    cloud = sample.sphere.denormalize(sample.points)
    found = explore(item, source, cloud, policy, TOUCHES, candidates=tries, seed=seed)
    gains = sum(np.nan if one.gain is None else one.gain for one in found.chosen)
    touches = [sample.sphere.normalize(touch.points) for touch in found.touches]
    return Made(sample, touches, gains / (sample.sphere.radius * found.unit) ** 2, found.failed)


def measure(made: Made, model: pcsr.Model, into: Measured) -> None:
    """Upsample the cloud of a part without and with its touches, and append the distances."""
    assert model.network is not None
    assert model.recipe is not None
    sample = made.sample
    for touches, distances in (([], into.before), (made.touches, into.after)):
        dense = upsample_as(model.recipe, model.network, sample.points, touches)
        distances.append(1e3 * distance(dense, sample.truth))
    into.expected.append(1e3 * made.expected)
    into.failed.append(made.failed)


def cells(name: str, one: Measured, seeds: int) -> list[str]:
    """The row of a policy."""
    before, after, gains = np.array(one.before), np.array(one.after), np.array(one.expected)
    change = after.mean() / before.mean() - 1
    of_seeds = [after[one.seed == seed].mean() / before[one.seed == seed].mean() - 1 for seed in range(seeds)]
    parts = ["", "", ""]
    if np.isfinite(gains).all():
        with np.errstate(divide="ignore", invalid="ignore"):  # a part without a touch
            ratio = gains / (before - after)
        shares = gains / before, (before - after) / before
        within = int(((ratio > 1 / 1.5) & (ratio < 1.5)).sum())
        overall = f"{gains.mean() / (before - after).mean():.2f}"
        parts = [overall, f"{shares[0].mean() / shares[1].mean():.2f}", f"{within}/{len(ratio)}"]
    return [
        f"`{name}`",
        f"{before.mean():.3f}",
        f"{after.mean():.3f}",
        f"{change:+.1%} ± {np.std(of_seeds):.1%}",
        f"{(after / before).mean() - 1:+.1%}",
        str(sum(one.failed)),
        *parts,
    ]


def trial(item: ShapeItem, names: Sequence[str], data: Data, tries: int, seed: int, way: Way, model: pcsr.Model) -> str:
    """Touch a part by each policy, and return the distances as JSON."""
    found = {name: Measured() for name in names}
    for name, into in found.items():
        measure(way(item, name, data, tries, seed), model, into)
    return json.dumps({name: vars(one) for name, one in found.items()})


@click.command()
@click.option("--split", type=click.Choice(["train", "test"]), default="test", show_default=True)
@click.option("--parts", default=24, show_default=True)
@click.option("--seeds", default=3, show_default=True)
@click.option("--one-side", is_flag=True)
@click.option("--guessed", is_flag=True, help="Poses as `pcsr touch next` proposes them.")
@click.option("--tries", default=400, show_default=True, help="Candidates of each touch.")
@click.option("--policy", "policies", multiple=True, default=("uniform", "sparse", "expected-error"), show_default=True)
@click.option("--work", type=click.Path(path_type=Path, file_okay=False), help="Folder for what is measured.")
@click.option("--save", "saving", is_flag=True, help="Write the table to docs/numbers.")
def main(
    split: str,
    parts: int,
    seeds: int,
    one_side: bool,
    guessed: bool,
    tries: int,
    policies: tuple[str, ...],
    work: Path | None,
    saving: bool,
) -> None:
    """Print the table."""
    registry, model = load_plugins(), pcsr.load("field")
    shapes = registry.get("shapes", "cad-parts")(held_out=24)
    data = Data(
        shapes=PartSpec(use="cad-parts"), touch=PartSpec(use="digit"), sampling="view" if one_side else "random"
    )
    way = on_the_guess if guessed else on_the_surface
    options = f"{' --one-side' if one_side else ''}{' --guessed' if guessed else ''} --tries {tries}"
    found = {name: Measured() for name in policies}
    for part in shapes.names(split)[:parts]:
        for seed in range(seeds):
            words = f"{part}{options}-{seed}-{'-'.join(policies)}".replace("/", "-").replace(" ", "")
            file = work / f"{words}.json" if work else None
            try:
                if file is None or not file.exists():
                    made = trial(shapes.item(part), policies, data, tries, seed, way, model)
                    if file is not None:
                        write_text(file, made)
                else:
                    made = file.read_text()
            except UserError as error:  # a part that one policy cannot touch is left out of all
                click.echo(f"left out: {error}", err=True)
                continue
            for name, measured in json.loads(made).items():
                found[name].extend(measured, seed)
            shares = ", ".join(f"{name} {one.after[-1] / one.before[-1] - 1:+.1%}" for name, one in found.items())
            click.echo(f"{part}, seed {seed}: {shares}", err=True)
    seen = "one camera" if one_side else "512 random points"
    rows = [cells(name, one, seeds) for name, one in found.items()]
    show(HEADS, rows, f"{seen}, {TOUCHES} touches, {split} parts{', guessed surface' if guessed else ''}")
    if saving:
        name = f"gains{'-one-side' if one_side else ''}{'-guessed' if guessed else ''}"
        save(name, f"python benchmarks/expected_gain.py --seeds {seeds}{options}", HEADS, rows)


if __name__ == "__main__":
    main()
