"""Touches are refused for a reason, and points are used if they are more exact than the cloud."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pcsr.registration.acceptance import REACH, TRUSTED, UNSEEN, judge
from pcsr.registration.fit import Prior, fit
from pcsr.registration.likelihood import Likelihood
from pcsr.registration.motions import isotropic, moved
from pcsr.registration.neighbourhood import Neighbourhood
from tests.registration.patches import by, plate, pressed, rigid, scan, wavy

PRIOR = Prior(np.zeros(6), isotropic(0.7, 0.02))


def case(touch, cloud, prior=PRIOR):
    one = Neighbourhood.of(touch, cKDTree(cloud), cloud.mean(0), 5.0)
    likelihood = Likelihood(one.surfaces, one.near, one.near_spacing)
    return one, likelihood, prior, fit(likelihood, prior, 0.02)


def judged(*given, error=0.0):
    return judge(*given, np.full(len(given[0].points), error))


def test_points_are_used_up_to_the_error_of_the_cloud():
    one, *rest = case(pressed(wavy), scan(wavy))
    limit = TRUSTED * one.spacing
    errors = np.where(np.arange(400) < 100, 1.01, 0.99) * limit
    found = judge(one, *rest, errors)
    np.testing.assert_array_equal(found.kept, errors < limit)
    assert found.verdict == "partly"
    assert found.reason.startswith("at 100 points the expected error exceeds that of the cloud")
    assert judged(one, *rest, error=2 * limit).verdict == "refused"
    assert judged(one, *rest, error=0.5 * limit).kept.all()


def test_support_is_the_number_of_points_on_the_touch():
    cloud = scan(wavy)
    one, *rest = case(pressed(wavy), cloud)
    within = (abs(cloud[:, :2]) < 4).all(1).sum()
    assert judged(one, *rest).support == pytest.approx(within, abs=4)


@pytest.mark.parametrize(("shift", "verdict"), [(0.0, "kept"), (0.4, "moved")])
def test_small_motions_are_not_made(shift, verdict):
    given = case(
        by(pressed(plate), rigid([0, 0, 0], [0, 0, shift])), scan(plate), Prior(np.zeros(6), isotropic(0.7, 1e-4))
    )
    given[3].motion[3:5] = 0
    assert judged(*given).verdict == verdict


def test_the_finger_cannot_be_where_the_cloud_is():
    exact = Prior(np.zeros(6), isotropic(0.05, 0.002))
    cloud = np.concatenate([scan(plate), scan(plate, seed=3) + np.array([0, 0, 4])])
    found = judged(*case(pressed(plate), cloud, exact))
    assert found.verdict == "refused"
    assert "lie where the finger was" in found.reason
    few = np.concatenate([scan(plate), [[0.5, 0, 4], [-1, 1, 4.0]]])
    assert judged(*case(pressed(plate), few, exact)).verdict != "refused"


def test_a_motion_that_the_error_of_the_arm_does_not_explain_is_refused():
    given = case(by(pressed(wavy), rigid([0, 0, 0], [0, 0, 0.7])), scan(wavy))
    narrow = Prior(np.zeros(6), isotropic(0.1, 0.002))
    found = judged(given[0], given[1], narrow, given[3])
    assert found.verdict == "refused"
    assert "more than the error of the arm explains" in found.reason
    assert judged(*given).verdict == "moved"


def test_far_from_the_cloud_larger_errors_are_allowed():
    """The cloud ends 2 mm beside the touch, on which it has no points."""
    cloud = scan(plate, half=40, count=4000)
    cloud = cloud[(cloud[:, 0] < -6) & (cloud[:, 0] > -20)]
    one, *rest = case(pressed(plate), cloud)
    away = cKDTree(one.near).query(moved(one.points, rest[-1].motion))[0]
    free = away > REACH * one.spacing
    assert free.sum() > 100
    assert judge(one, *rest, 0.99 * UNSEEN * away).kept[free].all()
    assert not judge(one, *rest, 1.01 * UNSEEN * away).kept[free].any()


def test_without_a_cloud_nothing_speaks_against_a_touch():
    found = judged(*case(pressed(plate), scan(plate) + np.array([200, 0, 0])), error=1.0)
    assert (found.verdict, found.support) == ("kept", 0)
    assert found.reason == "no point of the cloud lies on it, so that it cannot be checked"
