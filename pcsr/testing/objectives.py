"""Checks of objectives, on a small network of the suite."""

from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcsr.contracts import Backbone, Encoder, Fusion, TouchBatch, Upsampler, Widths
from pcsr.errors import UserError
from pcsr.network.network import Network
from pcsr.tensors import Dense, Features, Points
from pcsr.testing.inputs import cloud
from pcsr.testing.learning import DRAWS, arrived, compare, demand, layers, trained
from pcsr.testing.subject import Subject, seeded

CLOUDS, COUNT, RATE = 2, 64, 4
WIDTHS = Widths(visual=8, touch=3, refined=12, rate=RATE)


class _Lift(Encoder):
    channels = WIDTHS.visual

    def __init__(self) -> None:
        super().__init__()
        self.layer = nn.Linear(3, self.channels)

    def forward(self, points: Points) -> Features:
        return torch.tanh(self.layer(points))


class _Mean(Fusion):
    def __init__(self) -> None:
        super().__init__()
        self.layer = nn.Linear(WIDTHS.touch, WIDTHS.visual)

    def forward(self, points: Points, features: Features, touches: TouchBatch) -> Features:
        fused: Features = features + self.layer(touches.flat.mean(1, keepdim=True))
        return fused


class _Refine(Backbone):
    channels = WIDTHS.refined

    def __init__(self) -> None:
        super().__init__()
        self.layer = nn.Linear(WIDTHS.visual, self.channels)

    def forward(self, points: Points, features: Features) -> Float[Tensor, "b n refined"]:
        return torch.tanh(self.layer(features))


class _Copies(Upsampler):
    """Moves copies of each point. Half of them are the first stage."""

    def __init__(self, rate: int = RATE) -> None:
        super().__init__()
        self.layer = nn.Linear(WIDTHS.refined, 3 * rate)

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        offsets: Tensor = self.layer(features)
        return points.repeat_interleave(rate, dim=1) + offsets.view(len(points), -1, 3)

    def stages(self, points: Points, features: Features, rate: int) -> list[Dense]:
        dense = self(points, features, rate)
        return [dense[:, ::2], dense]


def network(subject: Subject, seed: int = 0) -> Network:
    """Build a small, smooth network in double precision, with the subject's upsampler if it has one."""
    with seeded(seed):
        upsampler = _Copies() if subject.upsampler is None else subject.upsampler(WIDTHS)
        built = Network(_Lift(), None, _Mean(), _Refine(), upsampler).double()
        with torch.no_grad():
            for weight in built.parameters():
                weight.add_(0.05 * torch.randn_like(weight))
    return built


def judge(subject: Subject, module: Any, judged: Network, *, touched: bool = False) -> Any:
    """Compute the losses of a network on the suite's clouds, in the network's precision."""
    like = next(judged.parameters())
    points, truth = cloud(CLOUDS, COUNT, seed=3).to(like), cloud(CLOUDS, COUNT * RATE, seed=4).to(like)
    touches = TouchBatch.of(points[:, None, :8] * 0.9) if touched else None
    try:
        return module.losses(judged, points, truth, RATE, touches)
    except UserError as error:
        subject.must_name_itself(error)
        raise subject.failure(
            f"it refuses the suite's network: {error}",
            "losses of some network",
            "give the suite the upsampler that it needs: checks_for(Part, upsampler=…), or --upsampler NAME",
        ) from error


def judged(subject: Subject, module: nn.Module) -> Tensor:
    """Compute the losses of the suite's network, stacked in one tensor."""
    found = judge(subject, module, network(subject).eval())
    return torch.stack([found[name] for name in sorted(found)])


def losses(subject: Subject) -> None:
    """Losses are named, finite scalars whose sum has a gradient, with and without touches."""
    for touched in (False, True):
        for training in (True, False):
            module = subject.built().train(training)
            found = judge(subject, module, network(subject).float().train(training), touched=touched)
            right = isinstance(found, dict) and bool(found)
            if not right or not all(isinstance(name, str) and _number(loss) for name, loss in found.items()):
                raise subject.failure(
                    f"its losses are {found!r}",
                    "a dict of names and finite numbers, each a tensor without axes",
                    "take the mean over the batch",
                )
            if not sum(found.values(), torch.zeros(())).requires_grad:
                raise subject.failure("its losses have no gradient", "what training can minimise", "detach nothing")


def _number(loss: Any) -> bool:
    return isinstance(loss, Tensor) and loss.dim() == 0 and loss.is_floating_point() and bool(loss.isfinite())


def gradients(subject: Subject) -> None:
    """Gradients reach each layer of the network and of the objective, and are finite."""
    must: set[str] = set()
    reached: set[str] = set()
    for draw in range(DRAWS):
        module, judged = subject.perturbed(draw).train(), network(subject, draw).train()
        groups = {**layers(judged, "network."), **layers(module)}
        must |= groups.keys()
        torch.autograd.backward(list(judge(subject, module, judged, touched=True).values()))
        reached |= arrived(subject, groups)
        if not must - reached:
            break
    demand(subject, must, reached)


def coinciding_points(subject: Subject) -> None:
    """Losses and gradients are finite for coinciding points, which an untrained network may generate."""
    module, judged = subject.perturbed().train(), network(subject).train()
    with torch.no_grad():
        for weight in judged.upsampler.parameters():
            weight.zero_()
    found = judge(subject, module, judged)
    bad = [name for name, loss in found.items() if not loss.isfinite()]
    if not bad:
        torch.autograd.backward(list(found.values()))
        leaves = [*judged.parameters(), *module.parameters()]
        bad = ["the gradient"] * any(leaf.grad is not None and not leaf.grad.isfinite().all() for leaf in leaves)
    if bad:
        raise subject.failure(
            f"for points that coincide {bad[0]} is not finite",
            "finite losses and gradients",
            "keep roots and norms away from zero: they have no slope there",
        )


def gradcheck(subject: Subject) -> None:
    """Derivatives by autograd agree with finite differences, by the weights of the network and of the objective."""
    module, judged = subject.perturbed(), network(subject).eval()

    def value() -> Tensor:
        return torch.stack(list(judge(subject, module, judged).values())).sum()

    of_network = {f"network.{name}": weight for name, weight in trained(judged).items()}
    compare(subject, value, of_network, trained(module))
