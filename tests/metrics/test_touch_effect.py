"""What touch does to a network, against slow references and on known clouds."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pcsr.errors import RunError
from pcsr.metrics import chamfer
from pcsr.metrics.touch_effect import EDGES, distance_bins, efficiency, replace_region, touch_effect


def plane(side: int, seed: int = 0) -> torch.Tensor:
    """Random points of the square of half a side, at z = 0."""
    flat = torch.rand(side * side, 3, generator=torch.Generator().manual_seed(seed)) - 0.5
    return flat * torch.tensor([1.0, 1.0, 0.0])


def slowly_replaced(dense, truth, region):
    kept = [p for p in dense.tolist() if not region[min(range(len(truth)), key=lambda k: math.dist(p, truth[k]))]]
    return [*kept, *(truth[k].tolist() for k in range(len(truth)) if region[k])]


@given(seed=st.integers(0, 1000))
def test_the_region_is_replaced_as_the_slow_way_does(seed):
    generator = torch.Generator().manual_seed(seed)
    dense, truth = (torch.rand(n, 3, generator=generator) for n in (20, 30))
    region = torch.rand(30, generator=generator) < 0.3
    torch.testing.assert_close(
        replace_region(dense, truth, region), torch.tensor(slowly_replaced(dense, truth, region)).view(-1, 3)
    )


def test_the_ends_of_replacing_are_the_cloud_and_the_truth():
    dense, truth = plane(5, 1), plane(6, 2)
    assert torch.equal(replace_region(dense, truth, torch.zeros(36, dtype=torch.bool)), dense)
    assert torch.equal(replace_region(dense, truth, torch.ones(36, dtype=torch.bool)), truth)


def test_the_replaced_region_has_no_error_and_the_rest_keeps_its_own():
    truth = plane(20, 1)
    dense, region = plane(20, 2), truth[:, 0] < 0
    error, before = (
        torch.cdist(truth, cloud, compute_mode="donot_use_mm_for_euclid_dist").amin(1)
        for cloud in (replace_region(dense, truth, region), dense)
    )
    assert (error[region] == 0).all()
    far = truth[:, 0] > 0.2
    assert torch.equal(error[far], before[far])
    assert (before[far] > 0).all()


def test_the_efficiency_is_of_means_and_not_a_mean_of_ratios():
    touched, plain, replaced = [1.0, 8.0], [2.0, 8.0], [0.0, 4.0]
    assert efficiency(touched, plain, replaced) == pytest.approx(1 / 6)  # the ratios are 1/2 and 0
    assert efficiency(plain, plain, replaced) == 0
    assert efficiency([3.0, 8.0], plain, replaced) < 0
    assert efficiency(touched, plain, plain) is None, "no error to take, so no share of it"


def test_a_fresh_sampling_of_the_region_stays_below_one():
    """A network that is wrong by 0.1 everywhere, and right where it was touched."""
    truth, fresh = plane(60, 1), plane(60, 2)
    region, inside = truth[:, 0] < 0, fresh[:, 0] < 0
    plain = plane(60, 3) + torch.tensor([0, 0, 0.1])
    touched = torch.cat([fresh[inside], plain[plain[:, 0] >= 0]])
    effect = touch_effect([truth], [truth[region]], [region], [touched], [plain], {}, "ours", 0.5)
    reached = efficiency(effect.touched, effect.plain, effect.replaced)
    assert 0.9 < reached < 1
    assert effect.plain == [float(chamfer(plain[None], truth[None])[0])]
    assert effect.touched == [float(chamfer(touched[None], truth[None])[0])]
    assert effect.replaced == [float(chamfer(replace_region(plain, truth, region)[None], truth[None])[0])]


@pytest.mark.parametrize(
    ("distance", "expected"),
    [(0.0, 0), (0.019, 0), (0.021, 1), (0.051, 2), (0.11, 3), (0.25, 4), (0.5, 5), (0.81, 6), (5.0, 6)],
)
def test_a_distance_has_its_bin(distance, expected):
    touched = torch.zeros(1, 3)
    assert distance_bins(torch.tensor([[distance, 0.0, 0.0]]), touched).tolist() == [expected]


@given(seed=st.integers(0, 1000))
def test_errors_by_distance_agree_with_the_slow_way(seed):
    rng = np.random.default_rng(seed)
    truth, touched, plain, other = rng.uniform(-0.6, 0.6, (4, 2, 25, 3)).astype(np.float32)
    touches = truth[:, :2] + np.float32(0.001)
    region = np.tile(np.arange(25) < 2, (2, 1))
    *of_network, of_other = ([*torch.from_numpy(array)] for array in (truth, touches, region, touched, plain, other))
    effect = touch_effect(*of_network, {"other": of_other}, "ours", 0.5)
    slow = {name: [[] for _ in EDGES] for name in ("ours", "ours without touch", "other")}
    for i in range(2):
        for point in truth[i]:
            away = np.linalg.norm(touches[i] - point, axis=1).min()
            place = sum(away >= edge for edge in EDGES) - 1
            for name, clouds in zip(slow, (touched, plain, other), strict=True):
                slow[name][place].append(np.linalg.norm(clouds[i] - point, axis=1).min() ** 2)
    assert effect.errors.keys() == slow.keys()
    assert effect.counts == [len(of_bin) for of_bin in slow["ours"]]
    for name, bins in slow.items():
        for value, of_bin in zip(effect.errors[name], bins, strict=True):
            assert value == (pytest.approx(np.mean(of_bin), rel=1e-4) if of_bin else None)


def test_a_network_that_diverged_is_named():
    truth = plane(4)
    broken = truth * torch.nan
    with pytest.raises(RunError, match="not finite"):
        touch_effect([truth], [truth], [truth[:, 0] > 0], [truth], [broken], {}, "ours", 0.5)
