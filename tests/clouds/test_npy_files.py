"""Files of NumPy, objects among them."""

import io
import pickle  # noqa: TID251

import numpy as np
import pytest

from pcsr import UserError
from pcsr.recorded.pickles.unpickle import load_numpy
from tests.clouds.pickles import ARRAYS, Hostile, same


def test_numbers_and_objects_are_read_from_npy(tmp_path):
    path = tmp_path / "a.npy"
    for array in ARRAYS:
        np.save(path, array)
        loaded = load_numpy(path)
        if array.shape == () and array.dtype == object:
            same(loaded, array.item())
        else:
            same(loaded, array)


def test_an_npy_file_of_python_2_is_read_without_a_warning(tmp_path):
    file = io.BytesIO()
    np.save(file, np.arange(3.0))
    (tmp_path / "a.npy").write_bytes(file.getvalue().replace(b"(3,), } ", b"(3L,), }"))
    same(load_numpy(tmp_path / "a.npy"), np.arange(3.0))


def test_a_hostile_npy_file_is_refused_and_not_run(tmp_path):
    np.save(tmp_path / "a.npy", np.array({"pos": Hostile(tmp_path / "bad")}, dtype=object))
    with pytest.raises(UserError, match="asks to run"):
        load_numpy(tmp_path / "a.npy")
    assert not (tmp_path / "bad").exists()


def npy(array, cut=None, swap=(b"", b"")):
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()[:cut].replace(*swap, 1)


@pytest.mark.parametrize(
    ("raw", "reason"),
    [
        (b"", "cannot be read as an .npy file"),
        (b"\x93NUMPY\x01\x00", "cannot be read as an .npy file"),
        (b"\x93NUMPY\x03\x00", "version"),
        (npy(np.ones(4), -1), "cut off or damaged"),
        (npy(np.ones(4)) + b"x", "cut off or damaged"),
        (npy(np.ones(4), swap=(b"(4,)", b"(9999999999999,)")), "cannot be read|cut off"),
        (npy(np.zeros(2, [("a", "f8")])), "dtype"),
        (npy(np.zeros(2, "M8[s]")), "dtype"),
        (npy(np.zeros(2, [("a", "O")])), "dtype"),
        (npy(np.array([None, 1]), swap=(b"(2,)", b"(3,)")), "is damaged"),
        (npy(np.array([None, 1]), -3), "cannot be read"),
        (npy(np.array([None]))[:128] + pickle.dumps([None]), "is damaged"),
    ],
)
def test_damaged_npy_files_are_refused(tmp_path, raw, reason):
    path = tmp_path / "a.npy"
    path.write_bytes(raw)
    with pytest.raises(UserError, match=reason) as caught:
        load_numpy(path)
    assert str(path) in str(caught.value)
