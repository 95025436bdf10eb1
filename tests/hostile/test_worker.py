"""That the process which bounds hostile commands measures them."""

import numpy as np
import pytest


def test_a_good_command_is_good(limited, tmp_path):
    np.savetxt(tmp_path / "in.xyz", np.random.default_rng(0).normal(size=(50, 3)))
    outcome = limited("upsample", "in.xyz", "-o", "out.xyz", "--model", "midpoint", folder=tmp_path)
    assert outcome.code == 0, outcome.err
    assert len(np.loadtxt(tmp_path / "out.xyz")) == 200


def test_a_mistake_is_one_line(limited, tmp_path):
    limited("upsample", "in.xyz", "-o", "out.xyz", folder=tmp_path).refused("in.xyz", "No such file")


@pytest.mark.slow
def test_memory_is_that_of_the_command_alone(limited, tmp_path):
    np.save(tmp_path / "in.npy", np.zeros((5_000_000, 3)))
    large = limited("upsample", "in.npy", "-o", "out.npy", folder=tmp_path)
    assert large.megabytes > 100
    assert large.code == 2
    small = limited("upsample", "missing.npy", "-o", "out.npy", folder=tmp_path)
    assert small.megabytes < 20
