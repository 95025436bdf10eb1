import sys
from io import BytesIO

import numpy as np
import pytest

from pcsr import PcsrWarning, UserError
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import cloud_bytes, writable
from tests.clouds.reading import read_cloud_bytes

POINTS = np.array(
    [[4_512_345.678, 5_398_765.432, 312.001], [4_512_349.12, 5_398_760.0, -7.5], [4_512_347.0, 5_398_761.5, 0]]
)


def test_without_laspy_the_remedy_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "laspy", None)
    for use in (
        lambda: read_cloud_bytes(b"LASF", ".las"),
        lambda: cloud_bytes(Cloud(POINTS), ".laz"),
        lambda: writable(tmp_path / "a.las"),
    ):
        with pytest.raises(UserError, match=r"LAS needs laspy, which is not installed: pip install 'pcsr\[las\]'"):
            use()


@pytest.fixture
def laspy():
    return pytest.importorskip("laspy")


def scan(laspy, point_format=7):
    """What a scanner wrote, with two dimensions of its own."""
    header = laspy.LasHeader(point_format=point_format, version="1.4" if point_format > 5 else "1.2")
    header.offsets, header.scales = [4_512_000, 5_398_000, 0], [0.001, 0.001, 0.0005]
    header.add_extra_dims(
        [
            laspy.ExtraBytesParams("height", "f4"),
            laspy.ExtraBytesParams("wave", "3u1"),
            laspy.ExtraBytesParams("scaled", "i4", scales=np.array([0.01]), offsets=np.array([5.0])),
        ]
    )
    header.vlrs.append(laspy.VLR("pcsr test", 7, "of no meaning", b"kept"))
    las = laspy.LasData(header)
    las.x, las.y, las.z = POINTS.T
    las.intensity, las.classification = [1, 2, 65535], [0, 2, 31]
    las.return_number, las.number_of_returns = [1, 2, 3], [3, 3, 3]
    las.gps_time = [0.1, 0.2, 3e8]
    las.red, las.green, las.blue = [0, 1, 65535], [2, 3, 4], [5, 6, 7]
    las.height, las.wave, las.scaled = [0.1, np.nan, 3], [[1, 2, 3], [4, 5, 6], [7, 8, 9]], [5.01, 4.99, 7]
    file = BytesIO()
    las.write(file, do_compress=False)
    return file.getvalue()


def read(data):
    return read_cloud_bytes(data, ".las")


@pytest.mark.parametrize("point_format", [3, 7])
def test_every_dimension_and_the_header_come_back(laspy, point_format):
    data = scan(laspy, point_format)
    cloud = read(data)
    np.testing.assert_allclose(cloud.points, POINTS, rtol=0, atol=1e-9)
    assert cloud.columns["red"].dtype == cloud.columns["intensity"].dtype == np.uint16
    assert cloud.columns["return_number"].tolist() == [1, 2, 3]
    assert cloud.columns["height"].dtype == np.float32
    assert cloud.columns["wave"].tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    np.testing.assert_allclose(cloud.columns["scaled"], [5.01, 4.99, 7])
    out = cloud_bytes(cloud, ".las")
    again, header = read(out), laspy.read(BytesIO(out)).header
    assert again.points.tobytes() == cloud.points.tobytes()
    assert list(again.columns) == list(cloud.columns)
    for name, column in cloud.columns.items():
        assert again.columns[name].dtype == column.dtype
        np.testing.assert_array_equal(again.columns[name], column)
    assert header.scales.tolist() == [0.001, 0.001, 0.0005]
    assert header.offsets.tolist() == [4_512_000, 5_398_000, 0]
    assert header.point_format.id == point_format
    assert [vlr.record_data for vlr in header.vlrs if vlr.user_id == "pcsr test"] == [b"kept"]


def test_new_points_are_written_beside_the_old(laspy):
    cloud = read(scan(laspy))
    dense = cloud.with_new(cloud.points[:2] + 0.01)
    again = read(cloud_bytes(dense, ".las"))
    np.testing.assert_allclose(again.points, dense.points, rtol=0, atol=0.0005)
    assert again.columns["classification"].tolist() == [0, 2, 31, 0, 2]
    assert len(read(cloud_bytes(cloud, ".las"))) == 3  # the header that was read is not changed by writing
    some = read(cloud_bytes(cloud.chosen(np.array([2])), ".las"))
    assert some.columns["intensity"].tolist() == [65535]


