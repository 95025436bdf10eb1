import numpy as np
import pytest

from pcsr import PcsrWarning
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import cloud_bytes
from tests.clouds.reading import read_cloud_bytes

RNG = np.random.default_rng(0)
NAMES = ["nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "f_rest_0", "f_rest_1", "opacity"]
NAMES += ["scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]


def splats(encoding="binary_little_endian", **more):
    columns = {name: RNG.normal(size=30).astype("f4") for name in NAMES}
    columns |= {name: np.zeros(30, "f4") for name in ("nx", "ny", "nz")} | more
    points = RNG.normal(size=(30, 3)).astype("f4").astype("f8")
    return Cloud(points, columns, {"ply": {"encoding": encoding, "coordinates": "float"}})


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_splats_become_positions_and_colours(encoding):
    given = splats(encoding)
    with pytest.warns(PcsrWarning, match=r"nx, ny, nz, f_rest_\*, opacity, scale_\*, rot_\* left out$"):
        cloud = read_cloud_bytes(cloud_bytes(given, ".ply"), ".ply")
    np.testing.assert_array_equal(cloud.points.astype("f4"), given.points)
    assert list(cloud.columns) == ["red", "green", "blue"]
    for name, source in (("red", "f_dc_0"), ("green", "f_dc_1"), ("blue", "f_dc_2")):
        expected = [round(255 * min(1, max(0, 0.5 + 0.28209479177387814 * float(c)))) for c in given.columns[source]]
        assert cloud.columns[name].dtype == np.uint8
        np.testing.assert_allclose(cloud.columns[name], expected, atol=1)
    assert b"property uchar red" in cloud_bytes(cloud, ".ply")


def test_columns_and_normals_of_a_persons_own_are_kept():
    given = splats(label=np.arange(30, dtype="i4"), nz=np.ones(30, "f4"))
    with pytest.warns(PcsrWarning, match="colours were read, and f_rest_"):
        cloud = read_cloud_bytes(cloud_bytes(given, ".ply"), ".ply")
    assert set(cloud.columns) >= {"label", "nz", "red"}


def test_one_name_alone_makes_no_splats():
    given = Cloud(RNG.normal(size=(3, 3)), {"opacity": np.ones(3), "f_dc_0": np.ones(3)})
    assert list(read_cloud_bytes(cloud_bytes(given, ".ply"), ".ply").columns) == ["opacity", "f_dc_0"]
