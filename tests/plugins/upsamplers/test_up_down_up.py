"""`up-down-up`: PU-GAN's expansion against the original's layout."""

import pytest
import torch
from torch.nn import functional as F

from pcsr import UserError, Widths
from pcsr_plugins.upsamplers.up_down_up import UpDownUp
from tests.plugins.published import awake


def literal(upsampler: UpDownUp, features: torch.Tensor) -> torch.Tensor:
    """One cloud (n c); all first copies, then all second ones, as the original has them in memory."""
    n, copies = len(features), len(upsampler.up.grid)

    def up(part, low):
        high = torch.cat([torch.cat([low, place.expand(n, 2)], dim=1) for place in part.grid])
        q, k, v = (F.relu(layer(high)) for layer in (part.attention.query, part.attention.key, part.attention.value))
        return part.mlp(high + part.attention.gamma * torch.softmax(q @ k.T, dim=-1) @ v)

    low = F.relu(upsampler.narrow(features))
    first = up(upsampler.up, low)
    back = upsampler.down.mlp(torch.stack([first[i::n].flatten() for i in range(n)]))
    second = first + up(upsampler.again, back - low)
    return upsampler.regressor(second).view(copies, n, 3).transpose(0, 1).flatten(0, 1)


@pytest.mark.parametrize("surplus", [0, 2])
def test_up_down_up_is_the_original_in_another_order(surplus):
    upsampler = awake(UpDownUp(Widths(refined=10, rate=3), channels=8, surplus=surplus)).double()
    points, features = torch.randn(2, 7, 3).double(), torch.randn(2, 7, 10).double()
    dense = upsampler(points, features, 3)
    assert dense.shape == (2, 7 * (3 + surplus), 3)
    torch.testing.assert_close(dense, torch.stack([literal(upsampler, cloud) for cloud in features]))


def test_another_rate_is_refused():
    with pytest.raises(UserError, match="built for rate 3, not 4"):
        UpDownUp(Widths(refined=10, rate=3))(torch.randn(1, 7, 3), torch.randn(1, 7, 10), 4)