def test_columns_that_were_taken_away_are_not_written(laspy):
    cloud = read(scan(laspy))
    columns = {name: column for name, column in cloud.columns.items() if name not in ("height", "intensity")}
    again = read(cloud_bytes(Cloud(cloud.points, columns, cloud.about), ".las"))
    assert "height" not in again.columns
    assert again.columns["intensity"].tolist() == [0, 0, 0]


def test_a_cloud_from_elsewhere_gets_a_scale_that_fits_it(laspy):
    for points in (POINTS, POINTS * 1e-6, POINTS - 1e9, POINTS[:1]):
        again = read(cloud_bytes(Cloud(points), ".las"))
        extent = max(np.ptp(points, axis=0).max(), 1)
        np.testing.assert_allclose(again.points, points, rtol=0, atol=1e-8 * extent)


@pytest.mark.parametrize(
    ("colours", "expected"),
    [
        (np.array([[0, 128, 255]] * 3, np.uint8), [0, 32896, 65535]),
        (np.array([[0, 128, 255]] * 3, np.uint16), [0, 128, 255]),
        (np.array([[0, 0.5, 1]] * 3), [0, 32768, 65535]),
    ],
)
def test_colours_take_sixteen_bits(laspy, colours, expected):
    for columns in ({"colors": colours}, dict(zip(("red", "green", "blue"), colours.T, strict=True))):
        again = read(cloud_bytes(Cloud(POINTS, columns), ".las")).columns
        assert [again[name][0] for name in ("red", "green", "blue")] == expected
        assert again["red"].dtype == np.uint16
        assert "red_2" not in again


def test_columns_take_the_dimension_of_their_name_if_it_holds_them(laspy):
    columns = {
        "intensity": np.array([1.0, 2, 3]),
        "classification": np.array([1, 2, 300]),
        "return_number": np.array([1, 2, 15]),
        "user_data": np.array([0.5, 1, 2]),
        "label": np.array([-1, 2, 2**40]),
        "on": np.array([True, False, True]),
        "weights": np.array([[0.5, 1], [2, 3], [4, 5]], np.float16),
        "red": np.array([-1, 0, 1]),
    }
    again = read(cloud_bytes(Cloud(POINTS, columns), ".las")).columns
    for name, kind, values in [
        ("intensity", "u2", [1, 2, 3]),
        ("classification", "u1", [0, 0, 0]),
        ("classification_2", "i8", [1, 2, 300]),
        ("return_number", "u1", [1, 2, 15]),
        ("user_data_2", "f8", [0.5, 1, 2]),
        ("label", "i8", [-1, 2, 2**40]),
        ("on", "u1", [1, 0, 1]),
        ("weights_1", "f4", [1, 3, 5]),
        ("red", "i8", [-1, 0, 1]),
    ]:
        assert (again[name].dtype.str[1:], again[name].tolist()) == (kind, values), name


def test_what_las_cannot_hold_is_named(laspy):
    cloud = read(scan(laspy))
    with pytest.raises(UserError, match=r"beyond what the scales \[.*0\.001.*\] and offsets .* allow: write a \.ply"):
        cloud_bytes(Cloud(cloud.points + 1e9, {}, cloud.about), ".las")
    with pytest.raises(UserError, match="longer than the 32 bytes"):
        cloud_bytes(Cloud(POINTS, {"n" * 33: np.zeros(3)}), ".las")


def test_a_file_that_is_cut_off_is_refused(laspy):
    whole = cloud_bytes(Cloud(POINTS, {"label": np.arange(3)}), ".las")
    for length in range(len(whole)):
        with pytest.raises(UserError):
            read(whole[:length])


@pytest.mark.parametrize("at", [100, 243])
def test_a_header_that_claims_billions_of_records_is_refused_at_once(laspy, at):
    data = bytearray(scan(laspy))
    data[at : at + 4] = b"\xff" * 4
    with pytest.raises(UserError, match="claims more records than the file has room for"):
        read(bytes(data))


@pytest.mark.parametrize(("point_format", "at"), [(3, 107), (7, 247)])
def test_a_header_that_claims_billions_of_points_is_refused_at_once(laspy, point_format, at):
    data = bytearray(scan(laspy, point_format))
    data[at : at + 4] = b"\xff" * 4
    with pytest.raises(UserError, match="cut off: 3 of its 4294967295 points are there"):
        read(bytes(data))


