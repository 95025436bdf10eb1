"""The way in which a recipe's network makes a cloud dense, and its name."""

import warnings
from pathlib import Path

import numpy as np
import pytest
import torch

import pcsr
from pcsr.errors import PcsrWarning, UserError
from pcsr.network.build import build
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr.threads import WORK_PER_THREAD
from pcsr.upsample import protocol, thread_limit, upsample, upsample_as, upsample_plainly
from pcsr.upsample.patchwise import AT_ONCE, upsample_patches

RECIPES = Path(pcsr.__file__).parent / "recipes"
REGISTRY = load_plugins()
TAPSR = ["model.encoder.channels=16", "model.touch_encoder.channels=8", "model.backbone.channels=[16, 32]"]


def made(name, *settings):
    """A recipe and its network, untrained but not at rest."""
    (recipe,) = load(RECIPES / f"{name}.yaml", REGISTRY, ["data.points=64", "data.rate=4", *settings])
    torch.manual_seed(0)
    network = build(recipe, REGISTRY).eval()
    with torch.no_grad():
        for weights in network.parameters():
            weights += 0.02 * torch.randn_like(weights)
    return recipe, network


def dome(n=64, seed=0):
    """Points on the upper half of the unit sphere."""
    points = np.random.default_rng(seed).normal(size=(n, 3))
    points[:, 2] = np.abs(points[:, 2])
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def touch(way, n=60):
    """A small patch of the unit sphere in the given direction."""
    points = np.asarray(way, float) + 0.1 * np.random.default_rng(1).normal(size=(n, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def model(recipe, network):
    return pcsr.Model(recipe.name, network, recipe, {}, None, ())


@pytest.mark.parametrize("touches", [[], [touch((0, 0.3, 1)), touch((0, 0, -1))]], ids=["plain", "touched"])
def test_a_network_of_any_rate_goes_the_way_of_the_library_to_the_last_bit(touches):
    recipe, network = made("frames")
    points = 3.7 * dome() + 40.0
    touches = [3.7 * one + 40.0 for one in touches]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dense = upsample_as(recipe, network, points, touches)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PcsrWarning)
        np.testing.assert_array_equal(dense, model(recipe, network).upsample(points, touches, rate=4))
    np.testing.assert_array_equal(dense[:64], points)
    assert dense.dtype == np.float64
    assert protocol(recipe, network) == "as pcsr upsample"
    assert not np.array_equal(dense, upsample(network, points, 4, touches))
    below = (dense[:, 2] < 40 - 0.9 * 3.7).sum()
    assert below > 0 if touches else below == 0, "the touched region that the cloud lacks"


def test_the_library_warns_of_a_touch_of_an_unseen_region_and_evaluation_does_not():
    recipe, network = made("frames")
    with pytest.warns(PcsrWarning, match="touched points lie up to"):
        model(recipe, network).upsample(dome(), [touch((0, 0, -1))], rate=4)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        upsample_as(recipe, network, dome(), [touch((0, 0, -1))])
        with pytest.warns(UserWarning, match="another"):  # what else warns is not silenced for good
            warnings.warn("another", stacklevel=1)


def test_evaluation_in_single_precision_is_that_of_the_same_numbers_in_double():
    recipe, network = made("frames")
    points, contact = dome().astype(np.float32), touch((0, 0.3, 1)).astype(np.float32)
    dense = upsample_as(recipe, network, points, [contact])
    np.testing.assert_array_equal(dense, upsample_as(recipe, network, points.astype(float), [contact.astype(float)]))


def test_patches_have_the_size_of_the_training_unless_all_parts_are_local():
    trained, network = made("frames", "data.points=32", "model.encoder=mlp")
    recipe, _ = made("frames", "data.points=256", "model.encoder=mlp")
    points = dome(256)
    dense = upsample_as(recipe, network, points, trained=trained)
    np.testing.assert_array_equal(dense, model(trained, network).upsample(points, rate=4))
    assert not np.array_equal(dense, upsample_as(recipe, network, points))
    trained, network = made("frames", "data.points=32")
    recipe, _ = made("frames", "data.points=256")
    np.testing.assert_array_equal(
        upsample_as(recipe, network, points, trained=trained), upsample_as(recipe, network, points)
    )


def test_a_network_of_one_rate_gets_the_whole_cloud():
    recipe, network = made("tapsr", *TAPSR, "model.upsampler.hidden=8")
    points, touches = dome(), [touch((0, 0, 1)), touch((0, 0, -1))]
    dense = upsample_as(recipe, network, points, touches)
    np.testing.assert_array_equal(dense, upsample(network, points, 4, touches))
    assert protocol(recipe, network) == "whole cloud in one pass, as TAPSR"
    with pytest.raises(UserError, match="touches: expected one size"):
        upsample_as(recipe, network, points, [touches[0], touches[1][:5]])


@pytest.mark.parametrize("name", ["pu-net", "grad-pu"])
def test_recipes_with_patches_go_the_way_of_the_field_even_at_any_rate(name):
    recipe, network = made(name, "patches={points: 32, rate: 4, overlap: 2}")
    points = dome()
    dense = upsample_as(recipe, network, points)
    np.testing.assert_array_equal(dense, upsample_patches(network, points, 4, (), recipe.patches))
    np.testing.assert_array_equal(dense, upsample_plainly(recipe, network, points))
    assert protocol(recipe, network) == "by patches of 32 points at 4x, as PU-Net"


def test_the_network_alone_gets_the_whole_cloud_whatever_its_rates():
    recipe, network = made("frames")
    touches = [touch((0, 0, 1))]
    np.testing.assert_array_equal(
        upsample_plainly(recipe, network, dome(), touches), upsample(network, dome(), 4, touches)
    )


@pytest.mark.parametrize(
    ("name", "settings", "points"),
    [
        ("tapsr", [*TAPSR, "data.points=200000"], 200_000),
        ("pu-net", ["data.points=200000", "patches.points=60000"], AT_ONCE * 60_000),
        ("frames", ["data.points=200000"], 0),
    ],
)
def test_threads_are_as_many_as_the_network_has_work_at_once_and_one_in_use(name, settings, points):
    recipe, network = made(name, *settings)
    expected = max(1, points * network.parameter_count // WORK_PER_THREAD)
    assert thread_limit(recipe, network) == expected
    assert (expected == 1) == (name == "frames")
