"""`branches`: PU-Net's feature expansion, a branch a copy."""

import pytest
import torch
from torch.nn import functional as F

from pcsr import UserError, Widths
from pcsr_plugins.upsamplers.branches import Branches
from tests.plugins.compare import close


@torch.no_grad()
def test_branches_lie_end_to_end():
    branches = Branches(Widths(refined=9, rate=3), channels=(7, 5), hidden=6)
    points, features = torch.randn(2, 4, 3), torch.randn(2, 4, 9)
    dense = branches(points, features, 3)
    for i in range(4):
        for j in range(3):
            inner = F.relu(branches.first[j](features[:, i]))
            close(dense[:, 4 * j + i], branches.regressor(F.relu(branches.second[j](inner))), 1e-6)


def test_branches_refuse_another_rate():
    with pytest.raises(UserError, match="built for rate 3, not 4"):
        Branches(Widths(refined=9, rate=3))(torch.randn(1, 5, 3), torch.randn(1, 5, 9), 4)
