import statistics

import numpy as np
import pytest

from pcsr.report.web.curves import DOTS, group_chart, thin, touch_chart, training_charts
from pcsr.results import parse_results


def test_bars_show_the_group_means_worst_first(results):
    figure = group_chart(parse_results(results), "cd")
    assert [trace["name"] for trace in figure["data"]] == ["tapsr", "midpoint", "a &lt;b&gt;&amp;"]
    heights = figure["data"][0]["x"]
    assert heights == sorted(heights, reverse=True)
    for trace, method in zip(figure["data"], results["methods"], strict=True):
        pipes = [v for v, g in zip(method["values"]["cd"], results["groups"], strict=True) if g == "pipe"]
        shown = dict(zip(trace["y"], trace["x"], strict=True))["pipe"]
        assert shown == pytest.approx(1000 * statistics.mean(pipes), abs=1e-4)


def test_a_groups_name_is_no_markup_to_plotly(results):
    figure = group_chart(parse_results(results), "cd")
    assert set(figure["data"][0]["y"]) == {"gear", "pipe", "&lt;/script&gt;&lt;b&gt;"}


def test_short_histories_are_drawn_whole(history):
    charts = training_charts(history)
    (loss,) = charts["loss"]["data"]
    assert loss["x"] == list(range(1, 31))
    np.testing.assert_allclose(loss["y"], [line["loss"] for line in history[:-1]], rtol=1e-5)
    assert charts["loss"]["layout"]["yaxis"]["type"] == "log"
    (validation,) = charts["validation"]["data"]
    assert (validation["name"], validation["x"], validation["y"]) == ("cd", [30], [0.0011])


def test_several_losses_are_drawn_beside_their_sum(history):
    for line in history[:-1]:
        line["losses"] = {"chamfer": line["loss"] + 1, "adversarial": -1.0}
    figure = training_charts(history)["loss"]
    assert [trace["name"] for trace in figure["data"]] == ["loss", "adversarial", "chamfer"]
    assert figure["layout"]["yaxis"]["type"] == "linear"  # a negative loss has no logarithm


def test_of_a_step_written_twice_the_later_counts(history):
    again = {**history[4], "loss": 9.0}
    (loss,) = training_charts([*history, again])["loss"]["data"]
    assert len(loss["y"]) == 30
    assert loss["y"][4] == 9.0


def test_an_empty_history_draws_nothing():
    assert training_charts([]) == {}


def test_long_curves_are_averaged_over_stretches():
    values = {step: float(step % 7) for step in range(1, 10 * DOTS + 1)}
    x, y = thin(values)
    assert len(x) == len(y) == DOTS
    assert y[0] == statistics.mean(values[step] for step in range(1, 11))
    assert x[0] == 5.5
    assert statistics.mean(y) == pytest.approx(statistics.mean(values.values()))


def test_the_error_by_distance_is_a_line_a_cloud_without_empty_bins(results, touch):
    figure = touch_chart(parse_results(results).touch)
    assert [trace["name"] for trace in figure["data"]] == ["tapsr", "tapsr without touch", "a &lt;b&gt;&amp;"]
    for trace, errors in zip(figure["data"], touch["errors"].values(), strict=True):
        assert trace["x"] == ["to 0.1", "beyond"]
        assert trace["customdata"] == [3, 9]
        assert trace["y"] == pytest.approx([1000 * errors[0], 1000 * errors[2]])
    assert len({trace["line"]["color"] for trace in figure["data"]}) == 3
