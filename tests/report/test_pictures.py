import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pcsr.report import pictures
from pcsr.report.lettering import rgb
from pcsr.report.pictures import (
    DARKER,
    FADE,
    RIM,
    TILT,
    TURN,
    Camera,
    Layer,
    camera,
    disc_radius,
    error_colours,
    picture,
)  # fmt: skip
from pcsr.report.views import COLOURS

RED, BLUE = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
FRONT = Camera(np.eye(3), np.zeros(3), 1.0)


def dots(*places, colour=RED, radius=6.0):
    """Discs whose colour doesn't fade."""
    cloud = np.array(places, dtype=float)
    return Layer(cloud, np.tile(colour, (len(cloud), 1)), radius)


def lopsided(seed):
    """A cloud whose three axes are of different lengths and whose ends are unlike."""
    rng = np.random.default_rng(seed)
    return rng.exponential(size=(300, 3)) * (3, 2, 1)


def is_colour(image, colour):
    return (np.abs(image.astype(int) - 255 * np.asarray(colour)) <= 1).all(-1)


def slow_picture(view, layers, size):
    """One point after the other into a picture without finer pixels: what is nearest at each pixel's middle."""
    image, depth = np.full((size, size, 3), 255.0), np.full((size, size), -np.inf)
    for layer in layers:
        for point, colour in zip(layer.points, np.broadcast_to(layer.colours, layer.points.shape), strict=True):
            x, y, z = view.axes @ (point - view.centre) / view.half
            row, column = (1 - y) * size / 2, (1 + x) * size / 2
            for i in range(size):
                for j in range(size):
                    away = np.hypot(i + 0.5 - row, j + 0.5 - column)
                    if away <= layer.radius and z > depth[i, j]:
                        depth[i, j] = z
                        image[i, j] = 255 * colour * (DARKER if away > RIM * layer.radius else 1)
    return image


def test_discs_are_those_of_the_slow_drawing(monkeypatch):
    monkeypatch.setattr(pictures, "FINE", 1)
    monkeypatch.setattr(pictures, "AT_ONCE", 7)
    rng = np.random.default_rng(3)
    layers = [Layer(rng.uniform(-1.1, 1.1, (20, 3)), rng.uniform(0, 1, (20, 3)), radius) for radius in (2.0, 3.7)]
    np.testing.assert_allclose(picture(FRONT, layers, 40), slow_picture(FRONT, layers, 40), atol=0.51)


def test_a_picture_has_its_size_and_is_white_beside_the_points():
    image = picture(FRONT, [dots((0, 0, 0))], 80)
    assert (image.shape, image.dtype) == ((80, 80, 3), np.uint8)
    away = np.hypot(*(np.indices((80, 80)) - 39.5))
    assert is_colour(image, RED)[away < RIM * 6 - 1].all()
    assert (image[away > 7] == 255).all()


def test_up_is_up_and_right_is_right():
    image = picture(FRONT, [dots((0.5, 0, 0)), dots((0, 0.5, 0), colour=BLUE)], 80)
    assert is_colour(image, RED)[40, 60]
    assert is_colour(image, BLUE)[20, 40]


@pytest.mark.parametrize("swapped", [False, True])
def test_a_point_in_front_hides_one_behind(swapped):
    behind, before = dots((0, 0, -0.5), radius=9.0), dots((0, 0, 0.5), colour=BLUE, radius=5.0)
    image = picture(FRONT, [before, behind] if swapped else [behind, before], 80)
    assert is_colour(image, BLUE)[40, 40]
    assert is_colour(image, RED)[40, 46], "and what it doesn't hide is seen"
    one_layer = Layer(np.array([[0, 0, 0.5], [0, 0, -0.5]]), np.stack([BLUE, RED]), 5.0)
    assert not is_colour(picture(FRONT, [one_layer], 80), RED).any()


def test_points_out_of_the_window_or_its_depth_are_not_drawn():
    outside = dots((3, 0, 0), (0, -3, 0))
    assert (picture(FRONT, [outside], 40) == 255).all()
    deep = dots((0, 0, 0.9), (0, 0, -0.9))
    assert (picture(FRONT, [deep], 40) != 255).any()
    assert (picture(FRONT.closer(np.zeros(3), 0.5), [deep], 40) == 255).all()


