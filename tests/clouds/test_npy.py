"""Arrays of NumPy's format, no larger than there are bytes for."""

from io import BytesIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from pcsr import UserError
from pcsr.clouds.npy import read_array


def written(array):
    file = BytesIO()
    np.save(file, array)
    return file.getvalue()


@given(
    array=arrays.arrays(st.sampled_from(["<f4", ">f8", "i2", "?", "u1", "<U3", "c8"]), arrays.array_shapes(min_side=0))
)
def test_it_is_what_numpy_reads(array):
    for one in (array, np.asfortranarray(array)):
        data = written(one)
        made = read_array(BytesIO(data), len(data))
        assert made.shape == one.shape
        assert made.tobytes() == one.tobytes()


@pytest.mark.parametrize("cut", [0, 5, 20, 100, 200])
def test_one_that_is_cut_off_is_refused(cut):
    data = written(np.arange(30.0).reshape(10, 3))
    with pytest.raises(UserError, match=r"cut off or damaged|its beginning"):
        read_array(BytesIO(data[:cut]), cut)
