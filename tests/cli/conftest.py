"""Fixture of the tests of commands that register touches."""

import pytest

from pcsr import touches as module
from tests.registration import by_hand


@pytest.fixture
def made_by_hand(monkeypatch):
    """Put a registration that is made by hand in the place of `register`; the errors of the poses that it gets."""
    errors = []

    def register(given, cloud, *, pose_error=None):
        errors.append(pose_error)
        return by_hand.registration(given)

    monkeypatch.setattr(module, "register", register)
    return errors
