"""Network parts that break what every one of them must keep, by the check that must fail."""

import numpy as np
import torch
from torch import nn

from pcsr import TouchBatch, Trait, UserError
from tests.testing.parts import Attend, Copy, Join, Lift, Refine


class OtherChannels(Lift):
    def __init__(self, widths) -> None:
        super().__init__(widths)
        self.channels = 5


class NoChannels(Refine):
    def __init__(self, widths) -> None:
        super().__init__(widths)
        del self.channels


class ChannelsFirst(Refine):
    def forward(self, points, features):
        return super().forward(points, features).transpose(1, 2)


class OtherWidth(Attend):
    def forward(self, points, features, touches):
        return super().forward(points, features, touches)[..., 1:]


class TooFewPoints(Copy):
    def forward(self, points, features, rate):
        return super().forward(points, features, rate)[:, 1:]


class NotFinite(Lift):
    def forward(self, points):
        return super().forward(points) / 0


class AlwaysDouble(Lift):
    def forward(self, points):
        return super().forward(points).double()


class InPlace(Refine):
    def forward(self, points, features):
        return super().forward(points, features.mul_(2))


class EvenNumbersOnly(Lift):
    def forward(self, points):
        halves = points.reshape(len(points), -1, 2, 3)
        return super().forward(halves.flatten(1, 2))


class GivesAList(Lift):
    def forward(self, points):
        return [super().forward(points)]


class RootOfZero(Lift):
    """Its distance to the nearest other point has no slope where the two coincide."""

    def forward(self, points):
        apart = (points.unsqueeze(1) - points.unsqueeze(2)).square().sum(-1)
        apart = apart.diagonal_scatter(torch.full_like(points[..., 0], torch.inf), dim1=1, dim2=2)
        return super().forward(points * apart.amin(2, keepdim=True).sqrt())


class DividesByZero(RootOfZero):
    def forward(self, points):
        return Lift.forward(self, points / (points - points[:, :1]).abs().sum(-1, keepdim=True).roll(-1, 1))


class CentresTheBatch(Lift):
    def forward(self, points):
        return super().forward(points - points.mean((0, 1)))


class Detached(Refine):
    def forward(self, points, features):
        return super().forward(points, features.detach())


class UnusedLayer(Lift):
    def __init__(self, widths) -> None:
        super().__init__(widths)
        self.forgotten = nn.Linear(3, 3)


class InfiniteSlope(Lift):
    def forward(self, points):
        x = self.layer(points)
        return (x - x).abs().sqrt() + x


class _Wrong(torch.autograd.Function):
    @staticmethod
    def forward(ctx, x):
        return 2 * x

    @staticmethod
    def backward(ctx, gradient):
        return 2.1 * gradient


class WrongBackward(Refine):
    def forward(self, points, features):
        return super().forward(points, _Wrong.apply(features))


class WrongBackwardOfAWeight(Lift):
    def forward(self, points):
        return torch.tanh(nn.functional.linear(points, self.layer.weight, _Wrong.apply(self.layer.bias)))


class DrawnByNumpy(Lift):
    def __init__(self, widths) -> None:
        super().__init__(widths)
        nn.init.constant_(self.layer.bias, np.random.default_rng().random())


class Noisy(Lift):
    def forward(self, points):
        return super().forward(points + torch.randn_like(points))


class Remembers(Lift):
    seen = 0

    def forward(self, points):
        self.seen += 1
        return super().forward(points) * self.seen


class TrainsByNumpy(Lift):
    def forward(self, points):
        return super().forward(points) * (np.random.default_rng().random() if self.training else 1)


class PlainTensor(Lift):
    def __init__(self, widths) -> None:
        super().__init__(widths)
        self.directions = torch.randn(3, dtype=torch.float64)

    def forward(self, points):
        return super().forward(points * self.directions.to(points.dtype))


class Tied(Lift):
    def __init__(self, widths) -> None:
        super().__init__(widths)
        self.again = self.layer

    def forward(self, points):
        return self.again(points)


