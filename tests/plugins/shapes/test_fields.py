import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from pcsr_plugins.shapes.blobs import sdf
from pcsr_plugins.shapes.shared.draw import Draw

POSITIONS = np.random.default_rng(0).uniform(-60, 60, (400, 3))
SPHERE = sdf.ellipsoid((5, 0, 0), (20, 20, 20))
LIMB = sdf.limb([(-30, 0, 0), (10, 0, 0)], [12, 6])

points = st.tuples(*3 * [st.floats(-40, 40)])


def test_a_sphere_knows_its_distance():
    np.testing.assert_allclose(SPHERE(POSITIONS), np.linalg.norm(POSITIONS - (5, 0, 0), axis=1) - 20, atol=1e-9)
    assert SPHERE(np.array([[5.0, 0, 0]]))[0] < -10


@given(st.tuples(*3 * [st.floats(4, 40)]), st.integers(0, 2**32))
def test_an_ellipsoid_is_zero_on_its_surface_and_rises_outwards_by_one_mm_a_mm(radii, seed):
    directions = np.random.default_rng(seed).normal(size=(20, 3))
    on = directions / np.linalg.norm(directions, axis=1, keepdims=True) * radii
    normal = on / np.square(radii)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    field = sdf.ellipsoid((0, 0, 0), radii)
    np.testing.assert_allclose(field(on), 0, atol=1e-9)
    np.testing.assert_allclose(field(on + 1e-5 * normal), 1e-5, rtol=1e-3)
    np.testing.assert_allclose(field(on - 1e-5 * normal), -1e-5, rtol=1e-3)


def test_a_straight_limb_is_a_tapered_capsule():
    for place, value in zip(POSITIONS, LIMB(POSITIONS), strict=True):
        share = min(max((place[0] + 30) / 40, 0), 1)
        distance = np.linalg.norm(place - (-30 + 40 * share, 0, 0)) - (12 - 6 * share)
        assert value == pytest.approx(distance / np.hypot(1, 6 / 40), abs=1e-9)


@given(st.lists(points, min_size=3, max_size=3), st.floats(2, 6))
def test_a_bent_limb_follows_its_curve(shift, radius):
    through = np.array([(-40, 0, 0), (0, 0, 0), (40, 0, 0)]) + 0.4 * np.array(shift)
    spline, steps = CubicSpline(np.arange(3), through, bc_type="natural"), np.linspace(0, 2, 4001)
    curve, first, second = (spline(steps, order) for order in range(3))
    bend = (np.linalg.norm(first, axis=1) ** 3 / np.linalg.norm(np.cross(first, second), axis=1).clip(1e-9)).min()
    field = sdf.limb([tuple(p) for p in through], 3 * [radius])
    near = curve[::40] + np.random.default_rng(0).normal(size=(101, 3)) * radius
    naive = np.linalg.norm(near[:, None] - curve, axis=2).min(axis=1)
    # Towards the centre of a bend many points of the curve are equally near, and its pieces cut the bend a little.
    clear = naive < bend / 2
    np.testing.assert_allclose(field(near)[clear], naive[clear] - radius, atol=0.03 * radius)


def test_pieces_do_not_show_on_a_bent_limb():
    """Beside the curve the field is smooth: no jump between neighbours, where the nearest piece changes."""
    field = sdf.limb([(-40, 0, 0), (0, 20, 0), (40, 0, 0)], [6, 9, 5])
    curve = CubicSpline(np.arange(3), [(-40, 0, 0), (0, 20, 0), (40, 0, 0)], bc_type="natural")
    along = field(curve(np.linspace(0.1, 1.9, 5000)) + np.array([0, 0, 8]))
    assert np.abs(np.diff(along)).max() < 0.01


def test_a_closed_limb_around_a_circle_is_a_ring():
    turns = np.radians(np.arange(0, 360, 30))
    limb = sdf.limb([(30 * np.cos(t), 30 * np.sin(t), 0) for t in turns], 12 * [5], closed=True)
    near = POSITIONS[np.abs(np.hypot(POSITIONS[:, 0], POSITIONS[:, 1]) - 30) < 8]
    np.testing.assert_allclose(limb(near), sdf.ring((0, 0, 0), 30, 5)(near), atol=0.05)


def test_a_ring_around_another_axis_and_place():
    field = sdf.ring((1, 2, 3), 20, 4, normal=(2, 0, 0))
    on = np.array([(1, 22, 3), (1, 2, 23), (5, 22, 3), (1, 26, 3)], float)
    np.testing.assert_allclose(field(on), [-4, -4, 0, 0], atol=1e-9)


