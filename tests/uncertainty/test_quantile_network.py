"""The network of expected errors: as torch computes it, within limits, and of features that exist."""

from itertools import pairwise

import numpy as np
import pytest
import torch

from pcsr.uncertainty.features import PREDICTED, Patch, features
from pcsr.uncertainty.fitted import fitted_networks
from pcsr.uncertainty.quantile_network import LIMIT, RESOLUTION, SMALLEST, QuantileNetwork


def random_network(seed=0):
    rng = np.random.default_rng(seed)
    sizes = (3, 8, 8, 1)
    tensors = {"mean": rng.normal(size=3), "deviation": rng.uniform(0.5, 2, 3)}
    for layer, (before, after) in enumerate(pairwise(sizes)):
        tensors |= {f"weight.{layer}": rng.normal(size=(after, before)), f"bias.{layer}": rng.normal(size=after)}
    return QuantileNetwork.of(("a", "b", "c"), tensors), tensors


def test_it_computes_what_torch_does():
    network, tensors = random_network()
    inputs = np.random.default_rng(1).normal(size=(50, 3)) * 3
    layers = []
    for layer in range(3):
        linear = torch.nn.Linear(*tensors[f"weight.{layer}"].shape[::-1], dtype=torch.float64)
        linear.weight.data, linear.bias.data = (
            torch.from_numpy(tensors[f"{kind}.{layer}"]) for kind in ("weight", "bias")
        )
        layers += [linear, torch.nn.SiLU()]
    standard = torch.from_numpy((inputs - tensors["mean"]) / tensors["deviation"]).clamp(-LIMIT, LIMIT)
    expected = torch.nn.Sequential(*layers[:-1])(standard)[:, 0].exp().detach().numpy() - RESOLUTION
    found = network({"c": inputs[:, 2], "a": inputs[:, 0], "b": inputs[:, 1], "unknown": inputs[:, 0]})
    np.testing.assert_allclose(found, np.maximum(expected, SMALLEST), rtol=1e-9)


def test_no_error_is_smaller_than_the_smallest_and_none_is_wild():
    network, _ = random_network()
    wild = {name: np.array([-1e9, 0.0, 1e9]) for name in "abc"}
    clipped = {
        name: network.mean[i] + LIMIT * network.deviation[i] * np.array([-1, 0, 1]) for i, name in enumerate("abc")
    }
    assert network(wild).min() >= SMALLEST
    np.testing.assert_allclose(network(wild)[[0, 2]], network(clipped)[[0, 2]])


def test_the_networks_that_are_shipped_use_features_that_exist():
    rng = np.random.default_rng(0)
    names, networks = (
        features(Patch(rng.normal(size=(20, 3)), np.zeros((1, 3))), np.arange(1))[0].keys(),
        fitted_networks(),
    )
    assert set(networks.plain.names) <= set(names)
    assert set(networks.rated.names) - set(networks.plain.names) == {PREDICTED}
    for network in (networks.plain, networks.rated):
        assert network.weights[0].shape[1] == len(network.names) == len(network.mean)


def test_a_missing_feature_is_named():
    with pytest.raises(KeyError, match="c"):
        random_network()[0]({"a": np.zeros(1), "b": np.zeros(1)})