class RandomWidth(Lift):
    def __init__(self, widths) -> None:
        super().__init__(widths, channels=int(torch.randint(3, 30, ())))


class ExportsOtherwise(Lift):
    def forward(self, points):
        return super().forward(2 * points if torch.compiler.is_exporting() else points)


class RowByRow(Lift):
    def forward(self, points):
        return torch.stack([super(RowByRow, self).forward(row[None])[0] for row in points])


class InFileOrder(Lift):
    def forward(self, points):
        return super().forward(points.cumsum(1))


class SetInFileOrder(Copy):
    def forward(self, points, features, rate):
        return super().forward(points, features.cumsum(1) / 10, rate)


# --- fusions


class JoinsWhatIsMissing(Join):
    def join(self, points, touches):
        return super().join(points, TouchBatch.of(touches.points))


class RemembersTouches(Join):
    last = None

    def join(self, points, touches):
        if touches.mask.any():
            self.last = touches
        return super().join(points, self.last or touches)


class SumsOfTouches(Attend):
    def forward(self, points, features, touches):
        messages = touches.features.sum((1, 2, 3)) / (1 / (touches.points.shape[2] - 1))
        return super().forward(points, features, touches) + messages[:, None, None]


class VarianceOfTouches(Attend):
    def forward(self, points, features, touches):
        apart = (touches.features - touches.features.mean(2, keepdim=True)).square().sum(2)
        apart = apart / (touches.mask.new_ones(()).double() * (touches.points.shape[2] - 1)).to(features)
        return super().forward(points, features, touches) + apart.mean((1, 2))[:, None, None]


class IgnoresTheMask(Attend):
    def forward(self, points, features, touches):
        return features + self.layer(touches.flat.mean(1)).unsqueeze(1)


class CountsByShape(Attend):
    def forward(self, points, features, touches):
        messages = self.layer(touches.features) * touches.mask[:, :, None, None]
        return features + messages.mean((1, 2)).unsqueeze(1)


class RefusesRagged(Join):
    def join(self, points, touches):
        counts = touches.mask.sum(1)
        if (counts != counts[0]).any():
            raise UserError("unequal")
        return super().join(points, touches)


class Deaf(Attend):
    def forward(self, points, features, touches):
        return features * self.layer.weight.sum()


class HearsNothing(Attend):
    uses_touch_features = False


class ForgetsTheCloud(Join):
    def join(self, points, touches):
        return points if not touches.mask.any() else super().join(points, touches)[:, points.shape[1] // 2 :]


class FirstTouchFirst(Attend):
    def forward(self, points, features, touches):
        return super().forward(points, features, touches) + self.layer(touches.features[:, 0]).mean(1, keepdim=True)


# --- upsamplers


class AnotherLastStage(Copy):
    def stages(self, points, features, rate):
        return [2 * self(points, features, rate)]


class ResultFirst(Copy):
    def stages(self, points, features, rate):
        dense = self(points, features, rate)
        return [torch.cat([dense, dense], 1), dense]


class NoList(Copy):
    def stages(self, points, features, rate):
        return self(points, features, rate)


class ChannelsFirstStage(Copy):
    def stages(self, points, features, rate):
        dense = self(points, features, rate)
        return [dense.transpose(1, 2), dense]


class ClaimsAnyRate(Copy):
    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.ANY_RATE})


class ClaimsLocal(Lift):
    traits = frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.LOCAL})


class AlwaysItsOwnRate(Copy):
    def forward(self, points, features, rate):
        return super().forward(points, features, self.rate)


class RefusesARateNamelessly(Copy):
    def forward(self, points, features, rate):
        if rate != self.rate:
            raise UserError("another rate")
        return super().forward(points, features, rate)


