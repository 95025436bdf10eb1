"""Clouds in parallel projection, against a slow drawing, and the camera's laws."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pcsr.report.figures.canvas import DPI, new_figure
from pcsr.report.figures.clouds import (
    DARKER,
    FADE,
    TILT,
    TURN,
    Camera,
    Layer,
    camera,
    disc_diameter,
    draw_clouds,
)

RED, BLUE = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
FRONT = Camera(np.eye(3), np.zeros(3), 1.0)
SIDE = 0.8
"""Of a picture, in inches: 80 pixels."""


def plot(view, layers, side=SIDE):
    """A plot that fills its figure."""
    figure = new_figure(side, side)
    axes = figure.add_axes((0, 0, 1, 1))
    draw_clouds(axes, side, view, layers)
    return axes


def picture(view, layers, side=SIDE):
    """The pixels of a plot, without its frame and its scale bar."""
    axes = plot(view, layers, side)
    for artist in (*axes.spines.values(), *axes.lines, *axes.texts):
        artist.set_visible(False)
    axes.figure.canvas.draw()
    return np.asarray(axes.figure.canvas.buffer_rgba())[..., :3]


def dots(*centres, colour=RED, diameter=0.15):
    """Discs whose colour doesn't fade."""
    cloud = np.array(centres, dtype=float)
    return Layer(cloud, np.tile(colour, (len(cloud), 1)), diameter)


def lopsided(seed):
    """A cloud whose three axes are of different lengths and whose ends are unlike."""
    rng = np.random.default_rng(seed)
    return rng.exponential(size=(300, 3)) * (3, 2, 1)


def is_colour(image, colour):
    return (np.abs(image.astype(int) - 255 * np.asarray(colour)) <= 1).all(-1)


def slow_picture(view, layers, size):
    """What is nearest at each pixel's middle, one point after the other; NaN near the soft edges of discs."""
    image, depth = np.full((size, size, 3), 255.0), np.full((size, size), -np.inf)
    rows, columns = np.indices((size, size)) + 0.5
    soft = np.zeros((size, size), bool)
    for layer in layers:
        for point, colour in zip(layer.points, np.broadcast_to(layer.colours, layer.points.shape), strict=True):
            x, y, z = view.axes @ (point - view.centre) / view.half
            away = np.hypot(rows - (1 - y) * size / 2, columns - (1 + x) * size / 2)
            inner, outer = (share * layer.diameter * size / 2 for share in (0.9, 1.1))
            image[(z > depth) & (away <= outer)] = 255 * DARKER * colour
            image[(z > depth) & (away <= inner)] = 255 * colour
            depth[(z > depth) & (away <= outer)] = z
            soft |= (np.abs(away - inner) < 1.2) | (np.abs(away - outer) < 1.2)
    image[soft] = np.nan
    return image


def test_discs_are_those_of_the_slow_drawing():
    rng = np.random.default_rng(3)
    layers = [Layer(rng.uniform(-1.1, 1.1, (20, 3)), rng.uniform(0, 1, (20, 3)), d) for d in (0.1, 0.16)]
    found, wanted = picture(FRONT, layers, 2.0), slow_picture(FRONT, layers, 2 * DPI)
    sure = np.isfinite(wanted).all(-1)
    assert sure.mean() > 0.6
    np.testing.assert_allclose(found[sure], wanted[sure], atol=1)


def test_a_picture_is_white_beside_the_points():
    image = picture(FRONT, [dots((0, 0, 0))])
    away = np.hypot(*(np.indices((80, 80)) - 39.5))
    assert is_colour(image, RED)[away < 0.9 * 6 - 1.5].all()
    assert (image[away > 1.1 * 6 + 1.5] == 255).all()


def test_up_is_up_and_right_is_right():
    image = picture(FRONT, [dots((0.5, 0, 0)), dots((0, 0.5, 0), colour=BLUE)])
    assert is_colour(image, RED)[40, 60]
    assert is_colour(image, BLUE)[20, 40]


@pytest.mark.parametrize("swapped", [False, True])
def test_a_point_in_front_hides_one_behind(swapped):
    behind, before = dots((0, 0, -0.5), diameter=0.22), dots((0, 0, 0.5), colour=BLUE, diameter=0.12)
    image = picture(FRONT, [before, behind] if swapped else [behind, before])
    assert is_colour(image, BLUE)[40, 40]
    assert is_colour(image, RED)[40, 46], "and what it doesn't hide is seen"
    one_layer = Layer(np.array([[0, 0, 0.5], [0, 0, -0.5]]), np.stack([BLUE, RED]), 0.12)
    assert not is_colour(picture(FRONT, [one_layer]), RED).any()


def test_points_out_of_the_window_or_its_depth_are_not_drawn():
    outside = dots((3, 0, 0), (0, -3, 0))
    assert (picture(FRONT, [outside]) == 255).all()
    deep = dots((0, 0, 0.9), (0, 0, -0.9))
    assert (picture(FRONT, [deep]) != 255).any()
    assert (picture(FRONT.closer(np.zeros(3), 0.5), [deep]) == 255).all()


def test_a_closer_view_shows_its_centre_in_the_middle_and_larger():
    close = FRONT.closer(np.array([0.5, 0.5, 0.0]), 0.25)
    image = picture(close, [dots((0.5, 0.5, 0)), dots((0.6, 0.5, 0), colour=BLUE)])
    assert is_colour(image, RED)[40, 40]
    assert is_colour(image, BLUE)[40, 56]


def test_one_colour_pales_with_depth_and_errors_do_not():
    cloud = np.array([[-0.5, 0, 1.0], [0.5, 0, -1.0]])
    near, far = picture(FRONT, [Layer(cloud, BLUE, 0.15)])[40, [20, 60]]
    np.testing.assert_allclose(near, (0, 0, 255), atol=1)
    np.testing.assert_allclose(far, (255 * FADE, 255 * FADE, 255), atol=1)
    near, far = picture(FRONT, [dots(*cloud, colour=BLUE)])[40, [20, 60]]
    np.testing.assert_array_equal(near, far)


@pytest.mark.parametrize(
    ("half", "length", "said"), [(1.0, 0.5, "0.5 radii"), (0.3, 0.1, "0.1 radii"), (50.0, 20, "20 radii")]
)
def test_the_scale_bar_is_as_long_as_it_says(half, length, said):
    axes = plot(Camera(np.eye(3), np.zeros(3), half), [dots((0, 0, 0))])
    (bar,), (text,) = axes.lines, axes.texts
    assert np.ptp(bar.get_xdata()) == pytest.approx(length)
    assert text.get_text() == said
    assert (axes.get_aspect(), axes.get_xlim()) == (1.0, (-half, half))


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
    image = picture(camera(cloud), [Layer(cloud, RED, 0.15)])
    assert (image[40, 40] != 255).any()


def test_more_points_have_smaller_discs():
    diameters = [disc_diameter(count) for count in (1, 512, 2048, 8192, 10**6)]
    assert diameters == sorted(diameters, reverse=True)
    assert diameters[0] > 2 * diameters[-1] > 0
