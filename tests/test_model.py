"""pcsr from Python: clouds of every kind in, clouds of that kind out; models by name, folder and file; metrics."""

import shutil
import subprocess
import sys

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import cKDTree

import pcsr
from pcsr import Touch, UserError
from pcsr.model import load
from pcsr.recorded import write
from pcsr.upsample.unseen import unseen
from pcsr.weights import shipped


@pytest.fixture(scope="module")
def interpolation():
    return load("midpoint")


def cloud(count=60, seed=0):
    xy = np.random.default_rng(seed).uniform(-1, 1, (count, 2))
    return np.column_stack([xy, 0.3 * xy[:, 0] ** 2 + 0.1 * xy[:, 1]])


def test_arrays_come_back_as_arrays_of_their_kind(interpolation):
    points = cloud()
    dense = interpolation.upsample(points, rate=3)
    assert dense.shape == (180, 3)
    assert dense.dtype == np.float64
    np.testing.assert_array_equal(dense[:60], points)
    single = interpolation.upsample(points.astype(np.float32), count=100)
    assert (single.shape, single.dtype) == ((100, 3), np.float32)
    assert interpolation.upsample(points.tolist(), rate=2).shape == (120, 3)
    assert interpolation.upsample(points).shape == (240, 3), "without a rate it is 4"


def test_tensors_come_back_as_tensors(interpolation):
    points = torch.from_numpy(cloud()).float()
    dense = interpolation.upsample(points, rate=2.5)
    assert isinstance(dense, torch.Tensor)
    assert (tuple(dense.shape), dense.dtype) == ((150, 3), torch.float32)
    assert torch.equal(dense[:60], points)
    replaced = interpolation.upsample(points.double(), rate=2.5, keep=False)
    assert replaced.shape == (150, 3)
    assert cKDTree(points).query(replaced)[0].min() > 0


def test_trimesh_clouds_and_meshes_keep_their_colours(interpolation):
    colours = np.random.default_rng(0).integers(0, 255, (60, 4)).astype(np.uint8)
    colours[:, :3] = [10, 200, 30]
    dense = interpolation.upsample(trimesh.PointCloud(cloud(), colors=colours), rate=2)
    assert isinstance(dense, trimesh.PointCloud)
    assert dense.vertices.shape == (120, 3)
    assert (np.asarray(dense.colors)[:, :3] == [10, 200, 30]).all()
    ball = trimesh.creation.icosphere(subdivisions=2)
    assert interpolation.upsample(ball, rate=2).vertices.shape == (2 * len(ball.vertices), 3)


def test_large_coordinates_keep_their_millimetres(interpolation):
    far = np.array([500_000.0, 5_400_000.0, 300.0])
    near, there = interpolation.upsample(cloud(), rate=4), interpolation.upsample(cloud() + far, rate=4)
    np.testing.assert_array_equal(there[:60], cloud() + far)
    # Where two gaps are of one size, the last digit may decide otherwise.
    assert np.quantile(cKDTree(near).query(there - far)[0], 0.9) < 1e-6


@pytest.fixture(scope="module")
def default():
    return load()


def test_the_default_weights_listen_to_touches_of_every_form(default, tmp_path):
    points = cloud(300)
    touches = [cloud(40, seed) * 0.2 for seed in (1, 2)]
    plain = default.upsample(points, rate=2)
    touched = default.upsample(points, touches, rate=2)
    assert plain.shape == touched.shape == (600, 3)
    assert not np.array_equal(plain, touched)
    records = [Touch.single(touch, np.eye(4), 1.0, "digit") for touch in touches]
    write(tmp_path / "touches", records)
    for same in (
        records,
        tmp_path / "touches",
        str(tmp_path / "touches"),
        [torch.from_numpy(touch) for touch in touches],
    ):
        np.testing.assert_array_equal(default.upsample(points, same, rate=2, touch_as_is=True), touched)


@pytest.mark.parametrize(("factor", "shift"), [(1000.0, 0.0), (1.0, 50.0)])
def test_touches_in_another_unit_or_frame_are_refused_with_both_sizes(interpolation, factor, shift):
    touches = [0.1 * cloud(), 0.1 * cloud() * factor + shift]
    with pytest.raises(
        UserError, match=r"touch 1 is .* across and lies .* away from the cloud, which is 2\.\d+ across"
    ):
        interpolation.upsample(cloud(), touches, rate=2)


def test_a_touch_where_the_cloud_has_no_points_is_told_and_used(interpolation):
    far = 0.1 * cloud() + [0, 0, 0.9]
    with pytest.warns(UserWarning, match=r"touched points lie up to 0\.\d+ from the cloud"):
        made = interpolation.upsample(cloud(), [0.1 * cloud(), far], rate=2)
    assert (cKDTree(made).query(far)[0] == 0).any()


