"""A cloud is upsampled in parts as in memory, whatever its format and columns, and the seams do not show."""

import warnings

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pcsr import PcsrWarning, UserError, expected_errors
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import read_cloud, write_cloud
from pcsr.streaming.tiles import TileTree, depth_for
from pcsr.upsample import densify
from tests.streaming.clouds import SMALL, TILE, sheet, stream


@pytest.mark.parametrize("made", [".ply", ".npy", ".las", ".laz"])
@pytest.mark.parametrize("given", [".ply", ".npy", ".las", ".laz"])
def test_old_points_and_columns_come_first_and_unchanged(tmp_path, given, made):
    write_cloud(tmp_path / f"in{given}", sheet(600))
    stream(tmp_path / f"in{given}", tmp_path / f"out{made}", rate=2)
    whole, dense = read_cloud(tmp_path / f"in{given}"), read_cloud(tmp_path / f"out{made}")
    assert len(dense) == 1200
    write_cloud(tmp_path / f"whole{made}", whole)
    old = read_cloud(tmp_path / f"whole{made}")
    assert list(dense.columns) == list(old.columns)
    np.testing.assert_allclose(dense.points[:600], old.points, rtol=0, atol=1e-6)
    for name, column in old.columns.items():
        np.testing.assert_array_equal(dense.columns[name][:600], column)
        assert dense.columns[name].dtype == column.dtype
    assert not (tmp_path / f"out{made}.parts").exists()


def test_new_points_get_columns_as_in_memory(scan, tmp_path):
    stream(scan, tmp_path / "out.ply")
    dense, given = read_cloud(tmp_path / "out.ply"), read_cloud(scan)
    new = dense.chosen(np.arange(len(given), len(dense)))
    expected = given.with_new(new.points, keep=False)
    for name, column in expected.columns.items():
        same = np.isclose(new.columns[name], column, atol=1e-5)
        assert same.mean() > 0.995, name  # beyond a margin there may be a nearer point
    assert set(np.unique(new.columns["label"])) == {3, 7}


def test_seams_show_no_gap_no_copy_and_no_change_of_density(tmp_path):
    xy = np.random.default_rng(1).uniform(0, 10, (2400, 2))
    points = np.column_stack([xy, 0.1 * np.sin(xy[:, 0])])
    write_cloud(tmp_path / "in.npy", Cloud(points))
    stream(tmp_path / "in.npy", tmp_path / "out.npy", rate=4)
    streamed = read_cloud(tmp_path / "out.npy").points
    whole = np.concatenate([points, densify(points, 9600, SMALL).points])
    tree = TileTree.of(points, depth_for(len(points), TILE))
    assert len(tree.axes) == 7

    def at_seams(cloud):
        steps = 0.3 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
        return np.any([tree.tiles(cloud + step) != tree.tiles(cloud) for step in steps], axis=0)

    seam, same = streamed[at_seams(streamed)], whole[at_seams(whole)]
    assert 0.2 < len(seam) / len(streamed) < 0.6
    assert len(seam) / len(same) == pytest.approx(1, abs=0.03)
    apart = [cKDTree(cloud).query(near, k=2)[0][:, 1] for cloud, near in ((streamed, seam), (whole, same))]
    np.testing.assert_allclose(*[np.quantile(each, [0.1, 0.5, 0.9]) for each in apart], rtol=0.08)
    copies = [(each < 0.005).mean() for each in apart]  # of two patches that chose the same midpoint
    assert copies[0] < copies[1] + 0.005
    probes = np.random.default_rng(2).uniform(0.5, 9.5, (20_000, 2))
    probes = np.column_stack([probes, 0.1 * np.sin(probes[:, 0])])
    probes = probes[at_seams(probes)]
    gaps = [cKDTree(cloud).query(probes)[0] for cloud in (streamed, whole)]
    np.testing.assert_allclose(*[np.quantile(each, [0.5, 0.99]) for each in gaps], rtol=0.12)
    assert gaps[0].max() < 1.25 * gaps[1].max()


@pytest.mark.parametrize(("options", "count"), [({"rate": 1.5}, 2250), ({"rate": 9}, 13_500), ({"count": 4001}, 4001)])
def test_as_many_points_come_out_as_were_asked_for(scan, tmp_path, options, count):
    stream(scan, tmp_path / "out.ply", **options)
    assert len(read_cloud(tmp_path / "out.ply")) == count


def test_new_points_alone_and_their_source(scan, tmp_path):
    stream(scan, tmp_path / "new.ply", rate=2, keep=False)
    assert len(read_cloud(tmp_path / "new.ply")) == 3000
    stream(scan, tmp_path / "out.ply", rate=2, fields=["source"])
    source = read_cloud(tmp_path / "out.ply").columns["source"]
    np.testing.assert_array_equal(source, np.repeat([0, 1], 1500))


@pytest.mark.parametrize("keep", [True, False])
def test_errors_are_those_of_a_cloud_in_memory_but_for_seams(scan, tmp_path, keep):
    stream(scan, tmp_path / "plain.ply", rate=2, keep=keep)
    stream(scan, tmp_path / "out.ply", rate=2, keep=keep, fields=["error"])
    plain, dense = read_cloud(tmp_path / "plain.ply"), read_cloud(tmp_path / "out.ply")
    np.testing.assert_array_equal(dense.points, plain.points)
    errors = dense.columns["error"]
    old = 1500 if keep else 0
    assert (errors[:old] == 0).all()
    known = read_cloud(scan).points
    ratio = errors[old:] / expected_errors(known, dense.points[old:])
    assert np.quantile(np.abs(np.log(ratio)), 0.7) < 0.2
    assert not (tmp_path / "out.ply.parts").exists()


