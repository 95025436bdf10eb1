"""Objectives, touch sources and shapes that break their contract, by the check that must fail."""

import dataclasses
import itertools

import numpy as np
import torch
import trimesh

from pcsr import ShapeItem, UserError
from tests.testing.broken_network import _Wrong
from tests.testing.parts import Boxes, Pats, Squares

COUNTER = itertools.count()
"""What a part may look at that no seed decides."""

# --- objectives


class AList(Squares):
    def losses(self, network, points, truth, rate, touches=None):
        return list(self(network(points, rate, touches), truth).values())


class OneForEachCloud(Squares):
    def losses(self, network, points, truth, rate, touches=None):
        return {"squares": network(points, rate, touches).square().mean((1, 2))}


class DetachedLoss(Squares):
    def forward(self, prediction, target):
        return {name: loss.detach() for name, loss in super().forward(prediction, target).items()}


class RefusesNamelessly(Squares):
    def losses(self, network, points, truth, rate, touches=None):
        raise UserError("not this network")


class RefusesTheNetwork(Squares):
    def losses(self, network, points, truth, rate, touches=None):
        raise UserError("objective 'refuses' wants an upsampler with a distance")


class ForgetsTouches(Squares):
    def losses(self, network, points, truth, rate, touches=None):
        return self(network(points, rate), truth)


class UnusedWeight(Squares):
    def forward(self, prediction, target):
        return {"size": prediction.square().mean()}


class RootOfZero(Squares):
    def forward(self, prediction, target):
        apart = (prediction[:, 1::4] - prediction[:, ::4]).square().sum(-1).sqrt()
        return {**super().forward(prediction, target), "apart": apart.mean()}


class DividesByZero(Squares):
    def forward(self, prediction, target):
        apart = (prediction[:, 1::4] - prediction[:, ::4]).square().sum(-1)
        return {**super().forward(prediction, target), "apart": (1 / apart).mean()}


class WrongBackward(Squares):
    def forward(self, prediction, target):
        return super().forward(_Wrong.apply(prediction), target)


class Unseeded(Squares):
    def forward(self, prediction, target):
        return {name: loss * (1 + next(COUNTER)) for name, loss in super().forward(prediction, target).items()}


class PlainTensor(Squares):
    def __init__(self) -> None:
        super().__init__()
        self.scale = torch.rand(())

    def forward(self, prediction, target):
        return {name: loss * self.scale for name, loss in super().forward(prediction, target).items()}


# --- touch sources


class OneTooFew(Pats):
    def touches(self, item, cloud, count, seed):
        return super().touches(item, cloud, count, seed)[: max(1, count - 1)]


class Changed(Pats):
    """One field of each touch is another."""

    change = staticmethod(lambda touch: {})

    def touch(self, item, rng):
        touch = super().touch(item, rng)
        return dataclasses.replace(touch, **self.change(touch))


class AtTheOrigin(Changed):
    change = staticmethod(lambda touch: {"points": touch.points - touch.points.mean(0)})


class InMetres(Changed):
    change = staticmethod(lambda touch: {"points": touch.points / 1000})


class Nothing(Changed):
    change = staticmethod(lambda touch: {"points": touch.points[:0], "finger": touch.finger[:0]})


class NotFinite(Changed):
    change = staticmethod(lambda touch: {"points": touch.points * np.nan})


class SixthFinger(Changed):
    change = staticmethod(lambda touch: {"finger": touch.finger + 5})


class NoUnit(Changed):
    change = staticmethod(lambda touch: {"unit": 0.0})


class Uneven(Pats):
    def touch(self, item, rng):
        return super().touch(item, rng).resampled(int(rng.integers(1, 1000)), rng)


class RefusesAll(Pats):
    def touches(self, item, cloud, count, seed):
        raise UserError(f"{item.name}: nothing to touch")


class OtherEachTime(Pats):
    def touches(self, item, cloud, count, seed):
        return super().touches(item, cloud, count, next(COUNTER))


class OtherEachInstance(Pats):
    def __init__(self) -> None:
        super().__init__()
        self.number = next(COUNTER)

    def touches(self, item, cloud, count, seed):
        return super().touches(item, cloud, count, self.number)


class DigestOfTheMoment(Pats):
    def digest(self, name):
        return str(next(COUNTER))


class KeepsAFunction(Pats):
    def __init__(self) -> None:
        super().__init__()
        self.function = lambda: None


class OneStream(Pats):
    def touches(self, item, cloud, count, seed):
        rng = np.random.default_rng((seed, count))
        return [self.touch(item, rng) for _ in range(count)]


class MovesTheCloud(Pats):
    def touches(self, item, cloud, count, seed):
        cloud -= cloud.mean(0)
        return super().touches(item, cloud, count, seed)


class MovesTheMesh(Pats):
    def touches(self, item, cloud, count, seed):
        touched = super().touches(item, cloud, count, seed)
        item.mesh.apply_translation([1, 0, 0])
        return touched


# --- shapes


class OtherOrder(Boxes):
    def names(self, split):
        names = super().names(split)
        return names[::-1] if next(COUNTER) % 3 else names


