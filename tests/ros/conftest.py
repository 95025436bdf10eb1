import pytest

from tests.ros.bags import KINDS, BagWriter


@pytest.fixture(params=KINDS)
def any_bag(request, tmp_path):
    """A bag of each kind that is not written yet."""
    return BagWriter(tmp_path, request.param)


@pytest.fixture
def bag(tmp_path):
    """A bag that is not written yet, of the kind that ROS 2 writes by default."""
    return BagWriter(tmp_path)
