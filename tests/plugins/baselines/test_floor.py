"""`floor`: another sampling of the true surface."""

import numpy as np
import pytest
import trimesh

from pcsr import UserError
from pcsr_plugins.baselines.floor import Floor

POINTS = np.zeros((20, 3))


def test_its_points_lie_on_the_surface_and_follow_from_the_random_numbers():
    box = trimesh.creation.box((2, 2, 2))
    mesh = np.asarray(box.vertices), np.asarray(box.faces)
    dense, again, other = (Floor().upsample(POINTS, 4, mesh, np.random.default_rng(seed)) for seed in (0, 0, 1))
    assert dense.shape == (80, 3)
    np.testing.assert_allclose(np.abs(dense).max(1), 1, atol=1e-12)
    np.testing.assert_array_equal(again, dense)
    assert not np.array_equal(other, dense)


def test_it_needs_the_surface():
    assert Floor.needs_mesh
    with pytest.raises(UserError, match="baseline 'floor' samples the true surface, and there is no mesh: leave it"):
        Floor().upsample(POINTS, 4, None, np.random.default_rng(0))
