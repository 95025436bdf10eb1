"""`dis-pu`: the coarse cloud and its refiner, against slow and obvious forms of themselves."""

import math

import pytest
import torch
from torch.nn import functional as F

from pcsr import UserError, Widths
from pcsr_plugins.upsamplers.dis_pu import DisPU, Refiner
from tests.plugins.compare import same_gradients


def literal(refiner: Refiner, points: torch.Tensor, features: torch.Tensor) -> torch.Tensor:
    """One cloud (n 3), (n c), one point and one neighbour at a time."""
    near = [(points - point).norm(dim=-1).argsort().tolist()[: refiner.neighbours] for point in points]
    kernels = torch.stack(
        [torch.stack([refiner.kernel(points[j] - points[i]) for j in near[i]]) for i in range(len(points))]
    )
    mean, spread = kernels.mean((0, 1)), kernels.var((0, 1), unbiased=False)
    kernels = F.relu((kernels - mean) / (spread + 1e-5).sqrt() * refiner.norm.weight + refiner.norm.bias)
    rows = []
    for i, point in enumerate(points):
        edges = [torch.cat([points[j] - point, points[j], features[j]]) for j in near[i]]
        message = [F.relu(refiner.edge_again(F.relu(refiner.edge(edge)))) for edge in edges]
        summed = sum(torch.outer(h, kernel) for h, kernel in zip(message, kernels[i], strict=True))
        local = F.relu(refiner.local(summed.flatten()))
        skip = F.relu(refiner.skip(torch.stack(edges).amax(0)))
        query = refiner.query(features[i])
        logits = torch.stack([query @ refiner.key(other) for other in features]) / math.sqrt(len(query))
        messages = F.relu(refiner.back(logits.softmax(0) @ refiner.value(features)))
        rows.append(F.relu(refiner.merge(local + skip + messages)))
    return torch.stack(rows)


def test_the_refiner_is_its_three_units_forward_and_backward():
    refiner = Refiner(8, 5).double()
    with torch.no_grad():
        refiner.norm.weight.uniform_(0.5, 2)
        refiner.norm.bias.normal_()
    points = torch.randn(2, 13, 3, dtype=torch.float64, requires_grad=True)
    features = torch.randn(2, 13, 8, dtype=torch.float64, requires_grad=True)
    fast = refiner(points, features)
    assert fast.shape == (2, 13, refiner.channels) == (2, 13, 16)
    slow = torch.stack([literal(refiner, p, f) for p, f in zip(points, features, strict=True)])
    torch.testing.assert_close(fast, slow)
    same_gradients(fast, slow, (points, features, *refiner.parameters()))


def test_the_coarse_cloud_comes_of_tiled_features_and_the_grid():
    upsampler = DisPU(Widths(refined=10, rate=4), channels=8, neighbours=5).double()
    points, features = torch.randn(1, 6, 3).double(), torch.randn(1, 6, 10).double()
    coarse, fine = upsampler.stages(points, features, 4)
    assert coarse.shape == fine.shape == (1, 24, 3)
    for i in range(6):
        for r, place in enumerate(upsampler.grid):
            copy = torch.cat([features[0, i], place.double()])
            expected = upsampler.coarse(F.relu(upsampler.expand(F.relu(upsampler.copy(copy)))))
            torch.testing.assert_close(coarse[0, 4 * i + r], expected)
    assert torch.equal(upsampler(points, features, 4), fine)


def test_a_point_is_moved_by_half_at_most():
    upsampler = DisPU(Widths(refined=10, rate=4), channels=8, neighbours=5)
    with torch.no_grad():
        upsampler.way[-1].weight.mul_(1e4)
    coarse, fine = upsampler.stages(torch.randn(1, 6, 3), torch.randn(1, 6, 10), 4)
    assert 0.49 < (fine - coarse).abs().max() <= 0.5 + 1e-6
    with torch.no_grad():
        upsampler.way[-1].weight.zero_()
        upsampler.way[-1].bias.zero_()
    coarse, fine = upsampler.stages(torch.randn(1, 6, 3), torch.randn(1, 6, 10), 4)
    torch.testing.assert_close(fine, coarse)


def test_another_rate_is_refused():
    with pytest.raises(UserError, match="built for rate 3, not 4"):
        DisPU(Widths(refined=10, rate=3))(torch.randn(1, 7, 3), torch.randn(1, 7, 10), 4)
