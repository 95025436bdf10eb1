"""What touches chosen by policies take off the error, beside what `expected-error` expects of its own.

python benchmarks/expected_gain.py [--split test] [--parts 24] [--seeds 3] [--one-side] [--tries 400] [--policy NAME …]
    [--save]

Parts of 30 mm of `cad-parts`, 512 random points or the view of one camera, four touches, model `field`. The table has
the mean Chamfer distance over parts and seeds with touches, the change in percent, and the ratio of the expected gains
to the measured ones: their means over parts, and the number of parts on which the ratio is within a factor of 1.5.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import click
import numpy as np
from jaxtyping import Float
from saved import save, show
from scipy.spatial import cKDTree

import pcsr
from pcsr.contracts import Policy, ShapeItem
from pcsr.data.sample import make_sample
from pcsr.errors import UserError
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import Data, PartSpec
from pcsr.upsample.protocol import upsample_as
from pcsr_plugins.touch.digit import Digit
from pcsr_plugins.touch.digit.policies import PolicyOptions

SIZE = 30.0
"""Longest side of the parts, in mm."""
TOUCHES = 4


@dataclass
class Measured:
    """Chamfer distances ×10³ of one policy before and after the touches, and gains as shares of the distance before."""

    before: list[float] = field(default_factory=list)
    after: list[float] = field(default_factory=list)
    expected: list[float] = field(default_factory=list)


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


def measure(item: ShapeItem, name: str, data: Data, tries: int, seed: int, model: pcsr.Model, into: Measured) -> None:
    """Touch one part by one policy, upsample its cloud without and with the touches, and append the distances."""
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
    assert model.network is not None
    assert model.recipe is not None
    plain = distance(upsample_as(model.recipe, model.network, sample.points), sample.truth)
    touched = distance(upsample_as(model.recipe, model.network, sample.points, list(sample.touches)), sample.truth)
    into.before.append(1e3 * plain)
    into.after.append(1e3 * touched)
    scale = (sample.sphere.radius * made[0].unit) ** 2
    gives_gains = recorded.policy.error(*_anything()) is not None
    into.expected.append(1e3 * expected(recorded, made) / scale if gives_gains else np.nan)


def _anything():  # type: ignore[no-untyped-def]
    from pcsr.testing.policies import scene

    return scene()


def cells(name: str, one: Measured) -> list[str]:
    """The row of a policy."""
    before, after, gains = np.array(one.before), np.array(one.after), np.array(one.expected)
    change = after.mean() / before.mean() - 1
    parts = ["", "", ""]
    if np.isfinite(gains).all():
        ratio = gains / (before - after)
        shares = gains / before, (before - after) / before
        within = int(((ratio > 1 / 1.5) & (ratio < 1.5)).sum())
        overall = f"{gains.mean() / (before - after).mean():.2f}"
        parts = [overall, f"{shares[0].mean() / shares[1].mean():.2f}", f"{within}/{len(ratio)}"]
    return [f"`{name}`", f"{before.mean():.3f}", f"{after.mean():.3f}", f"{change:+.1%}", *parts]


@click.command()
@click.option("--split", type=click.Choice(["train", "test"]), default="test", show_default=True)
@click.option("--parts", default=24, show_default=True)
@click.option("--seeds", default=3, show_default=True)
@click.option("--one-side", is_flag=True)
@click.option("--tries", default=400, show_default=True, help="Candidates for expected-error; others have 100.")
@click.option("--policy", "policies", multiple=True, default=("uniform", "sparse", "expected-error"), show_default=True)
@click.option("--save", "saving", is_flag=True, help="Write the table to docs/numbers.")
def main(
    split: str, parts: int, seeds: int, one_side: bool, tries: int, policies: tuple[str, ...], saving: bool
) -> None:
    """Print the table."""
    registry, model = load_plugins(), pcsr.load("field")
    shapes = registry.get("shapes", "cad-parts")(held_out=24)
    data = Data(
        shapes=PartSpec(use="cad-parts"), touch=PartSpec(use="digit"), sampling="view" if one_side else "random"
    )
    found = {name: Measured() for name in policies}
    for part in shapes.names(split)[:parts]:
        item = shapes.item(part)
        for seed in range(seeds):
            trial = {name: Measured() for name in policies}
            try:
                for name, into in trial.items():
                    measure(item, name, data, tries if name == "expected-error" else 100, seed, model, into)
            except UserError as error:
                click.echo(f"left out: {error}", err=True)
                continue
            shares = ", ".join(f"{name} {into.after[0] / into.before[0] - 1:+.1%}" for name, into in trial.items())
            click.echo(f"{part}, seed {seed}: {shares}", err=True)
            for name, into in trial.items():  # a part that one policy cannot touch is left out of all
                for key in ("before", "after", "expected"):
                    getattr(found[name], key).extend(getattr(into, key))
    heads = [
        "policy",
        "cd ×10³ without touch",
        "with touches",
        "change",
        "expected / measured",
        "of shares",
        "within 1.5",
    ]
    seen = "one camera" if one_side else "512 random points"
    rows = [cells(name, one) for name, one in found.items()]
    show(heads, rows, f"{seen}, {TOUCHES} touches, {split} parts")
    if saving:
        words = f"--seeds {seeds}{' --one-side' if one_side else ''} --tries {tries}"
        save(f"gains{'-one-side' if one_side else ''}", f"python benchmarks/expected_gain.py {words}", heads, rows)


if __name__ == "__main__":
    main()