class NoSplit(Boxes):
    def names(self, split):
        raise UserError("shapes 'no-split' have none")


class NumbersForNames(Boxes):
    def names(self, split):
        return list(range(len(super().names(split))))


class OneNameForAll(Boxes):
    def names(self, split):
        return ["train/0" for _ in super().names(split)]


class OneText(Boxes):
    def names(self, split):
        return ",".join(super().names(split))


class Renamed(Boxes):
    def item(self, name):
        return dataclasses.replace(super().item(name), name="box")


class Groupless(Boxes):
    def item(self, name):
        return dataclasses.replace(super().item(name), group="")


class JustTheMesh(Boxes):
    def item(self, name):
        return super().item(name).mesh


class Empty(Boxes):
    def item(self, name):
        return ShapeItem(name, "box", trimesh.Trimesh(np.zeros((3, 3)), np.zeros((0, 3), int), process=False))


class AnotherEachTime(Boxes):
    def item(self, name):
        return ShapeItem(name, "box", trimesh.creation.box([1.0, 2.0, 3.0 + next(COUNTER)]))


class RefusesOneNamelessly(Boxes):
    def item(self, name):
        if name == "train/1":
            raise UserError("a bad box")
        return super().item(name)


class RefusesEach(Boxes):
    def item(self, name):
        raise UserError(f"{name}: a bad box")


class LosesCounts(Boxes):
    def __getstate__(self):
        return {"counts": {"train": 1}}


class BoxesWithAFunction(Boxes):
    def __init__(self) -> None:
        super().__init__()
        self.function = lambda: None


class BoxesOfTheMoment(Boxes):
    def digest(self, name):
        return str(next(COUNTER))


class NumberForADigest(Boxes):
    def digest(self, name):
        return 7


BROKEN = [
    ("losses", AList, r"its losses are \["),
    ("losses", OneForEachCloud, "its losses are {'squares': tensor"),
    ("losses", DetachedLoss, "its losses have no gradient"),
    ("losses", RefusesNamelessly, r"refuses with 'not this network'.*\"objective 'NAME'"),
    ("losses", RefusesTheNetwork, r"refuses the suite's network: objective 'refuses'.*checks_for\(Part, upsampler="),
    ("gradients", ForgetsTouches, "no gradient reaches layer 'network.fusion.layer'"),
    ("gradients", UnusedWeight, "no gradient reaches layer 'UnusedWeight'"),
    ("coinciding-points", RootOfZero, "the gradient is not finite"),
    ("coinciding-points", DividesByZero, "apart is not finite"),
    ("gradcheck", WrongBackward, r"by differences by network\."),
    ("deterministic", Unseeded, "in eval mode the same input gives results"),
    ("weights", PlainTensor, "with its weights another instance gives"),
    ("touches", OneTooFew, "3 touches were requested"),
    ("touches", AtTheOrigin, "touch 0 lies .* radii off the surface of 'egg'"),
    ("touches", InMetres, "touch 0 lies .* radii off the surface of 'egg'"),
    ("touches", Nothing, r"have the shape \(0, 3\)"),
    ("touches", NotFinite, "or are not finite"),
    ("touches", SixthFinger, r"touch 0 has 12 points.*expected is for each point an index below 1"),
    ("touches", NoUnit, "has the unit 0.0 and the sensor 'pat'"),
    ("touches", Uneven, "its touches have .* points"),
    ("touches", RefusesAll, r"refuses 0 touches of 'egg': egg: nothing to touch.*checks_for\(Part, item="),
    ("repeatable", OtherEachTime, "itself gives other touches"),
    ("repeatable", OtherEachInstance, "another instance gives other touches"),
    ("repeatable", DigestOfTheMoment, "its digest of 'egg' is"),
    ("repeatable", KeepsAFunction, "lambda"),
    ("prefix", OneStream, "1 touches are not the first 1 of 3"),
    ("leaves-inputs", MovesTheCloud, "changes the object or its cloud"),
    ("leaves-inputs", MovesTheMesh, "changes the object or its cloud"),
    ("names", OtherOrder, "when asked again"),
    ("names", NoSplit, "none of its splits has an object"),
    ("names", NumbersForNames, "no text"),
    ("names", OneNameForAll, "names come twice, such as 'train/0'"),
    ("names", OneText, "its names of 'train' are a str"),
    ("items", Renamed, "for 'train/0' it gives ShapeItem"),
    ("items", Groupless, "for 'train/0' it gives ShapeItem"),
    ("items", JustTheMesh, "for 'train/0' it gives <trimesh"),
    ("items", Empty, "has 0 faces"),
    ("items", AnotherEachTime, "'train/0' is another object when asked again"),
    ("items", RefusesOneNamelessly, "refuses an object with 'a bad box'"),
    ("items", RefusesEach, "refuses all objects that were tried"),
    ("picklable", LosesCounts, "a pickled copy has other names"),
    ("picklable", BoxesWithAFunction, "lambda"),
    ("digests", BoxesOfTheMoment, "its digest of 'train/0' is"),
    ("digests", NumberForADigest, "its digest of 'train/0' is 7"),
]
