"""`cross-attention`: the two lines of its docstring, one visual point and one head after the other."""

import math

import pytest
import torch
from torch import nn

from pcsr import TouchBatch
from pcsr_plugins.fusions.cross_attention import DECAYS, CrossAttention
from tests.plugins.compare import close, same_gradients
from tests.plugins.small_touches import WIDTHS, touched

MASK = [[True, True, False], [False, True, False]]


def made(**options) -> CrossAttention:
    """One that has learned something: as it is built, nothing is added."""
    part = CrossAttention(WIDTHS, hidden=10, **options).double()
    nn.init.normal_(part.out[-1].weight)
    return part


def given(m: int = 7) -> tuple[torch.Tensor, torch.Tensor, TouchBatch]:
    touches = touched(MASK, m)
    return (
        torch.randn(2, 9, 3).double(),
        torch.randn(2, 9, WIDTHS.visual).double(),
        TouchBatch(touches.points.double(), touches.features.double(), touches.mask),
    )


def slowly(part: CrossAttention, points: torch.Tensor, features: torch.Tensor, touches: TouchBatch) -> torch.Tensor:
    rows = []
    for b, present in enumerate(touches.mask):
        touched, message = touches.points[b, present].flatten(0, 1), touches.features[b, present].flatten(0, 1)
        for p, f in zip(points[b], features[b], strict=True):
            found = [f]
            for head in range(part.heads):
                some = slice(head * part.channels, (head + 1) * part.channels)
                q, k, v = part.query(f)[some], part.key(message)[:, some], part.value(message)[:, some]
                squared = (touched - p).square().sum(1)
                a = torch.softmax(k @ q / math.sqrt(part.channels) - part.log_decay[head].exp() * squared, 0)
                found += [a @ v, a @ (touched - p), (a @ squared)[None]]
            rows.append(f + part.out(torch.cat(found)))
    return torch.stack(rows).view_as(features)


@pytest.mark.parametrize(("heads", "channels", "m"), [(1, 3, 7), (3, 4, 1), (4, 12, 20)])
def test_it_is_the_lines_of_its_docstring_forward_and_backward(heads, channels, m):
    part, (points, features, touches) = made(heads=heads, channels=channels), given(m)
    points.requires_grad_()
    fast, slow = part(points, features, touches), slowly(part, points, features, touches)
    close(fast, slow, atol=1e-9)
    weights = [weight for name, weight in part.named_parameters() if name != "key.bias"]  # which softmax cancels
    same_gradients(fast, slow, (points, *weights), atol=1e-9, rtol=1e-6)


def test_heads_start_with_decays_from_the_greatest_to_the_least():
    close(CrossAttention(WIDTHS, heads=4).log_decay.exp(), torch.tensor([1000.0, 100.0, 10.0, 1.0]), atol=1e-2)
    close(CrossAttention(WIDTHS, heads=1).log_decay.exp(), torch.tensor([DECAYS[0]]), atol=1e-2)


@torch.no_grad()
def test_as_it_is_built_it_adds_nothing():
    points, features, touches = given()
    assert torch.equal(CrossAttention(WIDTHS).double()(points, features, touches), features)


@torch.no_grad()
def test_it_depends_on_relative_positions_alone():
    part, (points, features, touches) = made(), given()
    fused = part(points, features, touches)
    moved = TouchBatch(touches.points + 0.3, touches.features, touches.mask)
    close(part(points + 0.3, features, moved), fused, atol=1e-9)
    assert (part(points, features, moved) - fused).abs().max() > 1e-2


def test_a_missing_touch_has_no_effect_and_no_gradient():
    part, (points, features, touches) = made(), given()
    message = touches.features.clone().requires_grad_()
    missing = ~touches.mask[:, :, None, None]
    broken = TouchBatch(touches.points.masked_fill(missing, torch.inf), message, touches.mask)
    fused = part(points, features, broken)
    close(fused, part(points, features, touches), atol=1e-9)
    fused.square().sum().backward()
    assert message.grad[~touches.mask].abs().max() == 0
    for weight in part.parameters():
        assert weight.grad.isfinite().all()
        assert weight.grad.abs().max() > 0


@torch.no_grad()
def test_single_precision_is_enough_in_a_cloud_of_radius_1():
    part, (points, features, touches) = made(), given(200)
    points, touched = points / points.norm(dim=-1).max(), touches.points / touches.points.norm(dim=-1).max()
    exact = part(points, features, TouchBatch(touched, touches.features, touches.mask))
    single = part.float()(
        points.float(), features.float(), TouchBatch(touched.float(), touches.features.float(), touches.mask)
    )
    close(single.double(), exact, atol=1e-3)
