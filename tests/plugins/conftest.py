"""What tests of parts share."""

import pytest
import torch


@pytest.fixture(autouse=True)
def _seed():
    """Each test draws the same numbers, whichever ran before it."""
    with torch.random.fork_rng():
        torch.manual_seed(7)
        yield