def test_a_closer_view_shows_the_place_in_its_middle_and_larger():
    close = FRONT.closer(np.array([0.5, 0.5, 0.0]), 0.25)
    image = picture(close, [dots((0.5, 0.5, 0)), dots((0.6, 0.5, 0), colour=BLUE)], 80)
    assert is_colour(image, RED)[40, 40]
    assert is_colour(image, BLUE)[40, 56]


def test_one_colour_pales_with_depth_and_errors_do_not():
    cloud = np.array([[-0.5, 0, 1.0], [0.5, 0, -1.0]])
    near, far = picture(FRONT, [Layer(cloud, BLUE, 6.0)], 80)[40, [20, 60]]
    np.testing.assert_allclose(near, (0, 0, 255), atol=1)
    np.testing.assert_allclose(far, (255 * FADE, 255 * FADE, 255), atol=1)
    near, far = picture(FRONT, [dots(*cloud, colour=BLUE)], 80)[40, [20, 60]]
    np.testing.assert_array_equal(near, far)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.01, 100))
def test_the_view_follows_the_cloud(seed, scale):
    cloud = lopsided(seed % 50)
    turn = Rotation.random(random_state=seed).as_matrix()
    moved = scale * cloud @ turn.T + np.random.default_rng(seed).normal(size=3)
    here, there = camera(cloud), camera(moved)
    np.testing.assert_allclose(there.seen(moved) / there.half, here.seen(cloud) / here.half, atol=1e-6)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_the_window_just_holds_the_cloud_and_is_not_mirrored(seed):
    cloud = np.random.default_rng(seed).normal(size=(seed % 40 + 3, 3))
    view = camera(cloud)
    np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(view.axes) == pytest.approx(1)
    reach = np.abs(view.seen(cloud)[:, :2]).max() / view.half
    assert 0.9 < reach < 1


def test_the_longest_way_lies_across_and_the_shortest_towards_the_viewer():
    axes = camera(lopsided(0)).axes
    longest, shortest = axes[:, 0], axes[:, 2]
    assert abs(longest[0]) == np.abs(longest).max()
    assert abs(shortest[2]) == np.abs(shortest).max()
    box = np.array([(x, y, z) for x in (-3, 3) for y in (-2, 2) for z in (-1, 1)], dtype=float)
    along = camera(box).axes[2]
    np.testing.assert_allclose(
        np.abs(along), [np.cos(TILT) * np.sin(TURN), np.sin(TILT), np.cos(TILT) * np.cos(TURN)], atol=1e-9
    )


@pytest.mark.parametrize("count", [1, 2])
def test_a_cloud_of_next_to_nothing_is_drawn(count):
    cloud = np.zeros((count, 3))
    image = picture(camera(cloud), [Layer(cloud, RED, 3.0)], 40)
    assert (image[20, 20] != 255).any()


@given(st.lists(st.floats(0, 10), min_size=2, max_size=30), st.floats(0.1, 10))
def test_the_colours_of_errors_are_in_the_order_of_the_errors(errors, end):
    colours = error_colours(np.sort(np.array(errors)), end)
    assert (np.diff(colours[:, 2]) <= 1e-12).all(), "there is ever less blue along the scale"


def test_the_scale_begins_and_ends_with_its_colours():
    found = error_colours(np.array([0.0, 1.0, 2.0, 9.0]), 2.0)
    wanted = np.array([rgb(colour) for _, colour in [*COLOURS, COLOURS[-1]]]) / 255
    np.testing.assert_allclose(found, wanted)
    assert len(np.unique(error_colours(np.linspace(0, 2, 50), 2.0), axis=0)) == 50


def test_more_points_have_smaller_discs():
    radii = [disc_radius(count, 340) for count in (1, 512, 2048, 8192, 10**6)]
    assert radii == sorted(radii, reverse=True)
    assert radii[0] > 2 * radii[-1] > 0
    assert disc_radius(2048, 680) == pytest.approx(2 * disc_radius(2048, 340))
