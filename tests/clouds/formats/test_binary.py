import numpy as np
import pytest

from pcsr import PcsrWarning, UserError
from pcsr.clouds.formats import read_cloud
from tests.clouds.reading import read_cloud_bytes

RNG = np.random.default_rng(0)
ROWS = RNG.normal(size=(20, 5)).astype("<f4")
ROWS[:, 3] = RNG.uniform(0, 255, 20)
ROWS[:, 4] = np.arange(20) % 32


def test_a_scan_of_kitti_is_read(tmp_path):
    rows = ROWS[:, :4]
    (tmp_path / "000001.bin").write_bytes(rows.tobytes())
    cloud = read_cloud(tmp_path / "000001.bin", "kitti")
    np.testing.assert_array_equal(cloud.points, rows[:, :3])
    np.testing.assert_array_equal(cloud.columns["intensity"], rows[:, 3])
    assert cloud.is_single


def test_a_scan_of_nuscenes_is_read():
    cloud = read_cloud_bytes(ROWS.tobytes(), "nuscenes")
    np.testing.assert_array_equal(cloud.points, ROWS[:, :3])
    assert list(cloud.columns) == ["intensity", "ring"]
    assert cloud.columns["ring"].tolist() == [n % 32 for n in range(20)]
    assert cloud.columns["ring"].dtype == np.uint8


@pytest.mark.parametrize(("kind", "size", "other"), [("kitti", 16, "nuscenes"), ("nuscenes", 20, "kitti")])
def test_a_size_that_does_not_fit_is_refused(kind, size, other):
    for length in (1, size - 1, size + 1, 7 * size + 4):
        with pytest.raises(UserError, match=rf"its {length} bytes are no multiple of {size}, .* of {kind} .*{other}"):
            read_cloud_bytes(bytes(length), kind)


def test_one_taken_for_the_other_is_noticed():
    with pytest.warns(PcsrWarning, match="every fifth number is whole, as the ring of nuScenes"):
        read_cloud_bytes(np.abs(ROWS).tobytes(), "kitti")  # 20 points of 5 are 25 of 4
    rows = RNG.normal(size=(25, 4)).astype("<f4")
    with pytest.raises(UserError, match=r"the ring of point 0 is .*, and rings are whole numbers .*--format kitti"):
        read_cloud_bytes(rows.tobytes(), "nuscenes")
    read_cloud_bytes(np.arange(80, dtype="<f4").tobytes(), "kitti")  # all of its numbers are whole


@pytest.mark.parametrize("kind", ["kitti", "nuscenes"])
def test_numbers_that_are_none_of_a_scan_are_refused(kind):
    points = RNG.normal(size=(40, 3))
    for kind_of_number in ("<f4", "<f8", ">f4"):
        with pytest.raises(UserError, match=r"the (intensity|ring) of point \d+ is "):
            read_cloud_bytes(points.astype(kind_of_number).tobytes(), kind)
    with pytest.raises(UserError, match=r"the (intensity|ring) of point \d+ is |% of its coordinates are as "):
        read_cloud_bytes(np.abs(points).tobytes(), kind)  # doubles
    rows = np.zeros((200, 5 if kind == "nuscenes" else 4), "<f4")
    rows[:, :3] = RNG.normal(size=(200, 3))
    rows[7, 0], rows[8, 3] = 1e10, np.nan  # one stray and one missing intensity
    assert len(read_cloud_bytes(rows.tobytes(), kind)) == 200
    rows[9, 3] = -1
    with pytest.raises(UserError, match=f"the intensity of point 9 is -1, .* not of {kind}"):
        read_cloud_bytes(rows.tobytes(), kind)


def test_a_bin_without_a_format_lists_the_choices(tmp_path):
    (tmp_path / "a.BIN").write_bytes(ROWS.tobytes())
    for choice in ("--format kitti (float32 x y z intensity)", "--format nuscenes (", "--format colmap (points3D.bin)"):
        with pytest.raises(UserError) as error:
            read_cloud(tmp_path / "a.BIN")
        assert choice in str(error.value)
