"""`concat`: touch features beside the visual ones (TAPSR, Table 4, second row)."""

import pytest
import torch

from pcsr import UserError
from pcsr_plugins.fusions.concat import Concat
from pcsr_plugins.layers.pairing import pair
from tests.plugins.compare import close
from tests.plugins.small_touches import WIDTHS, touched


def test_it_follows_a_permutation():
    part, points, features = Concat(WIDTHS), torch.randn(2, 11, 3), torch.randn(2, 11, WIDTHS.visual)
    touches, shuffled = touched([[True, True], [True, False]]), torch.randperm(11)
    close(part(points[:, shuffled], features[:, shuffled], touches), part(points, features, touches)[:, shuffled])


@torch.no_grad()
def test_concat_counts_missing_touches_as_zeros():
    fusion, points, features = Concat(WIDTHS, touches=4), torch.randn(2, 7, 3), torch.randn(2, 7, WIDTHS.visual)
    touches = touched([[True, True, True], [True, False, True]])
    fused, met, nothing = fusion(points, features, touches), pair(points, touches), torch.zeros(7, WIDTHS.touch)
    close(fused[0], fusion.layer(torch.cat([features[0], met[0, 0], met[0, 1], met[0, 2], nothing], 1)))
    close(fused[1], fusion.layer(torch.cat([features[1], met[1, 0], nothing, met[1, 2], nothing], 1)))


def test_concat_refuses_more_touches_than_slots():
    fusion, points, features = Concat(WIDTHS, touches=2), torch.randn(1, 7, 3), torch.randn(1, 7, WIDTHS.visual)
    fusion(points, features, touched([[True, True]]))
    with pytest.raises(UserError, match=r"slots for 2 touches, got 3: set model\.fusion\.touches to 3"):
        fusion(points, features, touched([[True, True, True]]))
