"""`surface`: how well the truth is covered, and how far over it and beside it the new points lie."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from pcsr import UserError, Widths
from pcsr.metrics.chamfer import chamfer
from pcsr.metrics.nearest import nearest_squared
from pcsr_plugins.encoders.local_frames import LocalFrameEncoder
from pcsr_plugins.fusions.none import NoFusion
from pcsr_plugins.layers.surface_distances import AROUND, planes
from pcsr_plugins.objectives.surface import Surface
from pcsr_plugins.upsamplers.edge_offsets import EdgeOffsets
from tests.plugins.slow_frames import rotation
from tests.plugins.surfaces import patch, sphere

SURFACE, STRAY = 2.0, 10.0
"""Their weights by default."""


def slowly(prediction, target):
    """Point by point, each plane by the singular values of the true points around; without weights."""
    apart = torch.cdist(target, target, compute_mode="donot_use_mm_for_euclid_dist").fill_diagonal_(torch.inf)
    spacing = apart.amin(1).mean()
    surface, stray = [], []
    for p in prediction:
        distance, nearest = (target - p).norm(dim=1).min(0)
        around = target[apart[nearest].argsort()[:AROUND]]
        normal = torch.linalg.svd((around - around.mean(0)).double()).Vh[-1].float()
        surface.append(((p - target[nearest]) @ normal) ** 2)
        stray.append((distance - spacing).clamp(min=0) ** 2)
    coverage = [(prediction - q).square().sum(1).min() for q in target]
    return {
        name: torch.stack(each).mean()
        for name, each in (("coverage", coverage), ("surface", surface), ("stray", stray))
    }


@given(seed=st.integers(0, 1000), surface=st.floats(0.1, 100), stray=st.floats(0.1, 100))
@settings(max_examples=10)
def test_the_losses_are_what_they_are_point_by_point(seed, surface, stray):
    target, prediction = sphere(seed, rows=2), 1.1 * sphere(seed + 1, 30, rows=2) + 0.05
    losses = Surface(surface=surface, stray=stray)(prediction, target)
    rows = [slowly(p, t) for p, t in zip(prediction, target, strict=True)]
    assert list(losses) == ["coverage", "surface", "stray"]
    for name, weight in (("coverage", 1.0), ("surface", surface), ("stray", stray)):
        expected = weight * (rows[0][name] + rows[1][name]) / 2
        torch.testing.assert_close(losses[name], expected, rtol=1e-3, atol=1e-6)


@given(seed=st.integers(0, 1000))
@settings(max_examples=20)
def test_points_in_the_plane_cost_nothing_wherever_between_the_true_ones_they_lie(seed):
    target, _, inside = patch(seed)
    assert chamfer(inside, target) > 1e-4
    losses = Surface()(inside, target)
    assert losses["surface"] < 1e-10
    assert losses["stray"] < 0.01 * losses["coverage"]


@given(seed=st.integers(0, 1000), height=st.floats(0.001, 0.1), surface=st.floats(0.1, 100))
@settings(max_examples=20)
def test_it_grows_with_the_square_of_the_height_whichever_side(seed, height, surface):
    target, normal, inside = patch(seed)
    for side in (height, -height):
        loss = Surface(surface=surface)(inside + side * normal, target)["surface"]
        assert float(loss) == pytest.approx(surface * height**2, rel=1e-3)


def test_what_is_beside_the_truth_is_in_its_plane_but_strays():
    target, _, inside = patch()
    beside = inside + 4 * (target[:, :1] - target[:, 1:2])  # a way within the plane, far beyond its border
    losses, apart = Surface()(beside, target), nearest_squared(beside, target).sqrt()
    assert apart.min() > 0.5
    assert losses["surface"] < 1e-8
    _, spacing = planes(target)
    assert float(losses["stray"]) == pytest.approx(float(STRAY * (apart - spacing).square().mean()), rel=1e-4)


def test_it_pulls_to_the_surface_and_never_along_it():
    target, normal, inside = patch()
    prediction = (inside + 0.01 * normal).requires_grad_()
    Surface()(prediction, target)["surface"].backward()
    up = prediction.grad @ normal
    torch.testing.assert_close(up, torch.full_like(up, 2 * SURFACE * 0.01 / 50), rtol=1e-3, atol=0)
    assert (prediction.grad - up.unsqueeze(-1) * normal).abs().max() < 1e-3 * up.max()


def test_without_weights_it_is_one_side_of_chamfers_distance():
    prediction, target = sphere(1, 90, rows=3), sphere(0, 150, rows=3)
    losses = Surface(surface=0.0, stray=0.0)(prediction, target)
    other = nearest_squared(prediction, target).mean()
    torch.testing.assert_close(sum(losses.values()) + other, chamfer(prediction, target).mean())


@given(seed=st.integers(0, 1000), scale=st.floats(0.1, 10))
@settings(max_examples=10)
def test_it_does_not_depend_on_turns_and_goes_with_the_square_of_the_scale(seed, scale):
    prediction, target, turn = sphere(seed, 50) * 1.05, sphere(seed + 1), rotation(seed)
    before, after = Surface()(prediction, target), Surface()(scale * prediction @ turn, scale * target @ turn)
    for name, loss in before.items():
        torch.testing.assert_close(after[name], scale**2 * loss, rtol=1e-3, atol=0)


@pytest.mark.parametrize("target", [sphere(), torch.zeros(1, 30, 3), sphere(n=4), sphere(n=2)])
def test_gradients_are_finite_where_points_coincide(target):
    prediction = target.repeat(1, 2, 1).requires_grad_()
    losses = Surface()(prediction, target)
    assert sum(losses.values()) < 1e-9
    sum(losses.values()).backward()
    assert prediction.grad.isfinite().all()


@pytest.mark.parametrize("count", [0, 1])
def test_a_truth_without_a_second_point_is_refused_by_name(count):
    with pytest.raises(UserError, match=rf"objective 'surface' .* the truth has {count} in all: give it more"):
        Surface()(sphere(n=20), sphere(n=count))


def test_of_an_unevenly_sampled_truth_places_on_the_surface_stray():
    """What the docstring warns of: the spacing is one number for the whole cloud."""
    target, _, inside = patch()
    crowd = target[:, :1] + 1e-3 * (target - target[:, :1])  # as many again, within the plane, all in one place
    even, uneven = (Surface()(inside, truth)["stray"] for truth in (target, torch.cat([target, crowd], 1)))
    assert uneven > 10 * even


class Plain(torch.nn.Module):
    """An encoder, and the upsampler that reads it."""

    def __init__(self):
        super().__init__()
        self.encoder = LocalFrameEncoder(Widths(), channels=16)
        self.fusion = NoFusion(Widths())
        self.upsampler = EdgeOffsets(Widths(refined=16), hidden=32)

    def forward(self, points, rate):
        return self.upsampler(points, self.encoder(points), rate)


def test_training_with_it_brings_points_to_the_surface():
    with torch.random.fork_rng():
        torch.manual_seed(0)
        network, objective = Plain(), Surface()
    points, truth = sphere(0, 128, rows=2), sphere(1, 1024, rows=2)
    optimizer = torch.optim.Adam(network.parameters(), lr=3e-3)
    history = []
    for _ in range(25):
        losses = objective(network(points, 4), truth)
        optimizer.zero_grad()
        sum(losses.values()).backward()
        optimizer.step()
        history.append(losses["surface"].item())
    assert history[-1] < 0.5 * history[0], history  # the lines between neighbours cut a sphere short
