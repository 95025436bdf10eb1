"""The fusion `attention` passes the conformance checks, and computes what its README says."""

import pytest
import torch
from pcsr_fusion_attention import Attention
from torch import nn

from pcsr import TouchBatch, Widths
from pcsr.testing import checks_for

MASK = torch.tensor([[True, True, False], [False, True, False]])


@pytest.mark.parametrize("check", checks_for(Attention), ids=str)
def test_part(check):
    check()


def fusion(**options):
    torch.manual_seed(0)
    part = Attention(Widths(visual=6, touch=5), heads=2, channels=4, hidden=8, **options).double()
    nn.init.normal_(part.out.weight)
    return part


def world(m=7):
    generator = torch.Generator().manual_seed(1)

    def draw(*shape):
        return torch.randn(*shape, generator=generator, dtype=torch.float64)

    return draw(2, 9, 3), draw(2, 9, 6), TouchBatch(draw(2, 3, m, 3), draw(2, 3, m, 5), MASK)


def plain(part, points, features, touches):
    """The README's two lines, one visual point and one head after another."""
    fused = features.clone()
    for b, row in enumerate(touches.mask):
        touched, of_touched = touches.points[b, row].flatten(0, 1), touches.features[b, row].flatten(0, 1)
        for i, point in enumerate(points[b]):
            near = (touched - point).norm(dim=1).argsort()[: part.neighbours]
            offset = touched[near] - point
            w, u = part.position(torch.cat([offset, offset.norm(dim=1, keepdim=True)], 1)).split([2, 8], dim=1)
            messages = []
            for head in range(2):
                part_of = slice(4 * head, 4 * head + 4)
                q = part.query(features[b, i])[part_of]
                k, v = part.key(of_touched[near])[:, part_of], part.value(of_touched[near])[:, part_of]
                messages.append(torch.softmax(k @ q / 2 + w[:, head], 0) @ (v + u[:, part_of]))
            fused[b, i] += part.out(torch.cat(messages))
    return fused


@torch.no_grad()
@pytest.mark.parametrize("neighbours", [1, 4, 7, 100])
def test_it_computes_what_the_readme_says(neighbours):
    part, (points, features, touches) = fusion(neighbours=neighbours), world()
    torch.testing.assert_close(part(points, features, touches), plain(part, points, features, touches))


@torch.no_grad()
def test_it_starts_as_the_visual_network():
    points, features, touches = world()
    untrained = Attention(Widths(visual=6, touch=5)).double()
    assert torch.equal(untrained(points, features, touches), features)


@torch.no_grad()
def test_it_knows_where_a_touch_is():
    part, (points, features, touches) = fusion(), world()
    moved = TouchBatch(touches.points + torch.tensor([0.3, 0.0, 0.0]).double(), touches.features, touches.mask)
    assert not torch.allclose(part(points, features, moved), part(points, features, touches))
    together = part(points + 1.0, features, TouchBatch(touches.points + 1.0, touches.features, touches.mask))
    torch.testing.assert_close(together, part(points, features, touches))  # where, from the point's own place


@torch.no_grad()
def test_a_point_hears_the_nearest_touched_points_alone():
    part, (points, features, touches) = fusion(neighbours=3), world()
    distance = torch.cdist(points, touches.flat_points)
    distance = distance.masked_fill(touches.flat_padding.unsqueeze(1), torch.inf)
    received = distance[0, 0].argsort()[:3]
    far = torch.ones(21, dtype=torch.bool)
    far[received] = False
    other = touches.flat.clone()
    other[0, far] += 1.0
    changed = TouchBatch(touches.points, other.view_as(touches.features), touches.mask)
    before, after = part(points, features, touches), part(points, features, changed)
    assert torch.equal(after[0, 0], before[0, 0])
    assert not torch.equal(after[0], before[0])


def test_touches_that_are_none_are_not_heard_whatever_they_are():
    part, (points, features, touches) = fusion(), world()
    nothing = ~touches.mask[:, :, None, None]
    other = TouchBatch(
        touches.points.masked_fill(nothing, 1e4), touches.features.masked_fill(nothing, 1e4), touches.mask
    )
    fused = part(points, features, other)
    torch.testing.assert_close(fused, part(points, features, touches))
    fused.square().sum().backward()
    assert all(torch.isfinite(weight.grad).all() for weight in part.parameters())
