"""How columns are carried, by their names, types and values."""

import re

import numpy as np
import pytest

from pcsr.clouds.column_kinds import column_kinds

N = 400
RNG = np.random.default_rng(0)
LABELS = re.findall(
    r"\w+",
    "classification classes Class label Labels semantic sem_label instance instance_id id ID ids PointID pointid ring "
    "return_number number_of_returns NumberOfReturns returnnumber gps_time GpsTime gpstime time timestamp scan_id "
    "point_source_id PointSourceId flag flags edge_of_flight_line synthetic withheld overlap key_point user_data "
    "UserData scalar_Classification scalar_Original_cloud_index Original_cloud_index confidence_class segment "
    "scalar_Return_Number cluster index label_0 class2 source mask frame beam echo scalar_GPS_Time CLASSIFICATION",
)
ANGLES = ("hue", "heading", "scalar_Hue", "yaw", "azimuth", "scan_angle", "Heading_deg", "dip direction", "rgb", "RGBA")
MEASURED = (
    *("intensity", "Intensity", "scalar_Intensity", "reflectance", "temperature", "curvature", "Curvature_mean"),
    *("reflectivity", "nir", "amplitude", "confidence", "heat", "scale_0", "opacity", "cov_1", "f_rest_7", "height"),
)


def floats(count=N):
    return RNG.random(count)


def unit(size):
    vectors = RNG.normal(size=(N, size))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize("name", [*LABELS, *ANGLES])
def test_labels_and_angles_are_taken_from_the_nearest_whatever_their_type(name):
    for column in (floats(), 1e6 * floats(), RNG.integers(0, 99, N), floats().astype(np.float32)):
        assert column_kinds({name: column}).nearest == [name]


def test_signalling_nan_is_a_missing_value_like_any_other():
    column = np.arange(N, dtype=np.float32)
    column.view(np.uint32)[3] = 0x7FA00000
    assert column_kinds({"intensity": column}).rounded == {"intensity"}  # a warning would be an error


@pytest.mark.parametrize("name", MEASURED)
def test_other_floats_are_averaged(name):
    kinds = column_kinds({name: floats()})
    assert kinds.averaged == [name]
    assert not kinds.rounded


def test_measured_whole_numbers_are_averaged_and_stay_whole():
    whole = RNG.integers(0, 65536, N)
    assert column_kinds({"intensity": (whole + 2**60).astype(np.uint64)}).rounded == {"intensity"}
    for name in ("intensity", "Reflectance", "scalar_Intensity"):
        for kind in (np.uint16, np.int32, np.float32, np.float64):
            kinds = column_kinds({name: whole.astype(kind)})
            assert kinds.averaged == [name]
            assert kinds.rounded == {name}


@pytest.mark.parametrize(
    "column",
    [
        RNG.integers(0, 1000, N).astype(np.float64),
        np.where(floats() < 0.1, np.nan, 7.0),
        RNG.choice([0.25, 0.5, 0.75, 1.0], N).astype(np.float32),
        np.full(N, 0.3),
        np.full(N, np.nan),
        RNG.integers(0, 9, N).astype(np.uint8),
        floats() < 0.5,
        RNG.integers(0, 9, (N, 2)).astype(np.float64),
    ],
)
def test_values_that_look_like_labels_are(column):
    assert column_kinds({"c3": column}).nearest == ["c3"]


@pytest.mark.parametrize("column", [floats(), floats(5), RNG.choice(floats(17), N), RNG.random((N, 2))])
def test_values_that_do_not_look_like_labels_are_averaged(column):
    assert column_kinds({"c3": column}).averaged == ["c3"]


@pytest.mark.parametrize(
    "names",
    [
        ("nx", "ny", "nz"),
        ("Nx", "Ny", "Nz"),
        ("normal_x", "normal_y", "normal_z"),
        ("NormalX", "NormalY", "NormalZ"),
        ("scalar_Nx", "scalar_Ny", "scalar_Nz"),
        ("normal[0]", "normal[1]", "normal[2]"),
        ("normals.x", "normals.y", "normals.z"),
        ("rot_0", "rot_1", "rot_2", "rot_3"),
        ("qw", "qx", "qy", "qz"),
        ("qx", "qy", "qz", "qw"),
        ("quat_x", "quat_y", "quat_z", "quat_w"),
        ("quaternion_1", "quaternion_2", "quaternion_3", "quaternion_4"),
        ("scalar_Quat_w", "scalar_Quat_x", "scalar_Quat_y", "scalar_Quat_z"),
    ],
)
def test_normals_and_quaternions_are_known_by_name(names):
    columns = {name: RNG.normal(size=N).astype(np.float32) for name in names}
    kinds = column_kinds({"heat": floats(), **columns})
    assert [set(group) for group in kinds.directions] == [set(names)]
    assert kinds.averaged == ["heat"]
    # A component that is missing, or integers, make no direction.
    assert not column_kinds({name: columns[name] for name in names[1:3]}).directions
    assert not column_kinds({name: column.astype(np.int8) for name, column in columns.items()}).directions


@pytest.mark.parametrize("names", [("dir_x", "dir_y", "dir_z"), ("ViewX", "ViewY", "ViewZ"), ("t0", "t1", "t2")])
def test_directions_are_known_by_their_length(names):
    columns = dict(zip(names, unit(3).T, strict=True))
    if not names[0].startswith("View"):  # a view is a label
        assert column_kinds(columns).directions == [list(names)]
    longer = {name: 1.1 * column for name, column in columns.items()}
    assert not column_kinds(longer).directions
    one_hot = dict(zip(names, np.eye(3)[RNG.integers(0, 3, N)].T, strict=True))
    assert column_kinds(one_hot).nearest == list(names)


def test_whole_directions_are_known_by_their_length():
    for size in (3, 4):
        assert column_kinds({"axis": unit(size)}).directions == [["axis"]]
        assert column_kinds({"axis": 2 * unit(size)}).averaged == ["axis"]
    assert column_kinds({"axis": unit(2)}).averaged == ["axis"]
    assert column_kinds({"quat": 2 * unit(4)}).directions == [["quat"]]
    assert column_kinds({"colors": unit(3)}).averaged == ["colors"]


@pytest.mark.parametrize(
    "names", [("red", "green", "blue"), ("R", "G", "B"), ("diffuse_red", "diffuse_green", "diffuse_blue")]
)
def test_colours_are_averaged_and_whole_ones_stay_whole(names):
    whole = RNG.integers(0, 256, (3, N))
    for kind, rounded in ((np.uint8, True), (np.float64, True)):
        kinds = column_kinds(dict(zip(names, whole.astype(kind), strict=True)))
        assert sorted(kinds.averaged) == sorted(names)
        assert bool(kinds.rounded) == rounded
    black_or_white = (whole > 128).astype(np.float32)
    assert not column_kinds(dict(zip(names, black_or_white, strict=True))).rounded


def test_each_column_has_one_kind():
    columns = {name: floats() for name in (*LABELS, *ANGLES, *MEASURED)}
    columns |= {f"rot_{k}": floats() for k in range(4)} | {f"n{axis}": floats() for axis in "xyz"}
    columns |= {"red": floats(), "green": floats(), "blue": floats(), "normals": unit(3)}
    kinds = column_kinds(columns)
    every = [*kinds.nearest, *kinds.averaged, *(name for group in kinds.directions for name in group)]
    assert sorted(every) == sorted(columns)
