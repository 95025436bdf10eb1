"""A screened cloud is denoised with its columns; what is not used stays, except for copies."""

import numpy as np
import pytest

from pcsr import UserError
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.faults import screen
from pcsr.upsample.denoised_cloud import denoise_cloud


def floor(count=600, noise=0.2):
    rng = np.random.default_rng(0)
    across = rng.uniform(0, np.sqrt(count), (count, 2))
    return np.column_stack([across, noise * rng.normal(size=count)])


def test_columns_and_rows_stay():
    cloud = Cloud(floor(), {"label": np.arange(600)}, {"notes": []})
    moved, result = denoise_cloud(screen(cloud), 0.2)
    assert result.moved == 600
    assert moved.cloud.about == cloud.about
    np.testing.assert_array_equal(moved.cloud.columns["label"], np.arange(600))
    np.testing.assert_array_equal(moved.cloud.points, result.points)
    np.testing.assert_allclose(moved.cloud.points[:, :2], cloud.points[:, :2], atol=0.3)


@pytest.mark.filterwarnings("ignore::pcsr.PcsrWarning")
def test_unused_points_stay_and_copies_move_along():
    points = np.concatenate([floor(), [[np.nan, 0, 0], [1e6, 0, 0]], floor()[:3]])
    moved, _ = denoise_cloud(screen(Cloud(points), "keep"), 0.2)
    np.testing.assert_array_equal(moved.cloud.points[600:602], points[600:602])
    np.testing.assert_array_equal(moved.cloud.points[602:], moved.cloud.points[:3])
    assert not np.array_equal(moved.cloud.points[:3], points[:3])


def test_without_noise_the_cloud_is_the_same():
    given = screen(Cloud(floor(noise=0.0)))
    assert denoise_cloud(given, True)[0] is given


@pytest.mark.parametrize("level", [0.0, -1.0, float("nan"), float("inf"), 1000.0])
def test_a_level_that_is_none_is_refused(level):
    with pytest.raises(UserError, match=r"--denoise .*standard deviation"):
        denoise_cloud(screen(Cloud(floor())), level)


@pytest.mark.parametrize("level", [None, "0.2", False, [0.2]])
def test_what_is_no_number_is_refused(level):
    with pytest.raises(UserError, match=r"denoise is .*a number"):
        denoise_cloud(screen(Cloud(floor())), level)
