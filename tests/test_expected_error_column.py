"""`fields=["error"]` of `Model.upsample`: a column beside the same points, for every way to upsample."""

import warnings

import numpy as np
import pytest

from pcsr import PcsrWarning, PoseError, Touch, UserError, expected_errors
from pcsr.clouds.cloud import Cloud
from pcsr.model import load
from pcsr.registration import register

UNIT = 20.0


def waves(count=400, seed=0, noise=0.0):
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, UNIT, (count, 2))
    return np.column_stack([xy, height(xy) + noise * rng.normal(size=count)])


def height(xy):
    return np.sin(0.4 * xy[:, 0]) + np.cos(0.3 * xy[:, 1])


def press(middle, errors=None, shift=0.0):
    """A touch of 5 × 5 mm, moved along the normal."""
    grid = np.stack(np.meshgrid(*[np.linspace(-2.5, 2.5, 25)] * 2), -1).reshape(-1, 2) + middle
    points = np.column_stack([grid, height(grid) + shift])
    given = None if errors is None else np.full(len(points), errors)
    return Touch.single(points, np.eye(4), 1.0, "digit", errors=given)


@pytest.fixture(scope="module")
def interpolation():
    return load("midpoint")


@pytest.mark.parametrize("name", ["midpoint", "field", "tapsr"])
@pytest.mark.parametrize("keep", [True, False])
def test_points_are_the_same_with_and_without_errors(name, keep):
    model, cloud = load(name), Cloud(waves(), {"label": np.arange(400)})
    plain, rated = (model.upsample(cloud, keep=keep, fields=fields) for fields in ((), ("error", "source")))
    np.testing.assert_array_equal(plain.points, rated.points)
    assert list(rated.columns) == ["label", "error", "source"]
    errors = rated.columns["error"]
    assert errors.dtype == np.float64
    assert np.isfinite(errors).all()
    given = 400 if keep else 0
    assert (errors[:given] == 0).all(), "no noise is found"
    assert 0 < errors[given:].min() <= np.median(errors[given:]) < 0.5


def test_they_are_those_of_the_function_for_arrays(interpolation):
    points = waves()
    dense = interpolation.upsample(Cloud(points), fields=["error"])
    np.testing.assert_allclose(dense.columns["error"][400:], expected_errors(points, dense.points[400:]))


def test_the_errors_that_the_network_predicts_count():
    points = waves()
    dense = load("field").upsample(Cloud(points), fields=["error"])
    plain = expected_errors(points, dense.points[400:])
    ratio = dense.columns["error"][400:] / plain
    assert (np.abs(np.log(ratio)) > 0.01).mean() > 0.5
    assert 0.5 < np.median(ratio) < 2


def test_a_cloud_in_single_precision_has_errors_in_single_precision(interpolation):
    cloud = Cloud(waves().astype(np.float32).astype(np.float64), {}, {"ply": {"coordinates": "float"}})
    assert interpolation.upsample(cloud, fields=["error"]).columns["error"].dtype == np.float32


def test_units_of_any_size(interpolation):
    one = interpolation.upsample(Cloud(waves()), fields=["error"]).columns["error"]
    for scale in (1e-150, 1e150):
        other = interpolation.upsample(Cloud(scale * waves()), fields=["error"]).columns["error"]
        np.testing.assert_allclose(np.median(other / scale), np.median(one), rtol=0.05)


def test_noise_and_denoising_are_errors_of_the_given_points(interpolation):
    cloud = Cloud(waves(2500, noise=0.2))
    errors = [interpolation.upsample(cloud, denoise=level, fields=["error"]).columns["error"] for level in (False, 0.2)]
    np.testing.assert_allclose(errors[0][:2500], 0.2, rtol=0.25)
    np.testing.assert_allclose(errors[1][:2500], 0.1, rtol=0.25)
    assert np.median(errors[1][2500:]) < np.median(errors[0][2500:])


def test_points_that_are_not_used_have_none(interpolation):
    points = waves()
    points[7] = np.nan
    points[50] = points[3]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PcsrWarning)
        dense = interpolation.upsample(Cloud(points), bad="keep", fields=["error"])
        dropped = interpolation.upsample(Cloud(points), bad="drop", fields=["error"])
    errors = dense.columns["error"]
    assert np.flatnonzero(np.isnan(errors)).tolist() == [7]
    assert errors[50] == errors[3]
    assert np.isfinite(dropped.columns["error"]).all()


