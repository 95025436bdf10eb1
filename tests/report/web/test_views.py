import json

import numpy as np
import pytest

from pcsr import expected_errors
from pcsr.report.cloud_errors import distance
from pcsr.report.web.views import views
from pcsr.run_files import Example


@pytest.fixture
def example(clouds):
    return Example(
        "test/gear/0000",
        clouds["0/input"],
        clouds["0/touches"],
        clouds["0/truth"],
        {"tapsr": clouds["0/tapsr"], "midpoint": clouds["0/midpoint"]},
    )


def slow_distance(prediction, truth):
    return np.linalg.norm(prediction[:, None].astype(float) - truth[None].astype(float), axis=-1).min(1)


def points(trace):
    return np.stack([trace[axis] for axis in "xyz"], 1)


def test_distance_is_to_the_nearest_true_point(example):
    cloud = example.predictions["tapsr"]
    np.testing.assert_allclose(distance(cloud, example.truth), slow_distance(cloud, example.truth), rtol=1e-6)


def test_a_row_shows_input_touches_predictions_truth(example):
    row = views(example)["views"]
    titles = ["input", "touches", "tapsr", "expected error of tapsr", "midpoint", "truth"]
    assert [view["title"].split(",")[0] for view in row] == titles
    first, second = example.predictions.values()
    shown = [example.input, example.input, first, first, second, example.truth]
    for view, cloud in zip(row, shown, strict=True):
        np.testing.assert_allclose(points(view["traces"][0]), cloud, atol=0.51e-4)
    grey, red = row[1]["traces"]
    assert (grey["marker"]["color"], red["marker"]["color"]) == ("quiet", "touch")
    np.testing.assert_allclose(points(red), example.touches, atol=0.51e-4)


def test_without_touches_there_is_no_view_of_them(example):
    row = views(Example("o", example.input, None, example.truth, example.predictions))["views"]
    titles = ["input", "tapsr", "expected error of tapsr", "midpoint", "truth"]
    assert [view["title"].split(",")[0] for view in row] == titles


def test_the_first_prediction_is_coloured_by_its_expected_error_too(example):
    drawn = views(example)
    expected = 1000 * expected_errors(example.input, example.predictions["tapsr"])
    marker = drawn["views"][3]["traces"][0]["marker"]
    np.testing.assert_allclose(marker["color"], expected, atol=0.0051)
    assert (marker["cmin"], marker["cmax"]) == (0, drawn["limit"])
    assert f"mean {expected.mean():.3g} ×10⁻³" in drawn["views"][3]["title"]


def test_an_input_of_few_points_has_no_expected_errors(example):
    row = views(Example("o", example.input[:15], None, example.truth, example.predictions))["views"]
    assert not any("expected" in view["title"] for view in row)


def test_predictions_are_coloured_by_error_on_one_scale(example):
    drawn = views(example)
    everything = [1000 * slow_distance(cloud, example.truth) for cloud in example.predictions.values()]
    for view, cloud_errors in zip([drawn["views"][2], drawn["views"][4]], everything, strict=True):
        marker = view["traces"][0]["marker"]
        np.testing.assert_allclose(marker["color"], cloud_errors, atol=0.0051)
        assert (marker["cmin"], marker["cmax"]) == (0, drawn["limit"])
        assert f"{np.mean(cloud_errors):.3g} ×10⁻³" in view["title"]
    assert np.mean(np.concatenate(everything) > drawn["limit"]) == pytest.approx(0.01, abs=0.003)


def test_a_perfect_prediction_still_has_a_scale(example):
    drawn = views(Example("o", example.input, None, example.truth, {"perfect": example.truth}))
    assert drawn["limit"] == 1.0


def test_one_cube_holds_input_touches_and_truth(example):
    ranges = np.array(views(example)["range"])
    sides = ranges[:, 1] - ranges[:, 0]
    np.testing.assert_allclose(sides, sides[0], atol=2e-4)
    for cloud in (example.input, example.touches, example.truth):
        assert (cloud >= ranges[:, 0]).all()
        assert (cloud <= ranges[:, 1]).all()


def test_coordinates_are_written_with_at_most_four_decimals(example):
    for view in views(example)["views"]:
        for trace in view["traces"]:
            for value in trace["x"] + trace["y"] + trace["z"]:
                assert json.dumps(value) == json.dumps(round(value, 4))
