import numpy as np
import pytest

from pcsr import UserError
from pcsr.clouds.formats.digits import cast_column, load_rows, words


@pytest.mark.parametrize("kind", ["f2", "f4", "f8", "i8", "u8", "?"])
def test_words_are_the_shortest_that_read_back_the_same(kind):
    rng = np.random.default_rng(0)
    column = rng.integers(0, 2, 50).astype(kind) if kind == "?" else (abs(rng.normal(size=50)) * 100).astype(kind)
    again = np.array([float(word) for word in words(column)]).astype(kind)
    np.testing.assert_array_equal(again, column)
    assert words(np.array([0.1], "f4")) == ["0.1"]


def test_rows_for_other_formats():
    assert load_rows("1 2\n\n3 4\n5 6\n", 2).tolist() == [[1, 2], [3, 4]]
    assert len(load_rows("")) == 0
    with pytest.raises(UserError, match="rows of numbers cannot be read"):
        load_rows("1 2\n3\n")


def test_numbers_fit_a_type_or_are_named():
    assert cast_column(np.array([1.0, 255.0]), np.dtype("u1"), "a").tolist() == [1, 255]
    assert cast_column(np.array([0.1]), np.dtype("f4"), "a").dtype == np.float32
    for value in (256.0, -1.0, 0.5, np.nan, np.inf):
        with pytest.raises(UserError, match=rf"'a' holds .*{value}.* at point 1, which is no uint8"):
            cast_column(np.array([0, value]), np.dtype("u1"), "a")
    with pytest.raises(UserError, match="at point 0"):
        cast_column(np.array([[0, 0.5]]), np.dtype("i4"), "a")
