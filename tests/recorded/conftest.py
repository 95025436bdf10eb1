"""What tests of recordings share."""

import numpy as np
import pytest

from tests.recorded.recordings import CLOUD


@pytest.fixture
def folder(tmp_path):
    """A folder with one cloud."""
    np.save(tmp_path / "0.npy", CLOUD)
    return tmp_path