def test_laz_holds_the_same_or_names_the_remedy(laspy, tmp_path):
    if laspy.LazBackend.detect_available():
        writable(tmp_path / "a.laz")
        cloud = read(scan(laspy))
        again = read_cloud_bytes(cloud_bytes(cloud, ".laz"), ".laz")
        assert again.points.tobytes() == cloud.points.tobytes()
        assert list(again.columns) == list(cloud.columns)
    else:
        for use in (lambda: writable(tmp_path / "a.laz"), lambda: cloud_bytes(Cloud(POINTS), ".laz")):
            with pytest.raises(UserError, match=r"pip install 'pcsr\[las\]'"):
                use()


def copc(laspy):
    """A LAZ with the records of a COPC, as far as a reader of LAZ sees them."""
    cloud = read(scan(laspy))
    header = cloud.about["las"]["header"]
    header.vlrs.insert(0, laspy.VLR("copc", 1, "copc info", bytes(160)))
    header.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("copc", 1000, "copc hierarchy", bytes(64))])
    header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "wkt", b"LOCAL_CS[]"))
    las = laspy.LasData(header, laspy.ScaleAwarePointRecord.zeros(len(cloud), header=header))
    las.x, las.y, las.z = cloud.points.T
    file = BytesIO()
    las.write(file, do_compress=True)
    return file.getvalue()


def test_a_copc_is_read_and_written_as_plain_laz(laspy, tmp_path):
    with pytest.warns(PcsrWarning, match=r"it is a COPC: the octree in 2 of its records was left out"):
        cloud = read_cloud_bytes(copc(laspy), ".laz")
    writable(tmp_path / "out.laz", cloud)
    out = cloud_bytes(cloud, ".laz")
    header = laspy.read(BytesIO(out)).header
    assert b"copc" not in out
    assert "LASF_Projection" in {record.user_id for record in header.vlrs}
    np.testing.assert_allclose(read_cloud_bytes(out, ".laz").points, POINTS, atol=0.001)
    with pytest.raises(UserError, match=r"COPC cannot be written: name a plain LAZ file, out\.laz"):
        writable(tmp_path / "out.copc.laz")


@pytest.mark.parametrize("size", [1e-3, 1e-9, 1e-30, 1e-200, 1, 1e9])
def test_small_clouds_keep_their_shape(laspy, size):
    points = np.random.default_rng(0).random((20, 3)) * size
    for shift in (0, 0.3 if size == 1e-9 else 0):
        moved = points + shift
        again = read(cloud_bytes(Cloud(moved), ".las")).points
        np.testing.assert_allclose(again - shift, moved - shift, rtol=0, atol=1e-8 * np.ptp(moved, axis=0).max())


def test_a_cloud_that_is_too_small_is_refused(laspy):
    with pytest.raises(UserError, match=r"the cloud is only 9.9\d*e-301 across, too small for the scales of LAS"):
        cloud_bytes(Cloud(np.random.default_rng(0).random((20, 3)) * 1e-300), ".las")


@pytest.mark.parametrize("scale", [0.0, 1e-300, np.nan, np.inf])
def test_scales_that_give_no_coordinates_are_refused(laspy, scale):
    data = bytearray(scan(laspy))
    data[139:147] = np.float64(scale).tobytes()
    with pytest.raises(UserError, match=r"its header has the scales .* by which no coordinates can be computed"):
        read(bytes(data))


def test_whether_the_columns_fit_is_known_before_the_work(laspy, tmp_path):
    for suffix, name, kind, reason in (
        (".las", "n" * 40, "f4", "longer than the 32 bytes"),
        (".ply", "id", "i8", "no integers as large"),
        (".npy", "id", "i8", "can't hold the large integers"),
        (".obj", "label", "f4", "not the columns label"),
        (".npz", "points", "f4", "rename the column"),
    ):
        cloud = Cloud(POINTS, {name: np.full(3, 2**60 + 1 if kind == "i8" else 1).astype(kind)})
        with pytest.raises(UserError, match=rf"out\{suffix}: .*{reason}"):
            writable(tmp_path / f"out{suffix}", cloud)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("length", [227, 240, 300, 374])
def test_a_header_that_is_cut_off_is_refused(length):
    data = cloud_bytes(Cloud(np.random.default_rng(0).normal(size=(9, 3))), ".las")
    assert int.from_bytes(data[94:96], "little") == 375
    with pytest.raises(UserError, match="it is cut off in its header"):
        read_cloud_bytes(data[:length], ".las")
