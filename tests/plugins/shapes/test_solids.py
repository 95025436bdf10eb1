import numpy as np
import pytest
from manifold3d import CrossSection

from pcsr_plugins.shapes.cad_parts import solids
from pcsr_plugins.shapes.cad_parts.solids import (
    along_x,
    along_y,
    arc,
    box,
    chamfered,
    cylinder,
    grid_of,
    hole,
    polygon,
    rectangle,
    ring_of,
    rounded,
    swept,
    tube,
    turned,
    union,
)

ROUNDISH = 0.01  # what a polygon of many sides lacks of its circle


def test_a_rounded_rectangle_lacks_its_corners():
    fillet = 3.0
    assert rectangle(20, 10).area() == pytest.approx(200)
    assert rectangle(20, 10, fillet).area() == pytest.approx(200 - (4 - np.pi) * fillet**2, rel=ROUNDISH)
    assert rectangle(20, 10, 99).bounds() == pytest.approx((-10, -5, 10, 5), abs=0.01)


def test_rounding_takes_convex_corners_off_and_fills_concave_ones():
    ell = [(0, 0), (20, 0), (20, 5), (5, 5), (5, 20), (0, 20)]
    sharp = polygon(ell).area()
    corner = 1 - np.pi / 4
    assert polygon(ell, 2).area() == pytest.approx(sharp - 5 * corner * 4, rel=ROUNDISH)
    both = rounded(polygon(ell), 2, 3).area()
    assert both == pytest.approx(sharp - 5 * corner * 4 + corner * 9, rel=ROUNDISH)


def test_chamfers_are_cut_at_both_ends():
    # A prismatoid's volume by Simpson's rule: the two ends, and four times the middle.
    frustum = 1.0 / 6 * (100 + 4 * 81 + 64)
    assert chamfered(rectangle(10, 10), 8, 1).volume() == pytest.approx(600 + 2 * frustum)
    assert chamfered(rectangle(10, 10), 8, 0).volume() == pytest.approx(800)


def test_boxes_and_cylinders_stand_on_the_ground():
    assert box(2, 4, 6).bounding_box() == pytest.approx((-1, -2, 0, 1, 2, 6))
    assert cylinder(3, 5).bounding_box() == pytest.approx((-3, -3, 0, 3, 3, 5))
    assert cylinder(3, 5, top=1).volume() == pytest.approx(np.pi * 5 * (9 + 3 + 1) / 3, rel=ROUNDISH)
    assert tube(5, 3, 4).volume() == pytest.approx(np.pi * 16 * 4, rel=ROUNDISH)


def test_turning_upright_things_down():
    tall = box(1, 2, 9)
    assert along_x(tall).bounding_box() == pytest.approx((0, -1, -0.5, 9, 1, 0.5), abs=1e-9)
    assert along_y(tall).bounding_box() == pytest.approx((-0.5, -9, -1, 0.5, 0, 1), abs=1e-9)


def test_a_countersunk_hole_widens_at_the_top():
    plate = box(20, 20, 5)
    plain, sunk = plate - hole(2, 5), plate - hole(2, 5, 1)
    assert plain.genus() == sunk.genus() == 1
    assert plate.volume() - plain.volume() == pytest.approx(np.pi * 4 * 5, rel=ROUNDISH)
    assert plain.volume() - sunk.volume() == pytest.approx(np.pi * ((4 + 6 + 9) / 3 - 4), rel=0.03)


def test_copies_on_a_ring_and_on_a_grid():
    ring = ring_of(box(2, 2, 2), 6, 10)
    assert len(ring.decompose()) == 6
    assert ring.volume() == pytest.approx(48)
    assert ring.bounding_box()[3] == pytest.approx(11)
    assert ring_of(box(2, 2, 2), 4, 10, 90).volume() == pytest.approx(32)
    grid = grid_of(box(2, 2, 2), [(0, 0), (5, 0), (0, 7)])
    assert grid.bounding_box() == pytest.approx((-1, -1, 0, 6, 8, 2))
    assert union([box(1, 1, 1), box(1, 1, 2)]).volume() == pytest.approx(2)


@pytest.mark.parametrize("corners", [[(0, 0), (4, 0), (4, 6), (0, 6)], [(0, 6), (4, 6), (4, 0), (0, 0)]])
def test_turned_profiles_may_run_either_way_round(corners):
    assert turned(corners).volume() == pytest.approx(np.pi * 16 * 6, rel=ROUNDISH)


def test_rounding_a_turned_profile_spares_its_axis():
    rounded_off = turned([(0, 0), (4, 0), (4, 6), (0, 6)], 1)
    # A quarter circle's complement, turned about the axis (Pappus).
    lost = 2 * (1 - np.pi / 4) * 2 * np.pi * (4 - 0.223)
    assert rounded_off.volume() == pytest.approx(np.pi * 16 * 6 - lost, rel=ROUNDISH)
    assert rounded_off.genus() == 0


def test_a_swept_wire_has_the_volume_of_its_length():
    line = np.array([[0.0, 0, 0], [0, 0, 5], [0, 0, 10]])
    assert swept(line, 2, segments=64).volume() == pytest.approx(np.pi * 4 * 10, rel=ROUNDISH)
    t = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    circle = np.stack([10 * np.cos(t), 10 * np.sin(t), 0 * t], axis=1)
    torus = swept(circle, 2, closed=True, segments=64)
    assert torus.genus() == 1
    assert torus.volume() == pytest.approx(2 * np.pi**2 * 10 * 4, rel=ROUNDISH)


def test_a_swept_wire_does_not_twist():
    t = np.linspace(0, 6 * np.pi, 200)
    helix = swept(np.stack([10 * np.cos(t), 10 * np.sin(t), 2 * t], axis=1), 1.5, segments=24)
    length = float(np.hypot(10, 2) * 6 * np.pi)
    assert helix.volume() == pytest.approx(np.pi * 2.25 * length, rel=0.02)


def test_an_arc_starts_and_ends_where_it_is_told():
    points = np.array(arc(5, 0, 90, 9))
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 5)
    np.testing.assert_allclose(points[[0, -1]], [[5, 0], [0, 5]], atol=1e-12)
    assert len(points) == 9


def test_large_circles_are_fine_enough():
    assert solids.ROUND >= 48
    assert isinstance(rectangle(3, 3, 1), CrossSection)
