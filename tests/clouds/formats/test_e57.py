import sys

import numpy as np
import pytest

from pcsr import PcsrWarning, UserError
from pcsr.clouds.formats import read_cloud
from tests.clouds.reading import read_cloud_bytes

RNG = np.random.default_rng(0)
XYZ = RNG.normal(size=(50, 3)).astype("f4").astype("f8")
TURN, SHIFT = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)]), np.array([10.0, 20, 30])
"""A quarter turn about z, as a quaternion, and a translation."""


def test_without_pye57_the_remedy_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pye57", None)
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    with pytest.raises(UserError, match=r"E57 needs pye57, which is not installed: pip install 'pcsr\[e57\]'"):
        read_cloud_bytes(b"ASTM-E57", ".e57")


@pytest.fixture
def scanned(tmp_path):
    """Writes scans to a file, each with its rotation and translation."""
    pye57 = pytest.importorskip("pye57")

    def write(*scans):
        path = tmp_path / "scan.e57"
        path.unlink(missing_ok=True)
        with pye57.E57(str(path), mode="w") as file:
            for fields, rotation, translation in scans:
                file.write_scan_raw(fields, rotation=rotation, translation=translation)
        return path

    return write


def fields(points=XYZ, **more):
    return dict(zip(("cartesianX", "cartesianY", "cartesianZ"), points.T.copy(), strict=True)) | more


def colours(kind="u1"):
    return {f"color{name}": RNG.integers(0, 256, 50).astype(kind) for name in ("Red", "Green", "Blue")}


def test_one_scan_gives_points_colours_and_intensity(scanned):
    found = fields(intensity=RNG.random(50).astype("f4"), **colours())
    cloud = read_cloud(scanned((found, np.array([1.0, 0, 0, 0]), np.zeros(3))))
    np.testing.assert_allclose(cloud.points, XYZ, atol=1e-7)
    np.testing.assert_allclose(cloud.columns["intensity"], found["intensity"])
    for field, name in (("colorRed", "red"), ("colorGreen", "green"), ("colorBlue", "blue")):
        assert cloud.columns[name].dtype == np.uint8
        np.testing.assert_array_equal(cloud.columns[name], found[field])


def test_scans_are_put_together_in_the_frame_of_the_file(scanned):
    path = scanned((fields(), TURN, SHIFT), (fields(), np.array([1.0, 0, 0, 0]), np.zeros(3)))
    with pytest.warns(PcsrWarning, match="its 2 scans were put together in the frame of the file"):
        cloud = read_cloud(path)
    turned = np.column_stack([-XYZ[:, 1], XYZ[:, 0], XYZ[:, 2]]) + SHIFT
    np.testing.assert_allclose(cloud.points, np.concatenate([turned, XYZ]), atol=1e-6)


def test_invalid_points_are_dropped_with_their_number(scanned):
    state = (np.arange(50) % 10 == 0).astype("i1")
    path = scanned((fields(cartesianInvalidState=state, **colours()), TURN, SHIFT))
    with pytest.warns(PcsrWarning, match="5 of its 50 points are marked as invalid and were dropped"):
        cloud = read_cloud(path)
    assert len(cloud) == len(cloud.columns["red"]) == 45


def test_what_only_some_scans_have_is_left_out(scanned):
    path = scanned((fields(**colours()), TURN, SHIFT), (fields(), TURN, SHIFT))
    with pytest.warns(PcsrWarning) as said:
        cloud = read_cloud(path)
    assert cloud.columns == {}
    assert any(
        "blue, green, red were left out, since only some of its scans have them" in str(one.message) for one in said
    )


def test_ranges_and_angles_become_coordinates():
    from pcsr.clouds.formats.e57 import _from_spherical

    points = np.array([[2, 0, 0], [2, np.pi / 2, 0], [3, 0, np.pi / 2]])
    np.testing.assert_allclose(_from_spherical(points), [[2, 0, 0], [0, 2, 0], [0, 0, 3]], atol=1e-12)


def test_damage_anywhere_is_said_in_our_words(scanned):
    whole = scanned((fields(**colours()), TURN, SHIFT)).read_bytes()
    for at in range(0, len(whole), 97):
        for damaged in (whole[:at], whole[:at] + bytes([whole[at] ^ 255]) + whole[at + 1 :]):
            assert said(damaged) in ("", "it is damaged, or not all of it is there: get the file again")


def said(data):
    """The message about a file that begins like an E57, without the file's name."""
    try:
        read_cloud_bytes(b"ASTM-E57" + data[8:], ".e57")
    except UserError as error:
        return str(error).removeprefix("it: ")
    return ""
