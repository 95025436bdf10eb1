"""Columns of new points, through the command: labels stay labels, directions stay directions, sources are marked."""

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from pcsr import Touch, UserError, load
from pcsr.cli import pcsr
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import read_cloud, write_cloud
from pcsr.recorded import write

N = 300


def bowl(seed=0):
    xy = np.random.default_rng(seed).uniform(-1, 1, (N, 2))
    return np.column_stack([xy, 0.25 * (xy**2).sum(1)])


def true_normals(points):
    normals = np.column_stack([-0.5 * points[:, :2], np.ones(len(points))])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def write_text_ply(path, points, columns, kinds):
    names = ["x", "y", "z", *columns]
    head = [
        f"property {kind} {name}" for kind, name in zip(["double"] * 3 + [kinds] * len(columns), names, strict=True)
    ]
    rows = np.column_stack([points, *columns.values()])
    lines = ["ply", "format ascii 1.0", f"element vertex {len(points)}", *head, "end_header"]
    path.write_text("\n".join([*lines, *(" ".join(map(repr, row)) for row in rows.tolist())]) + "\n", encoding="utf-8")


def upsampled(path, *arguments, out=None, model="midpoint"):
    out = out or path.with_name("out.ply")
    words = ["upsample", path, "-o", out, "--model", model, *arguments]
    done = CliRunner().invoke(pcsr, [str(word) for word in words])
    assert done.exit_code == 0, done.output
    return read_cloud(out)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("scalar_Classification", [2, 6]),
        ("Classification", [2, 6]),
        ("scalar_Return_Number", [1, 2, 3]),
        ("ring", [0, 15, 31]),
        ("scalar_Original_cloud_index", [0, 1]),
        ("instance", [1, 40, 77]),
        ("confidence_class", [0.25, 0.5, 1]),
        ("scalar_field", [3, 9]),
        ("withheld", [0, 1]),
        ("heading", [1.5, 359.5]),
    ],
)
@pytest.mark.parametrize("kind", ["float", "double"])
def test_labels_written_as_floats_stay_labels(tmp_path, name, values, kind):
    labels = np.random.default_rng(1).choice(values, N)
    write_text_ply(tmp_path / "scan.ply", bowl(), {name: labels}, kind)
    dense = upsampled(tmp_path / "scan.ply")
    assert len(dense) == 4 * N
    assert set(dense.columns[name].tolist()) == set(values)


def test_times_are_those_of_a_point_and_temperatures_lie_between(tmp_path):
    rng = np.random.default_rng(2)
    times = {"gps_time": 1e8 + rng.random(N), "temperature": 20 + rng.random(N)}
    write_text_ply(tmp_path / "scan.ply", bowl(), times, "double")
    dense = upsampled(tmp_path / "scan.ply")
    assert set(dense.columns["gps_time"][N:].tolist()) <= set(times["gps_time"].tolist())
    new = dense.columns["temperature"][N:]
    assert times["temperature"].min() < new.min() < new.max() < times["temperature"].max()
    assert not set(new.tolist()) <= set(times["temperature"].tolist())


@pytest.mark.parametrize("model", ["midpoint", "frames"])
@pytest.mark.parametrize(
    "names", [("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"), ("dir_x", "dir_y", "dir_z")]
)
def test_normals_with_random_signs_are_right_but_for_the_sign(tmp_path, names, model):
    points = bowl()
    signs = np.random.default_rng(3).choice([-1, 1], (N, 1))
    normals = dict(zip(names, (signs * true_normals(points)).T, strict=True))
    write_text_ply(tmp_path / "scan.ply", points, normals, "double")
    dense = upsampled(tmp_path / "scan.ply", model=model)
    made = np.stack([dense.columns[name] for name in names], axis=1)
    np.testing.assert_allclose(np.linalg.norm(made, axis=1), 1, atol=1e-6)
    off = np.degrees(np.arccos(np.abs((made * true_normals(dense.points)).sum(1)).clip(0, 1)))
    assert off.max() < 12
    assert (np.sign(made[N:, 2]) == -1).mean() == pytest.approx(0.5, abs=0.15)


