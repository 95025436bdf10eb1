"""`none`: touched points join the cloud, features stay (TAPSR, Table 4, first row)."""

import pytest
import torch

from pcsr import UserError
from pcsr_plugins.fusions.none import NoFusion
from tests.plugins.small_touches import WIDTHS, touched


def test_none_joins_the_raw_points_and_leaves_features_alone():
    fusion, points, features = NoFusion(WIDTHS), torch.randn(2, 7, 3), torch.randn(2, 7, WIDTHS.visual)
    touches = touched([[True, False, True], [False, True, True]])
    joined = fusion.join(points, touches)
    assert torch.equal(joined[0], torch.cat([points[0], touches.points[0, 0], touches.points[0, 2]]))
    assert torch.equal(joined[1], torch.cat([points[1], touches.points[1, 1], touches.points[1, 2]]))
    assert torch.equal(fusion(points, features, touches), features)
    assert not fusion.uses_touch_features


def test_none_refuses_rows_of_unequal_counts():
    touches = touched([[True, True], [True, False]])
    with pytest.raises(UserError, match=r"same number of touches in each row, got \[2, 1\]"):
        NoFusion(WIDTHS).join(torch.randn(2, 7, 3), touches)
