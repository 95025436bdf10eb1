"""`surface-passes`: the terms of `surface` for two passes, and the mismatch of predicted errors."""

import pytest
import torch

from pcsr import UserError
from pcsr_plugins.objectives.surface import Surface
from pcsr_plugins.objectives.surface_passes import FAR, RATE, SurfacePasses
from tests.plugins.surfaces import sphere
from tests.small_network import network

PARTS = ("model.encoder={use: local-frames, channels: 8}", "model.touch_encoder=null", "model.fusion=none")
N = 64


def small(upsampler="{use: rated-edges, hidden: 8}"):
    return network(*PARTS, "model.backbone={use: local-frames, layers: 1}", f"model.upsampler={upsampler}").train()


def losses(net, **options):
    return SurfacePasses(**options).losses(net, sphere(0, N, rows=2), sphere(3, 16 * N, rows=2), 16)


def test_both_passes_have_the_four_terms():
    found = losses(small())
    names = ["coverage", "surface", "stray", "error"]
    assert list(found) == [*names, *(f"second {name}" for name in names)]
    assert all(torch.isfinite(loss) and loss >= 0 for loss in found.values())


def test_close_to_the_surface_the_terms_of_the_first_pass_are_those_of_surface():
    net, points, truth = small(), sphere(0, 256, rows=2), sphere(3, 4096, rows=2)
    found = SurfacePasses().losses(net, points, truth, 16)
    dense = net.upsampler(*net.refine(points), RATE)
    plain = Surface()(dense, truth)
    torch.testing.assert_close(found["stray"], plain["stray"])
    height = (plain["surface"] / 2).sqrt()
    assert height < FAR
    torch.testing.assert_close(found["surface"], plain["surface"], rtol=0.2, atol=0)


def test_far_candidates_count_less_than_by_the_square():
    net, truth = small(), sphere(3, 1024, rows=2)
    points = 1.5 * sphere(0, N, rows=2)  # all of them half a radius away from the truth
    found = SurfacePasses(surface=1.0).losses(net, points, truth, 16)["surface"]
    plain = Surface(surface=1.0)(net.upsampler(*net.refine(points), RATE), truth)["surface"]
    assert found < 0.3 * plain


def test_the_error_head_and_the_copies_are_trained_and_learn():
    net = small()
    with torch.no_grad(), torch.random.fork_rng():
        torch.manual_seed(0)
        points = sphere(0, N, rows=2) + 0.02 * torch.randn(2, N, 3)
    truth, objective = sphere(3, 16 * N, rows=2), SurfacePasses()
    optimizer = torch.optim.Adam(net.parameters(), lr=3e-3)
    history = []
    for step in range(15):
        found = objective.losses(net, points, truth, 16)
        optimizer.zero_grad()
        sum(found.values()).backward()
        if step == 0:
            assert net.upsampler.error.weight.grad.abs().max() > 0
            assert net.upsampler.own[-1][-1].bias.grad.abs().max() > 0
        optimizer.step()
        history.append((found["error"].item(), found["surface"].item()))
    assert history[-1][0] < 0.9 * history[0][0]
    assert history[-1][1] < history[0][1]


def test_an_upsampler_without_predicted_errors_is_refused_with_a_remedy():
    with pytest.raises(UserError, match=r"upsampler EdgeOffsets has none: take objective 'surface', or an upsampler"):
        losses(small("{use: edge-offsets, hidden: 8}"))