@pytest.mark.parametrize(
    "names", [("rot_0", "rot_1", "rot_2", "rot_3"), ("qx", "qy", "qz", "qw"), ("quat_x", "quat_y", "quat_z", "quat_w")]
)
def test_quaternions_are_rotations_between_those_of_the_neighbours(tmp_path, names):
    rng = np.random.default_rng(4)
    points = bowl()
    turn = Rotation.from_rotvec(np.outer(90 + 40 * points[:, 0], [0.0, 0.6, 0.8]), degrees=True)
    quaternions = turn.as_quat() * rng.choice([-1, 1], (N, 1)) * rng.uniform(0.5, 2, (N, 1))
    write_text_ply(tmp_path / "scan.ply", points, dict(zip(names, quaternions.T, strict=True)), "double")
    dense = upsampled(tmp_path / "scan.ply")
    made = np.stack([dense.columns[name] for name in names], axis=1)[N:]
    np.testing.assert_allclose(np.linalg.norm(made, axis=1), 1, atol=1e-6)
    true = Rotation.from_rotvec(np.outer(90 + 40 * dense.points[N:, 0], [0.0, 0.6, 0.8]), degrees=True)
    assert np.degrees((Rotation.from_quat(made) * true.inv()).magnitude()).max() < 10


def test_colours_are_whole_and_between(tmp_path):
    colours = dict(zip(("red", "green", "blue"), np.random.default_rng(5).integers(0, 256, (3, N)), strict=True))
    for kind in ("uchar", "float"):
        path = tmp_path / "scan.ply"
        rows = colours if kind == "float" else {name: column.astype(np.uint8) for name, column in colours.items()}
        write_cloud(path, Cloud(bowl(), {n: c.astype(np.float32) if kind == "float" else c for n, c in rows.items()}))
        dense = upsampled(path)
        for name, column in colours.items():
            new = dense.columns[name][N:]
            assert (new == np.rint(new)).all()
            assert column.min() <= new.min() < new.max() <= column.max()
            assert len(np.unique(new)) > 100


def under(count=200):
    """Touched points where the cloud has no points."""
    x, y = np.random.default_rng(6).uniform(-0.3, 0.3, (2, count))
    return np.column_stack([x, y, np.full(count, -1.0)])


@pytest.mark.parametrize("suffix", [".ply", ".xyz", ".txt", ".csv", ".npz", ".pcd", ".las"])
@pytest.mark.parametrize("keep", [True, False])
def test_sources_are_written_in_every_format_with_columns(tmp_path, suffix, keep):
    pytest.importorskip({".pcd": "pypcd4", ".las": "laspy"}.get(suffix, "numpy"))
    write_cloud(tmp_path / "scan.ply", Cloud(bowl()))
    write(tmp_path / "touches", [Touch.single(under(), np.eye(4), 1.0, "digit")])
    words = ["--fields", "source", "--touch", tmp_path / "touches", "--touch-as-is", *([] if keep else ["--replace"])]
    dense = upsampled(tmp_path / "scan.ply", *words, out=tmp_path / f"out{suffix}")
    source = dense.columns["source"]
    below = dense.points[:, 2] < -0.5
    assert len(source) == 4 * N
    assert (source[: N * keep] == 0).all()
    assert (source[N * keep :] > 0).all()
    assert below[source == 2].all()
    assert 10 < (source == 2).sum() < below.sum(), "some points between touched points are made"
    if suffix in (".ply", ".npz", ".pcd", ".las"):
        assert source.dtype == np.uint8
    if suffix == ".ply":
        assert b"property uchar source" in (tmp_path / "out.ply").read_bytes()


def test_touched_points_are_marked_and_unchanged():
    given = under()
    with pytest.warns(UserWarning, match="touched points lie up to"):
        dense = load("midpoint").upsample(Cloud(bowl()), [given], rate=3, fields=["source"])
    touched = dense.points[dense.columns["source"] == 2]
    known = {tuple(point) for point in given.tolist()}
    assert {tuple(point) for point in dense.points.tolist()} & known == {tuple(point) for point in touched.tolist()}
    assert (np.flatnonzero(dense.columns["source"] == 2) == N + np.arange(len(touched))).all()


def test_a_column_of_that_name_stays_and_nothing_is_added_without_a_request(tmp_path):
    write_text_ply(tmp_path / "scan.ply", bowl(), {"source": np.arange(N) % 7}, "int")
    dense = upsampled(tmp_path / "scan.ply", "--fields", "source")
    assert set(dense.columns["source"].tolist()) == set(range(7))
    assert dense.columns["source_2"].tolist() == [0] * N + [1] * (3 * N)
    assert list(upsampled(tmp_path / "scan.ply").columns) == ["source"]


def test_fields_that_cannot_be_are_told():
    model = load("midpoint")
    with pytest.raises(UserError, match="field 'sauce' is unknown: fields are source"):
        model.upsample(Cloud(bowl()), fields=["sauce"])
    with pytest.raises(UserError, match=r"field 'source' is a column, which a ndarray cannot hold: give a pcsr\."):
        model.upsample(bowl(), fields=["source"])
