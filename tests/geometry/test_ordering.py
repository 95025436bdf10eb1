import itertools

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pcsr.geometry import ordering
from pcsr.geometry.ordering import along, back, hilbert_order


def test_the_curve_visits_each_cell_once_and_steps_to_a_neighbour(monkeypatch):
    monkeypatch.setattr(ordering, "BITS", 3)
    cells = torch.tensor(list(itertools.product(range(8), repeat=3)), dtype=torch.float32)
    walk = cells[hilbert_order(cells)]
    assert len({tuple(c) for c in walk.tolist()}) == 512
    assert (walk[1:] - walk[:-1]).abs().sum(1).eq(1).all(), "consecutive cells share a face"


def skilling(cells: torch.Tensor) -> torch.Tensor:
    """The position on the curve by the loops over bits of Skilling's paper."""
    x = list(cells.unbind(-1))
    bits = range(ordering.BITS - 1, 0, -1)
    for bit in bits:  # undo the rotations that the curve makes on its way down
        low = (1 << bit) - 1
        for i in range(3):
            is_set = x[i] >> bit & 1 == 1
            swap = torch.where(is_set, 0, (x[0] ^ x[i]) & low)
            x[i] = x[i] ^ swap
            x[0] = torch.where(is_set, x[0] ^ low, x[0] ^ swap)
    x[1] = x[1] ^ x[0]  # Gray code
    x[2] = x[2] ^ x[1]
    turn = torch.zeros_like(x[0])
    for bit in bits:
        turn = torch.where(x[2] >> bit & 1 == 1, turn ^ ((1 << bit) - 1), turn)
    code = torch.zeros_like(turn)
    for bit in range(ordering.BITS - 1, -1, -1):
        for axis in x:
            code = code << 1 | (axis ^ turn) >> bit & 1
    return code


def test_the_table_is_skillings_transposition():
    coarse = torch.tensor(list(itertools.product(range(16), repeat=3)))
    fine = torch.randint(0, 2**ordering.BITS, (2, 5_000, 3), generator=torch.Generator().manual_seed(0))
    for cells in (coarse, coarse << (ordering.BITS - 4), fine):
        assert torch.equal(ordering._hilbert_code(cells), skilling(cells))


@given(st.integers(0, 2**31), st.integers(1, 40))
def test_the_order_is_a_function_of_the_set(seed, n):
    generator = torch.Generator().manual_seed(seed)
    points = torch.randn(n, 3, generator=generator).round(decimals=1)  # rounding makes ties and duplicates
    shuffled = points[torch.randperm(n, generator=generator)]
    assert torch.equal(points[hilbert_order(points)], shuffled[hilbert_order(shuffled)])


def test_points_on_one_spot_are_ordered_too():
    assert hilbert_order(torch.ones(5, 3)).tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("b", [1, 3])
def test_back_undoes_along(b):
    points, features = torch.randn(b, 17, 3), torch.randn(b, 17, 4)
    order = hilbert_order(points)
    assert torch.equal(back(order, along(order, features)), features)
