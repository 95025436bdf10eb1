"""The grid of codes that distinguishes copies."""

import pytest

from pcsr_plugins.layers.grid import grid


@pytest.mark.parametrize(("copies", "columns", "rows"), [(1, 1, 1), (2, 2, 1), (4, 2, 2), (5, 1, 5), (6, 3, 2)])
def test_the_grid_is_nearly_square(copies, columns, rows):
    candidates = grid(copies)
    assert candidates.shape == (copies, 2) == (columns * rows, 2)
    assert (len(candidates[:, 0].unique()), len(candidates[:, 1].unique())) == (columns, rows)
    assert len(candidates.unique(dim=0)) == copies
    for side, length in zip(candidates.T, (columns, rows), strict=True):
        assert side.min() == pytest.approx(-0.2)
        assert side.max() == pytest.approx(0.2 if length > 1 else -0.2)
