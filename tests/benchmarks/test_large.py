"""The landscape of the benchmark of large clouds."""

import importlib
from pathlib import Path

import numpy as np
import pytest

from pcsr.clouds.faults import find_faults
from pcsr.clouds.formats import read_cloud

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    large = importlib.import_module("large")


def test_the_landscape_has_as_many_points_as_asked_for_and_is_always_the_same(tmp_path, monkeypatch):
    monkeypatch.setattr(large, "CHUNK", 4500)
    for name in ("a.las", "b.las"):
        large.make(tmp_path / name, 20_000)
    cloud, again = (read_cloud(tmp_path / name) for name in ("a.las", "b.las"))
    assert len(cloud) == 20_000
    np.testing.assert_array_equal(cloud.points, again.points)
    assert set(cloud.columns["class"]) <= {large.GROUND, large.TREE, large.HOUSE}
    assert len(set(cloud.columns["class"])) > 1
    side = np.ptp(cloud.points[:, :2], axis=0)
    assert 20_000 / side.prod() == pytest.approx(large.DENSITY, rel=0.05)
    assert [fault for fault in find_faults(cloud.points) if fault.harmful] == []
