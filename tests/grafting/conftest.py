"""Clouds and touches, and each foreign network in turn."""

import pytest
import torch

from tests.grafting.networks import CASES, N


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    """Networks this small only lose by more."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(params=CASES)
def case(request):
    return CASES[request.param]


@pytest.fixture
def world():
    """Three clouds, up to two touches of ten points each."""
    random = torch.Generator().manual_seed(1)
    return torch.rand(3, N, 3, generator=random) - 0.5, (torch.rand(3, 2, 10, 3, generator=random) - 0.5) / 2