@pytest.mark.parametrize("touch", [np.zeros((0, 3)), np.full((4, 3), np.nan)])
def test_touches_without_points_are_refused(interpolation, touch):
    with pytest.raises(UserError, match="touch 0 has"):
        interpolation.upsample(cloud(), [touch], rate=2)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"rate": 1.0}, r"rate is 1: it must be 1\.1 to 64"),
        ({"rate": 65}, "rate is 65"),
        ({"rate": float("nan")}, "rate is nan"),
        ({"count": 0}, "count is 0"),
        ({"count": 10}, "10 points are fewer than the 60 of the cloud"),
        ({"count": 100_000}, "more than 64 times the cloud's 60 points"),
        ({"rate": 2.0, "count": 100}, "exclude each other"),
    ],
)
def test_impossible_numbers_are_said(interpolation, options, said):
    with pytest.raises(UserError, match=said):
        interpolation.upsample(cloud(), **options)


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (np.zeros((20, 2)), r"a cloud has the shape \(n, 3\), got \(20, 2\)"),
        (np.full((20, 3), np.inf), "20 of 20 points"),
        (np.ones((20, 3)), "lie on one spot"),
        (cloud(3), "the cloud has 3 points"),
        ("cloud.ply", "a str is no cloud"),
        ([["a", "b", "c"]] * 20, "a list is no cloud"),
    ],
)
def test_what_is_no_cloud_is_named(interpolation, points, said):
    with pytest.raises(UserError, match=said):
        interpolation.upsample(points, rate=2)


def test_models_are_found_by_name_folder_and_file(tmp_path, default):
    shutil.copy(shipped("field"), tmp_path / "weights.safetensors")
    for model in ("field", tmp_path, str(tmp_path), tmp_path / "weights.safetensors"):
        loaded = load(model)
        assert loaded.network is not None
        assert not loaded.network.training
        for one, other in zip(loaded.network.parameters(), default.network.parameters(), strict=True):
            assert torch.equal(one, other)


@pytest.mark.parametrize(
    ("model", "said"),
    [
        ("taspr", "there are no weights 'taspr'.*did you mean 'tapsr'"),
        ("someone/weights", r"someone/weights.*pip install 'pcsr\[hub\]'|cannot be fetched"),
        ("no/such/file.safetensors", "there are no weights"),
    ],
)
def test_a_model_that_is_not_there_is_named(model, said):
    with pytest.raises(UserError, match=said):
        load(model)


def test_a_folder_without_weights_is_named(tmp_path):
    with pytest.raises(UserError, match=r"holds no weights\.safetensors"):
        load(tmp_path)


def test_a_misplaced_touch_is_told_with_how_far_it_is_off(interpolation):
    points = cloud(2000)
    lifted = points[:50] + np.array([0, 0, 0.3])
    taken = unseen(points, [points[20:25], lifted])
    off = cKDTree(points).query(taken)[0].max()
    with pytest.warns(UserWarning, match=f"^{len(taken)} touched points lie up to {off:.4g} from the cloud"):
        interpolation.upsample(points, [points[20:25], lifted])


def test_a_device_that_is_not_there_is_named():
    with pytest.raises(UserError, match="device 'nonsense' cannot be used"):
        load("tapsr", device="nonsense")


def test_everything_is_at_the_top():
    assert pcsr.load("midpoint").name == "midpoint"
    assert pcsr.evaluate(cloud(), cloud())["cd"] == 0
    assert callable(pcsr.graft)
    values = pcsr.metrics.chamfer(torch.rand(3, 20, 3), torch.rand(3, 30, 3))
    assert values.shape == (3,)


@pytest.mark.slow
def test_a_model_is_loaded_without_what_few_need():
    unneeded = ["pcsr.recorded", "pcsr.report", "lightning", "plotly", "onnx", "torch._dynamo"]
    script = f"import sys, pcsr; pcsr.load(); print([name for name in {unneeded} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize("level", [True, 0.2])
def test_given_points_are_denoised_before_new_ones_are_made(level):
    rng = np.random.default_rng(0)
    cloud = np.column_stack([rng.uniform(0, 20, (400, 2)), 0.2 * rng.normal(size=400)])
    plain, moved = (load("midpoint").upsample(cloud, rate=2, denoise=one) for one in (False, level))
    np.testing.assert_array_equal(plain[:400], cloud)
    assert moved.shape == plain.shape
    assert moved[:400, 2].std() < 0.5 * cloud[:, 2].std()
    assert moved[400:, 2].std() < 0.8 * plain[400:, 2].std()


def test_noise_larger_than_the_cloud_is_refused():
    with pytest.raises(UserError, match="--denoise 100: the cloud is only"):
        load("midpoint").upsample(np.random.default_rng(0).normal(size=(40, 3)), denoise=100)
