"""`iterative` is Algorithm 1 of TAPSR, touch by touch."""

import pytest
import torch
from torch import nn
from torch.nn import functional as F

from pcsr import TouchBatch
from pcsr.geometry.ordering import hilbert_order
from pcsr_plugins.fusions.iterative import Iterative
from pcsr_plugins.layers.hilbert_pairing import pair
from tests.plugins.compare import check_single_precision, close, like
from tests.plugins.small_touches import WIDTHS, touched


def algorithm_1(fusion: Iterative, points: torch.Tensor, fp: torch.Tensor, touches: list[torch.Tensor]) -> torch.Tensor:
    """Algorithm 1 of one object, word by word: f1 = fp; for each touch Fm = MLP[ft, f], f = Deconv[Fm, fp].

    `touches` holds the feature that each visual point meets, (n c) for each touch.
    """
    order = hilbert_order(points)
    n, linear, weight = len(points), fusion.mlp[0], fusion.deconv.weight  # weight: (in out 3)
    f = fp
    for ft in touches:
        fm = torch.stack([F.relu(linear.weight @ torch.cat([ft[i], f[i]]) + linear.bias) for i in range(n)])
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


@pytest.mark.parametrize("pool", ["none", "global"])
@torch.no_grad()
def test_iterative_is_algorithm_1_and_a_row_skips_the_touches_it_lacks(pool):
    fusion, points, features = Iterative(WIDTHS, pool=pool), torch.randn(4, 11, 3), torch.randn(4, 11, WIDTHS.visual)
    touches = touched([[True, True, True], [True, False, True], [False, True, False], [True, False, False]])
    fused, met = fusion(points, features, touches), pair(points, touches)
    for b in range(4):
        messages = [met[b, a] for a in range(3) if touches.mask[b, a]]
        close(fused[b], algorithm_1(fusion, points[b], features[b], messages))


def test_iterative_has_one_block_for_every_touch():
    fusion, points, features = Iterative(WIDTHS), torch.randn(1, 8, 3), torch.randn(1, 8, WIDTHS.visual)
    for count in (1, 6):
        assert fusion(points, features, touched([[True] * count])).shape == features.shape


def test_it_follows_a_permutation():
    part, points, features = Iterative(WIDTHS), torch.randn(2, 11, 3), torch.randn(2, 11, WIDTHS.visual)
    touches, shuffled = touched([[True, True], [True, False]]), torch.randperm(11)
    close(part(points[:, shuffled], features[:, shuffled], touches), part(points, features, touches)[:, shuffled])


def test_the_fusion_has_its_gradients_in_single_precision():
    fusion, points = Iterative(WIDTHS), torch.randn(2, 200, 3)
    features, touches = torch.randn(2, 200, WIDTHS.visual), touched([[True, True, False], [True, True, True]], 200)

    def call(part: nn.Module) -> torch.Tensor:
        given = TouchBatch(like(part, touches.points), like(part, touches.features), touches.mask)
        return part(like(part, points), like(part, features), given)

    check_single_precision(fusion, call, torch.randn(2, 200, WIDTHS.visual))