@given(st.floats(1, 20))
def test_joining_adds_only_where_both_are_near(width):
    joined, least = sdf.joined(width, SPHERE, LIMB)(POSITIONS), np.minimum(SPHERE(POSITIONS), LIMB(POSITIONS))
    apart = np.abs(SPHERE(POSITIONS) - LIMB(POSITIONS)) >= width
    np.testing.assert_allclose(joined[apart], least[apart], atol=1e-9)
    assert (joined[~apart] < least[~apart]).all()
    assert (least - joined <= width / 4 + 1e-9).all()


def test_joining_one_body_is_that_body():
    np.testing.assert_array_equal(sdf.joined(5, SPHERE)(POSITIONS), SPHERE(POSITIONS))


@given(st.floats(0.1, 5))
def test_dents_and_cuts_take_away_only(width):
    body, dent = SPHERE(POSITIONS), LIMB(POSITIONS)
    assert (sdf.dented(width, SPHERE, LIMB)(POSITIONS) >= np.maximum(body, -dent) - 1e-9).all()
    assert (sdf.common(width, SPHERE, LIMB)(POSITIONS) >= np.maximum(body, dent) - 1e-9).all()
    assert (sdf.common(width, SPHERE, LIMB)(POSITIONS) <= np.maximum(body, dent) + width / 4 + 1e-9).all()


def test_planes_and_shrinking():
    np.testing.assert_allclose(sdf.above(3)(POSITIONS), 3 - POSITIONS[:, 2])
    np.testing.assert_allclose(sdf.below(3)(POSITIONS), POSITIONS[:, 2] - 3)
    smaller = sdf.ellipsoid((5, 0, 0), (18, 18, 18))
    np.testing.assert_allclose(sdf.shrunk(SPHERE, 2)(POSITIONS), smaller(POSITIONS), atol=1e-9)


def test_a_body_is_moved_turned_twisted_and_bent_where_its_places_go():
    def at(field, place):
        return field(np.array([place], float))[0]

    value = at(LIMB, (12, 4, 7))
    assert at(sdf.moved(LIMB, (1, -2, 3)), (13, 2, 10)) == pytest.approx(value)
    assert at(sdf.turned(LIMB, 90), (-4, 12, 7)) == pytest.approx(value)
    assert at(sdf.turned(LIMB, 90, axis=0), (12, -7, 4)) == pytest.approx(value)
    assert at(sdf.turned(LIMB, 90, axis=1), (7, 4, -12)) == pytest.approx(value)
    assert at(sdf.twisted(LIMB, 90 / 7), (-4, 12, 7)) == pytest.approx(value)
    assert at(sdf.bent(LIMB, 5, 6), (12, 4, 7 + 5 * 4)) == pytest.approx(value)
    assert at(sdf.bent(LIMB, 5, 6, along=1, towards=0), (12 + 5 * 16 / 36, 4, 7)) == pytest.approx(value)


def test_lobes_are_as_many_and_as_high_as_asked_and_fade_at_the_axis():
    turns = np.radians(np.arange(360))
    field = sdf.lobed(sdf.ellipsoid((0, 0, 0), (30, 30, 30)), 5, 2, 0.01)
    around = field(np.stack([30 * np.cos(turns), 30 * np.sin(turns), 0 * turns], axis=1))
    assert np.abs(np.fft.rfft(around)).argmax() == 5
    assert (around.min(), around.max()) == pytest.approx((-2, 2), abs=1e-3)
    assert field(np.array([[0.0, 0, 30]]))[0] == pytest.approx(0)


@given(st.integers(0, 2**32), st.floats(0.1, 2), st.integers(1, 3))
def test_ripples_are_about_as_high_as_asked(seed, height, octaves):
    change = sdf.rippled(SPHERE, Draw("train", seed), height, 20, octaves)(POSITIONS) - SPHERE(POSITIONS)
    assert 0.6 * height < np.std(change) < 1.6 * height
    again = sdf.rippled(SPHERE, Draw("train", seed), height, 20, octaves)(POSITIONS) - SPHERE(POSITIONS)
    np.testing.assert_array_equal(change, again)
    other = sdf.rippled(SPHERE, Draw("test", seed), height, 20, octaves)(POSITIONS) - SPHERE(POSITIONS)
    assert not np.allclose(change, other)


@pytest.mark.parametrize("chosen", [slice(0, 1), slice(10, 200), slice(0, 0)])
def test_a_value_does_not_hang_on_its_neighbours(chosen):
    field = sdf.rippled(sdf.joined(5, LIMB, sdf.limb(POSITIONS[:4].tolist(), [5, 6, 7, 8])), Draw("train", 0), 1, 9)
    np.testing.assert_allclose(field(POSITIONS[chosen]), field(POSITIONS)[chosen], atol=1e-9)
