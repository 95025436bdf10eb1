"""The picture of any clouds: every point in its colour, in a window that holds them all."""

import numpy as np
import pytest

from pcsr.clouds.cloud import Cloud
from pcsr.report.clouds.shown import Named, scene
from pcsr.report.figures.canvas import encoded
from pcsr.report.figures.clouds_picture import clouds_picture

POINTS = np.array([450_000, 5_400_000, 200]) + np.random.default_rng(0).uniform(-1, 1, (60, 3))


def picture(*clouds, by=None, touches=()):
    return clouds_picture(scene([Named(*one) for one in clouds], by, touches))


def drawn(axes):
    """Positions and colours of the points of a panel."""
    (dots,) = axes.collections
    return np.asarray(dots.get_offsets()), dots.get_facecolors()[:, :3]


def colours(*channels):
    return {name: np.full(60, value, np.uint8) for name, value in zip(("red", "green", "blue"), channels, strict=True)}


def test_every_cloud_is_drawn_whole_in_the_same_window():
    figure = picture(("a", Cloud(POINTS)), ("b", Cloud(2 * (POINTS - POINTS[0]) + POINTS[0])))
    first, second, _ = figure.axes  # the third is the scale's
    assert first.get_xlim() == second.get_xlim()
    for axes in (first, second):
        positions, _ = drawn(axes)
        assert len(positions) == 60
        assert np.abs(positions).max() < axes.get_xlim()[1]
    assert np.abs(drawn(second)[0]).max() > 0.85 * second.get_xlim()[1]
    np.testing.assert_allclose(np.ptp(drawn(second)[0]), 2 * np.ptp(drawn(first)[0]), rtol=0.2)


def test_up_is_up():
    column = np.array([[0.0, 0, z] for z in range(20)])
    positions, _ = drawn(picture(("a", Cloud(column)), by="none").axes[0])
    assert (np.ptp(positions[:, 0]) < 1e-9) & (np.ptp(positions[:, 1]) > 10)
    nearer = np.argsort(column @ (1, 1, 0.7))  # points are drawn from the farthest on
    assert (np.diff(positions[nearer, 1]) > 0).all()


def test_points_have_their_own_colours():
    axes = picture(("a", Cloud(POINTS, colours(255, 128, 0)))).axes
    assert len(axes) == 1
    np.testing.assert_allclose(drawn(axes[0])[1], np.tile((1, 128 / 255, 0), (60, 1)))


def test_numbers_have_a_bar_with_the_ends_and_the_name_of_the_column():
    heat = np.linspace(-3, 9, 60) ** 3
    panel, bar = picture(("a", Cloud(POINTS, {"heat $x$": heat})), by="heat $x$").axes
    assert bar.get_xlim() == (-27, 729)
    assert bar.get_xlabel() == r"heat \$x\$"
    assert len({tuple(colour) for colour in drawn(panel)[1]}) > 20


@pytest.mark.parametrize("touches", [[], [POINTS[:5]]])
def test_classes_have_a_legend(touches):
    figure = picture(("a", Cloud(POINTS, {"source": np.repeat([0, 1], 30)})), touches=touches)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["old", "new", *["recorded touches"] * len(touches)]
    assert len(drawn(figure.axes[0])[0]) == 60 + 5 * len(touches)


def test_the_legend_names_the_column_of_labels():
    (legend,) = picture(("a", Cloud(POINTS, {"label $x$": np.repeat([6, 2], 30)})), by="label $x$").legends
    assert legend.get_title().get_text() == r"label \$x\$"
    assert [text.get_text() for text in legend.get_texts()] == ["2", "6"]


@pytest.mark.parametrize("count", [1, 2, 3, 9])
def test_many_clouds_are_drawn_and_the_files_are_alike(count):
    clouds = [(f"{k} $&_^\\", Cloud(POINTS + k)) for k in range(count)]
    first, second = (encoded(picture(*clouds), "png") for _ in range(2))
    assert first == second
    assert first.startswith(b"\x89PNG")


@pytest.mark.parametrize("points", [np.zeros((1, 3)), np.full((4, 3), 1e7), POINTS * 1e-6, POINTS * 1e6])
def test_clouds_of_any_size_are_drawn(points):
    figure = picture(("a", Cloud(points)))
    assert encoded(figure, "png").startswith(b"\x89PNG")
