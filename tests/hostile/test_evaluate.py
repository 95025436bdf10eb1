"""Coordinates and arrays of every size and kind, given to `pcsr.evaluate` and `Model.upsample`."""

import numpy as np
import pytest
import torch

import pcsr
from pcsr import UserError
from pcsr.clouds.carry import carry
from pcsr.geometry.frames import UnitSphere

TRUTH = np.random.default_rng(0).normal(size=(60, 3))
CLOUD = TRUTH + np.random.default_rng(1).normal(size=(60, 3)) * 0.01
MIDPOINT = pcsr.load("midpoint")


@pytest.mark.parametrize("power", [-950, -333, -101, 1, 101, 512, 950])
def test_metrics_are_those_of_the_usual_size_to_the_last_bit(power):
    usual = pcsr.evaluate(CLOUD, TRUTH)
    assert pcsr.evaluate(np.ldexp(CLOUD, power), np.ldexp(TRUTH, power)) == usual
    each = pcsr.evaluate(CLOUD, TRUTH, frame="each")
    assert pcsr.evaluate(np.ldexp(CLOUD, power), np.ldexp(TRUTH, -power), frame="each") == each


@pytest.mark.parametrize("power", [-950, -333, -101, 1, 101, 512, 950])
def test_clouds_are_made_dense_as_those_of_the_usual_size(power):
    usual = MIDPOINT.upsample(CLOUD, [TRUTH[:5]])
    made = MIDPOINT.upsample(np.ldexp(CLOUD, power), [np.ldexp(TRUTH[:5], power)])
    np.testing.assert_allclose(np.ldexp(made, -power), usual, rtol=0, atol=1e-6)


@pytest.mark.parametrize("power", [-1000, -200, 0, 200, 1000])
def test_columns_are_carried_as_over_the_usual_size(power):
    columns = {"label": np.arange(60), "weight": TRUTH[:, 0]}
    old, new = np.ldexp(TRUTH, power), np.ldexp(CLOUD, power)
    for name, column in carry(columns, old, new).items():
        assert column.tobytes() == carry(columns, TRUTH, CLOUD)[name].tobytes()


@pytest.mark.parametrize("size", [1e-200, 1e300])
def test_a_command_measures_them(limited, tmp_path, size):
    np.save(tmp_path / "a.npy", CLOUD * size)
    np.save(tmp_path / "b.npy", TRUTH * size)
    outcome = limited("evaluate", "a.npy", "b.npy", "--json", folder=tmp_path)
    assert (outcome.code, outcome.err) == (0, "")
    limited("evaluate", "a.npy", "b.npy", "--frame", "none", folder=tmp_path).refused("'none'", "use the frame 'truth'")


def test_clouds_in_units_too_far_apart(limited, tmp_path):
    np.save(tmp_path / "a.npy", CLOUD * 1e300)
    np.save(tmp_path / "b.npy", TRUTH)
    limited("evaluate", "a.npy", "b.npy", folder=tmp_path).refused("reach", "e+299", "in the same unit")


def test_one_point_far_away_and_numbers_that_are_hardly_there(limited, tmp_path):
    far = TRUTH.copy()
    far[7] = 1e300
    np.save(tmp_path / "far.npy", far)
    np.save(tmp_path / "small.npy", TRUTH * 5e-320)
    assert limited("evaluate", "far.npy", "far.npy", folder=tmp_path).code == 0
    limited("evaluate", "small.npy", "small.npy", folder=tmp_path).refused("radius", "take another unit")
    with pytest.raises(UserError, match="radius is inf"):
        UnitSphere.fit(np.array([[-1.7e308] * 3, [1.7e308] * 3]))


@pytest.mark.parametrize(
    ("cloud", "message"),
    [
        (TRUTH[:, :2], r"got \(60, 2\): one row for each point"),
        (TRUTH.T, r"got \(3, 60\): transpose it"),
        (np.hstack([TRUTH, TRUTH]), r"got \(60, 6\): take its first three columns"),
        (TRUTH.astype(complex), "real numbers, got complex128"),
        (TRUTH > 0, "real numbers, got bool"),
        (TRUTH.astype(object), "real numbers, got object"),
        (TRUTH.astype(str), "real numbers, got <U"),
        ([["1", "2", "3"]] * 20, "a list is no cloud"),
        ([[10**400, 0, 0]] * 20, "a list is no cloud"),
        ([[1, 2, 3], [1, 2]], "a list is no cloud"),
        (np.ma.masked_greater(TRUTH, 1), "coordinates are masked"),
        (np.broadcast_to(TRUTH[:1], (10**12, 3)), "a cloud of 1000000000000 points needs about"),
        (np.zeros((0, 3)), "no points"),
        (np.full((20, 3), np.nan), "not finite"),
        (torch.from_numpy(TRUTH).to(torch.complex64), "real numbers, got torch.complex64"),
        (torch.from_numpy(TRUTH) > 0, "real numbers, got torch.bool"),
        (torch.zeros(20, 3, device="meta"), "on meta has no coordinates"),
        (torch.from_numpy(TRUTH).to_sparse(), "layout torch.sparse_coo"),
        (torch.zeros(1, 3).expand(10**12, 3), "a cloud of 1000000000000 points needs about"),
        (torch.float32, "a torch dtype is no cloud"),
        (None, "a NoneType is no cloud"),
    ],
)
def test_what_is_no_cloud_is_said(cloud, message):
    with pytest.raises(UserError, match=message):
        pcsr.evaluate(cloud, TRUTH)
    with pytest.raises(UserError, match=message):
        MIDPOINT.upsample(cloud)


def test_unmasked_and_whole_numbers_are_clouds():
    assert pcsr.evaluate(np.ma.array(TRUTH), TRUTH)["cd"] == 0
    huge = (TRUTH * 2**60).astype(np.int64)
    assert pcsr.evaluate(huge, huge)["cd"] == 0
    assert pcsr.evaluate(huge.astype(np.longdouble), huge)["cd"] == 0


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        ((TRUTH, np.array([[0, 1, 60]])), "1 of its 1 faces name vertices that are not there, such as face 0"),
        ((TRUTH, np.array([[0, 1, 2], [-1, 0, 1]])), r"such as face 1, \[-1, 0, 1\]: it has 60 vertices"),
        ((TRUTH, np.array([[0.0, 1, 2]])), "faces of integers, got float64 and float64"),
        ((TRUTH, np.array([[0, 1, 2, 3]])), r"faces \(f, 3\), got \(60, 3\) and \(1, 4\)"),
        ((TRUTH * np.inf, np.array([[0, 1, 2]])), "not finite"),
        ((TRUTH, np.zeros((0, 3), int)), "no faces"),
        (7, "a int is no mesh"),
        ("mesh.stl", "a str is no mesh"),
    ],
)
def test_what_is_no_mesh_is_said(mesh, message):
    with pytest.raises(UserError, match=message):
        pcsr.evaluate(CLOUD, TRUTH, mesh)


@pytest.mark.parametrize("touch", [TRUTH * 1e300, TRUTH * 0 + 1e200, TRUTH[:, :2], np.zeros((0, 3)), TRUTH * np.nan])
def test_touches_that_are_none_are_said(touch):
    with pytest.raises(UserError, match=r"touch 0 |a cloud has the shape"):
        MIDPOINT.upsample(CLOUD, [touch])
