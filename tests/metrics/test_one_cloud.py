"""A cloud beside the true one: every metric by its name, in the frame that was asked for."""

import numpy as np
import pytest
import torch
import trimesh

from pcsr import UserError
from pcsr.geometry.frames import UnitSphere
from pcsr.metrics import chamfer
from pcsr.metrics.one_cloud import evaluate


def cloud(count=60, seed=0):
    xy = np.random.default_rng(seed).uniform(-1, 1, (count, 2))
    return np.column_stack([xy, 0.3 * xy[:, 0] ** 2 + 0.1 * xy[:, 1]])


def test_evaluate_gives_every_metric_by_its_name():
    ball = trimesh.creation.icosphere(subdivisions=3)
    truth = ball.vertices * 5 + 1
    prediction = truth + np.random.default_rng(0).normal(0, 0.01, truth.shape)
    surface = trimesh.Trimesh(truth, ball.faces)
    values = evaluate(prediction, truth, surface)
    assert set(values) == {"cd", "hd", "hd-pugcn", "emd", "p2f"}
    sphere = UnitSphere.fit(truth)
    by_hand = chamfer(*(torch.from_numpy((c - sphere.centre) / sphere.radius)[None] for c in (prediction, truth)))
    assert values["cd"] == pytest.approx(float(by_hand[0]))
    assert set(evaluate(prediction[:100], truth)) == {"cd", "hd", "hd-pugcn"}
    raw, scaled = evaluate(prediction, truth, surface, frame="none"), evaluate(prediction, truth, surface, frame="each")
    assert raw["p2f"] == pytest.approx(scaled["p2f"])
    assert raw["p2f"] == pytest.approx(values["p2f"] * sphere.radius, rel=1e-6)
    assert raw["cd"] == pytest.approx(values["cd"] * sphere.radius**2, rel=1e-6)
    assert evaluate(truth, truth, metrics=["cd"]) == {"cd": 0.0}


def test_evaluate_names_what_it_does_not_know():
    points = cloud()
    with pytest.raises(UserError, match="there is no metric 'chamfer'"):
        evaluate(points, points, metrics=["chamfer"])
    with pytest.raises(UserError, match="there is no frame 'both'"):
        evaluate(points, points, frame="both")
    with pytest.raises(UserError, match="needs the true mesh"):
        evaluate(points, points, metrics=["p2f"])


def test_one_metric_may_be_named_alone():
    points = cloud()
    assert evaluate(points, points, metrics="cd") == {"cd": 0.0}
