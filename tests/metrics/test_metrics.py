import numpy as np
import pytest
import torch
import trimesh

from pcsr import UserError
from pcsr.metrics import METRICS

A = torch.tensor([[[0.0, 0, 0], [0, 0, 4]]])
B = torch.tensor([[[0.0, 0, 1], [0, 0, 4]]])
FLOOR = (np.array([[-9.0, -9, 0], [9, -9, 0], [0, 9, 0]]), np.array([[0, 1, 2]]))


@pytest.mark.parametrize(
    ("name", "value"),
    [("cd", 1 / 2 + 1 / 2), ("hd", 1), ("hd-pugcn", 2), ("emd", 1 / 2), ("p2f", 2)],
)
def test_each_name_has_its_convention(name, value):
    assert METRICS[name](A, B, FLOOR) == pytest.approx(value)


def test_names_are_the_keys_and_only_p2f_needs_the_mesh():
    assert all(name == metric.name for name, metric in METRICS.items())
    assert [name for name, metric in METRICS.items() if metric.needs_mesh] == ["p2f"]


def test_a_metric_without_its_mesh_says_so():
    with pytest.raises(UserError, match="metric 'p2f' needs the true mesh"):
        METRICS["p2f"](A, B)


def test_p2f_is_zero_on_the_surface_where_the_others_are_not():
    ball = trimesh.creation.icosphere(2)
    on_it = torch.from_numpy(np.asarray(ball.vertices))[None]
    mesh = np.asarray(ball.vertices), np.asarray(ball.faces)
    assert METRICS["p2f"](on_it, on_it / 2, mesh) == pytest.approx(0, abs=1e-12)
    assert METRICS["hd"](on_it, on_it / 2, mesh) > 0.4