def test_errors_of_given_points_are_in_their_order_and_unknown_for_those_that_are_not_used(tmp_path):
    cloud = sheet(3000)
    points = cloud.points.copy()
    high = points[:, 0] > np.median(points[:, 0])
    points[high, 2] += 0.1 * np.random.default_rng(0).normal(size=high.sum())
    points[700] = np.nan
    write_cloud(tmp_path / "in.ply", Cloud(points, cloud.columns), bad="keep")
    with pytest.warns(PcsrWarning, match="not finite"):
        stream(tmp_path / "in.ply", tmp_path / "out.ply", rate=2, bad="keep", fields=["source", "error"])
    errors = read_cloud(tmp_path / "out.ply", bad="keep").columns["error"][:3000]
    assert np.flatnonzero(np.isnan(errors)).tolist() == [700]
    far = points[:, 0] > np.quantile(points[~np.isnan(points[:, 0]), 0], 0.8)
    assert np.median(errors[far]) > 0.05
    assert len(np.unique(errors[~np.isnan(errors)])) > 1, "each tile has its own noise"


@pytest.mark.parametrize("bad", ["refuse", "drop", "keep"])
def test_faulty_points_are_treated_as_in_memory(tmp_path, bad):
    cloud = sheet()
    points = cloud.points.copy()
    points[3, 2], points[700] = np.nan, [9e7, 0, 0]
    points[900:905] = points[10]
    write_cloud(tmp_path / "in.ply", Cloud(points, cloud.columns), bad="keep")
    if bad == "refuse":
        with pytest.raises(
            UserError, match=r"1 of 1500 points has a coordinate that is not finite, such as point 3, .*"
        ):
            stream(tmp_path / "in.ply", tmp_path / "out.ply", bad=bad)
        assert not (tmp_path / "out.ply").exists()
        return
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always", PcsrWarning)
        stream(tmp_path / "in.ply", tmp_path / "out.ply", rate=2, bad=bad)
    said = " ".join(str(one.message) for one in warned)
    for part in ("not finite", "far away from all others, such as point 700", "5 of 1500 points are copies of others"):
        assert part in said
    dense = read_cloud(tmp_path / "out.ply", bad="keep")
    old = 1493 if bad == "drop" else 1500
    assert len(dense) == old + 1493
    np.testing.assert_array_equal(
        dense.points[:old], np.delete(points, [3, 700, *range(900, 905)], 0) if bad == "drop" else points
    )
    assert np.isfinite(dense.points[old:]).all()
    assert np.abs(dense.points[old:, 2]).max() < 2


def test_touches_at_a_seam_fill_a_hole_and_are_marked(tmp_path):
    cloud = sheet(2000)
    local = cloud.points[:, :2] - [500_000, 5_400_000]
    tree = TileTree.of(cloud.points, depth_for(1700, TILE))
    middle = np.array([tree.at[0] - 500_000, 5.0]) if tree.axes[0] == 0 else np.array([5.0, tree.at[0] - 5_400_000])
    hole = np.abs(local - middle).max(1) < 1.2
    write_cloud(tmp_path / "in.ply", cloud.chosen(~hole))
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 40)] * 2), -1).reshape(-1, 2) + middle
    touch = np.column_stack([grid + np.array([500_000, 5_400_000]), np.sin(grid[:, 0])])
    with pytest.warns(PcsrWarning, match=r"touched points lie up to .* from the cloud and are added to it"):
        stream(tmp_path / "in.ply", tmp_path / "out.ply", touches=[touch], fields=["source"])
    dense = read_cloud(tmp_path / "out.ply")
    touched = dense.points[dense.columns["source"] == 2]
    assert len(touched) > 20
    assert cKDTree(touch).query(touched)[0].max() < 1e-9
    assert cKDTree(dense.points).query(touch)[0].max() < 0.35  # the spacing of the cloud is 0.11
    between = cKDTree(touched).query(touched, k=2)[0][:, 1]
    assert between.min() > 0.1  # thinned across the seam too


@pytest.mark.parametrize(
    ("source", "target", "message"),
    [
        ("scan.xyz", "out.ply", r"a \.xyz file cannot be read in parts: convert it"),
        ("scan.ply", "out.xyz", r"a \.xyz file cannot be written in parts: name a \.ply, \.npy, \.las, \.laz file"),
        ("scan.ply", "scan.ply", "is the cloud itself"),
        ("none.ply", "out.ply", "cannot be read: No such file"),
    ],
)
def test_what_cannot_be_done_in_parts_is_refused(scan, tmp_path, source, target, message):
    write_cloud(tmp_path / "scan.xyz", sheet(50))
    with pytest.raises(UserError, match=message):
        stream(tmp_path / source, tmp_path / target)


def test_too_few_points_are_asked_for(scan, tmp_path):
    with pytest.raises(UserError, match="1000 points are fewer than the 1500 of the cloud"):
        stream(scan, tmp_path / "out.ply", count=1000)
