"""`iterative` is Algorithm 1 of TAPSR, touch by touch."""

import pytest
import torch
from torch import nn

from pcsr import TouchBatch
from pcsr.geometry.ordering import hilbert_order
from pcsr.testing import checks_for
from pcsr_plugins.fusions.iterative import Iterative
from pcsr_plugins.layers.pairing import pair
from tests.plugins.compare import check_single_precision, close, like
from tests.plugins.small_touches import WIDTHS, touched


def algorithm_1(fusion: Iterative, points: torch.Tensor, fp: torch.Tensor, touches: list[torch.Tensor]) -> torch.Tensor:
    """Algorithm 1 of one object, word by word: f1 = fp; for each touch Fm = MLP[ft, f], f = Deconv[Fm, fp].

    `touches` holds what each visual point is paired with, (n c) for each touch.
    """
    order = hilbert_order(points)
    n, linear, weight = len(points), fusion.mlp[0], fusion.deconv.weight  # weight: (in out 3)
    f = fp
    for ft in touches:
        fm = torch.stack([fusion.mlp[1](linear.weight @ torch.cat([ft[i], f[i]]) + linear.bias) for i in range(n)])
        if fusion.pool == "global":
            fm = torch.stack([fm.max(0).values] * n)
        x = torch.cat([fm, fp], dim=1)
        after = torch.zeros_like(fp)
        for step in range(n):
            after[order[step]] = fusion.deconv.bias
            for tap in range(3):  # a deconvolution sends step s to s - 1, s and s + 1
                sender = step + 1 - tap
                if 0 <= sender < n:
                    after[order[step]] += x[order[sender]] @ weight[:, :, tap]
        f = after
    return f


def paired(fusion: Iterative, points: torch.Tensor, touches: TouchBatch, b: int, a: int) -> torch.Tensor:
    """What the points of one cloud (n 3) are concatenated with of one touch, point after point: (n c)."""
    touched, features = touches.points[b, a], touches.features[b, a]
    n, m = len(points), len(touched)
    rows = torch.zeros(n, features.shape[1] + 3 * fusion.offsets)
    walk = hilbert_order(touched)
    for step, i in enumerate(hilbert_order(points).tolist()):
        j = walk[step * m // n] if fusion.pairing == "hilbert" else (touched - points[i]).norm(dim=1).argmin()
        rows[i] = torch.cat([features[j], touched[j] - points[i]]) if fusion.offsets else features[j]
    return rows


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"pool": "global"},
        {"pairing": "nearest"},
        {"negative_slope": 0.2},
        {"offsets": True},
        {"pairing": "nearest", "offsets": True, "pool": "global"},
    ],
    ids=str,
)
@torch.no_grad()
def test_iterative_is_algorithm_1_and_a_row_skips_the_touches_it_lacks(options):
    fusion, points, features = Iterative(WIDTHS, **options), torch.randn(4, 11, 3), torch.randn(4, 11, WIDTHS.visual)
    touches = touched([[True, True, True], [True, False, True], [False, True, False], [True, False, False]])
    fused = fusion(points, features, touches)
    for b in range(4):
        messages = [paired(fusion, points[b], touches, b, a) for a in range(3) if touches.mask[b, a]]
        close(fused[b], algorithm_1(fusion, points[b], features[b], messages))


@torch.no_grad()
def test_by_default_the_pairing_is_that_of_concat():
    """So the weights of earlier versions mean what they meant."""
    points, touches = torch.randn(2, 11, 3), touched([[True, True]] * 2)
    fusion = Iterative(WIDTHS)
    for b, a in ((0, 0), (0, 1), (1, 1)):
        assert torch.equal(paired(fusion, points[b], touches, b, a), pair(points, touches)[b, a])
    assert fusion.mlp[0].in_features == WIDTHS.touch + WIDTHS.visual


@pytest.mark.parametrize("check", checks_for(Iterative, pairing="nearest", offsets=True), ids=str)
def test_it_is_a_good_part_with_the_nearest_points_and_their_offsets(check):
    check()


def test_a_missing_touch_far_off_gives_no_gradient():
    fusion, points, features = (
        Iterative(WIDTHS, pairing="nearest", offsets=True),
        torch.randn(1, 9, 3),
        torch.randn(1, 9, 8),
    )
    touches = touched([[True, False]])
    far = torch.where(touches.mask[:, :, None, None], touches.points, torch.inf)
    fusion(points, features, TouchBatch(far, touches.features, touches.mask)).square().sum().backward()
    gradients = [weight.grad for weight in fusion.parameters()]
    fusion.zero_grad()
    fusion(points, features, touches).square().sum().backward()
    for gradient, weight in zip(gradients, fusion.parameters(), strict=True):
        close(gradient, weight.grad)


def test_iterative_has_one_block_for_every_touch():
    fusion, points, features = Iterative(WIDTHS), torch.randn(1, 8, 3), torch.randn(1, 8, WIDTHS.visual)
    for count in (1, 6):
        assert fusion(points, features, touched([[True] * count])).shape == features.shape


@pytest.mark.parametrize("pairing", ["hilbert", "nearest"])
def test_it_follows_a_permutation(pairing):
    part = Iterative(WIDTHS, pairing=pairing, offsets=True)
    points, features = torch.randn(2, 11, 3), torch.randn(2, 11, WIDTHS.visual)
    touches, shuffled = touched([[True, True], [True, False]]), torch.randperm(11)
    close(part(points[:, shuffled], features[:, shuffled], touches), part(points, features, touches)[:, shuffled])


def test_the_fusion_has_its_gradients_in_single_precision():
    fusion, points = Iterative(WIDTHS), torch.randn(2, 200, 3)
    features, touches = torch.randn(2, 200, WIDTHS.visual), touched([[True, True, False], [True, True, True]], 200)

    def call(part: nn.Module) -> torch.Tensor:
        given = TouchBatch(like(part, touches.points), like(part, touches.features), touches.mask)
        return part(like(part, points), like(part, features), given)

    check_single_precision(fusion, call, torch.randn(2, 200, WIDTHS.visual))
