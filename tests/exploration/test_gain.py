import numpy as np
import pytest

from pcsr import TouchCandidates, UserError
from pcsr.exploration import Expectation
from pcsr.exploration.gain import CURVED, SMOOTH, Density
from pcsr.exploration.surface import KnownSurface, thin
from tests.exploration.scenes import NOTHING, TIP, ball, plane, upper


def pressed(points, axes):
    """Candidates whose sensors stand along `axes`."""
    across = np.cross(np.eye(3)[np.abs(axes).argmin(1)], axes)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    frames = np.stack([across, np.cross(axes, across), axes], axis=-1)
    return TouchCandidates(points, frames, np.ones(len(points)), TIP)


def gains(expectation, candidates):
    return np.array([expectation.gain(contact) for contact in expectation.contacts(candidates)])


POLES = np.array([[0, 0, 15.0], [0, 0, -15.0], [15.0, 0, 0]])


def test_the_hidden_side_gains_most():
    whole = ball(seed=1)
    expectation = Expectation.of(whole, upper(ball()), NOTHING)
    top, bottom, side = gains(expectation, pressed(POLES, POLES / 15))
    assert bottom > 10 * max(top, side)
    assert min(top, side) >= 0


def test_a_touch_lowers_the_error_and_what_is_left_to_gain():
    whole, seen = ball(seed=1), upper(ball())
    touched = ball(6000, seed=2)
    touched = touched[touched[:, 2] < -13.5]
    before, after = (Expectation.of(whole, seen, points) for points in (NOTHING, touched))
    assert after.error() < before.error()
    candidates = pressed(POLES, POLES / 15)
    assert gains(after, candidates)[1] < 0.2 * gains(before, candidates)[1]


def test_a_gain_is_in_square_millimetres():
    whole, seen = ball(seed=1), upper(ball())
    small = gains(Expectation.of(whole, seen, NOTHING), pressed(POLES, POLES / 15))
    errors = [Expectation.of(factor * whole, factor * seen, NOTHING).error() for factor in (1, 2)]
    assert errors[1] == pytest.approx(4 * errors[0], rel=1e-6)
    assert small[1] < errors[0]


def test_edges_gain_more_than_planes():
    flat = plane(900, side=40)
    bent = np.where(flat[:, :1] > 0, np.column_stack([0 * flat[:, 0], flat[:, 1], -flat[:, 0]]), flat)
    near, far = (Density.at(np.array([[x, 0.0, 0.0]]), KnownSurface.of(bent, NOTHING)) for x in (-0.2, -12.0))
    assert far.share == pytest.approx(SMOOTH)  # the normals do not vary
    assert near.share > SMOOTH + 0.1 * CURVED
    assert (near.seen() / near.squared > 1.3 * far.seen() / far.squared).all()


def test_the_area_of_a_ball_is_found():
    assert KnownSurface.of(ball(2000), NOTHING).area == pytest.approx(4 * np.pi * 15**2, rel=0.15)


@pytest.mark.parametrize("cell", [0.5, 2.0])
def test_thinning_leaves_a_point_in_each_cell(cell):
    points = ball(300)
    kept = thin(points, cell)
    cells = np.floor((points - points.min(0)) / cell)
    assert len(kept) == len(np.unique(cells, axis=0))
    assert {tuple(row) for row in kept} <= {tuple(row) for row in points}
    assert len(thin(NOTHING, cell)) == 0


def test_a_cloud_of_a_single_spot_is_refused():
    with pytest.raises(UserError, match="has 1 distinct points"):
        KnownSurface.of(np.zeros((50, 3)), NOTHING)