def test_processes_give_the_same_errors(interpolation):
    cloud = Cloud(waves(600))
    one, two = (interpolation.upsample(cloud, fields=["error"], jobs=jobs).columns["error"] for jobs in (1, 2))
    np.testing.assert_array_equal(one, two)


def test_progress_includes_the_errors_and_ends_at_the_total(interpolation):
    calls = []
    interpolation.upsample(Cloud(waves()), fields=["error"], advance=lambda *both: calls.append(both))
    done, totals = zip(*calls, strict=True)
    assert list(done) == sorted(set(done))
    assert set(totals) == {800}
    assert done[-1] == 800


def hole(points, middle=(10.0, 10.0), half=3.0):
    return points[(np.abs(points[:, :2] - middle) > half).any(1)]


def touched_errors(model, cloud, touches, **options):
    """Errors of the touched points of a hole, of points made next to them, and of those far away."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PcsrWarning)
        dense = model.upsample(Cloud(cloud), touches, fields=["source", "error"], **options)
    source, errors = dense.columns["source"], dense.columns["error"]
    near = (np.abs(dense.points[:, :2] - 10) < 1.5).all(1)
    assert (source == 2).sum() > 3
    return errors[source == 2], errors[(source == 1) & near], errors[(source == 1) & ~near]


def test_touched_points_have_the_error_of_their_sensor_where_their_poses_are_exact(interpolation):
    cloud, touch = hole(waves(800)), press((10.0, 10.0), errors=0.07)
    on, near, _ = touched_errors(interpolation, cloud, [touch], touch_as_is=True)
    np.testing.assert_allclose(on, 0.07)
    assert near.min() >= 0.07
    exact, _, _ = touched_errors(interpolation, cloud, [touch], pose_error=PoseError(0.0, 0.0))
    np.testing.assert_allclose(exact, 0.07)


def test_touched_points_have_the_error_of_their_registration_too(interpolation):
    cloud, touch = hole(waves(800), half=2.2), press((10.0, 10.0), errors=0.07, shift=0.6)
    registered = register([touch], cloud, pose_error=PoseError(1.0, 1.0))
    assert registered.touches[0].verdict in ("moved", "partly")
    low, high = registered.touches[0].errors.min(), registered.touches[0].errors.max()
    for touches in ([touch], registered):
        on, _, _ = touched_errors(interpolation, cloud, touches, **({} if touches is registered else POSE))
        assert low <= on.min() <= on.max() <= high
        assert on.min() > 0.07


POSE = {"pose_error": PoseError(1.0, 1.0)}


@pytest.mark.parametrize("options", [{"touch_as_is": True}, {"pose_error": PoseError(0.0, 0.0)}])
def test_the_error_of_touches_of_which_nothing_is_known_is_unknown(interpolation, options):
    cloud, touch = hole(waves(800)), press((10.0, 10.0))
    for touches in ([touch], [touch.points]):
        on, near, far = touched_errors(interpolation, cloud, touches, **options)
        assert np.isnan(on).all()
        assert np.isfinite(near).all()
        assert np.isfinite(far).all()


def test_touched_points_that_the_network_inserts_have_the_error_of_their_touch():
    cloud, touch = waves(1500), press((10.0, 10.0), errors=0.07)
    dense = load("field").upsample(Cloud(cloud), [touch], touch_as_is=True, fields=["source", "error"])
    inserted = np.isclose(dense.columns["error"], 0.07, rtol=1e-9) & (dense.columns["source"] == 1)
    assert inserted.sum() > 10
    on = dense.points[inserted]
    np.testing.assert_allclose(on[:, 2], height(on[:, :2]), atol=1e-5)


def test_an_unknown_field_is_named(interpolation):
    with pytest.raises(UserError, match="field 'errors' is unknown: fields are source, error"):
        interpolation.upsample(Cloud(waves()), fields=["errors"])
    with pytest.raises(UserError, match="field 'error' is a column, which a ndarray cannot hold"):
        interpolation.upsample(waves(), fields=["error"])
