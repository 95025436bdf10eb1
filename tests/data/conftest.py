"""Recipes and a registry to build small data sets with; the parts are in `world`, tests/conftest.py."""

import pytest

from pcsr.plugins.loading import load_plugins
from pcsr.recipe import for_data


@pytest.fixture(scope="session")
def registry(world):
    made = load_plugins([world])
    assert not made.failures
    return made


@pytest.fixture
def recipe(registry):
    """A recipe for the data of some balls: `recipe("count=3")`."""

    def make(*overrides, **options):
        settings = ["touch=caps", "points=16", "rate=4", "touches=2", *overrides]
        return for_data("balls", options, registry, settings)

    return make