BROKEN = [
    ("shapes", OtherChannels, r"gives the shape \(2, 128, 6\); expected is \(2, 128, 5\)"),
    ("shapes", NoChannels, "its attribute `channels` is None"),
    ("shapes", ChannelsFirst, r"gives the shape \(2, 7, 128\)"),
    ("shapes", OtherWidth, r"gives the shape \(2, 128, 31\); expected is \(2, 128, 32\)"),
    ("shapes", TooFewPoints, r"gives the shape \(2, 511, 3\); expected is \(2, 512 or more, 3\)"),
    ("shapes", NotFinite, "result is not finite"),
    ("shapes", AlwaysDouble, "gives torch.float64 for torch.float32"),
    ("shapes", InPlace, "changes the features that it is given"),
    ("shapes", EvenNumbersOnly, "RuntimeError: shape '.*' is invalid.*that the check 'shapes' runs through"),
    ("shapes", GivesAList, "TypeError: it gives a list, not a tensor"),
    ("coinciding-points", RootOfZero, "the gradient of .* is not finite"),
    ("coinciding-points", DividesByZero, "coinciding points its result is not finite"),
    ("independent-rows", CentresTheBatch, "cloud 0 of a batch comes out .* different alone"),
    ("gradients", Detached, "no gradient reaches features;"),
    ("gradients", UnusedLayer, "no gradient reaches layer 'forgotten'"),
    ("gradients", InfiniteSlope, "the gradient of layer 'layer' is not finite"),
    ("gradcheck", WrongBackward, "derivative is wrong: .* by autograd, .* by differences by features"),
    ("gradcheck", WrongBackwardOfAWeight, "by differences by layer.bias"),
    ("deterministic", DrawnByNumpy, "two instances of one seed differ in 'layer.bias'"),
    ("deterministic", Noisy, "in eval mode the same input gives results"),
    ("deterministic", Remembers, "in eval mode the same input gives results"),
    ("deterministic", TrainsByNumpy, "in training one seed gives results"),
    ("weights", PlainTensor, "with its weights another instance gives a result that is .* off"),
    ("weights", Tied, "its weights cannot be written"),
    ("weights", RandomWidth, "an instance of another seed does not take its weights"),
    ("export", ExportsOtherwise, "for a batch of 1 its exported graph is .* off"),
    ("export", RowByRow, "takes batches of one size alone"),
    (
        "trait-permutation-equivariant",
        InFileOrder,
        "claims 'permutation-equivariant', but with its points in another order",
    ),
    (
        "trait-permutation-equivariant",
        SetInFileOrder,
        "claims 'permutation-equivariant', but with its points in another order",
    ),
    ("zero-touches", JoinsWhatIsMissing, "with 2 missing touches its `join`"),
    ("zero-touches", RemembersTouches, "with no touch its `join` changes a cloud of 128 points into one of 176"),
    ("zero-touches", SumsOfTouches, "ZeroDivisionError"),
    ("zero-touches", VarianceOfTouches, "with 1 touches of 1 points it gives .*not finite"),
    ("missing-touches", IgnoresTheMask, "the contents of a missing touch change the result"),
    ("missing-touches", CountsByShape, "a cloud with 1 touch comes out"),
    ("ragged-join", RefusesRagged, "refuses with 'unequal'"),
    ("uses-touches", Deaf, "other touches change nothing"),
    ("uses-touches", HearsNothing, "uses no touch features, joins no points and keeps none"),
    ("uses-touches", ForgetsTheCloud, "points of the cloud are not in it"),
    (
        "trait-touch-permutation-invariant",
        FirstTouchFirst,
        "claims 'touch-permutation-invariant', but with its touches in another order",
    ),
    ("stages", AnotherLastStage, "last stage is .* off the result of `forward`"),
    ("stages", ResultFirst, r"stages have \[1024, 512\] points"),
    ("stages", NoList, "its `stages` gives Tensor"),
    ("stages", ChannelsFirstStage, r"its stages have the shapes \[\(3, 3, 512\)"),
    ("trait-local", ClaimsLocal, "claims 'local', but at half of the size and beside a cloud far away the result is"),
    ("trait-any-rate", ClaimsAnyRate, "claims 'any-rate', but refuses rate 2"),
    ("trait-any-rate", AlwaysItsOwnRate, "at rate 5 it makes 512 points of 128"),
    ("trait-any-rate", RefusesARateNamelessly, "refuses with 'another rate'"),
]
