"""The fitted networks that pcsr ships, `expected_errors.safetensors`; benchmarks/fit_errors.py makes the file."""

import functools
import json
from dataclasses import dataclass
from pathlib import Path

from safetensors import safe_open

from pcsr.uncertainty.quantile_network import QuantileNetwork

FILE = Path(__file__).with_name("expected_errors.safetensors")


@dataclass(frozen=True)
class FittedNetworks:
    """Networks for both kinds of points."""

    plain: QuantileNetwork
    """For points whose error no upsampling network predicted."""
    rated: QuantileNetwork
    """For points whose error the upsampling network predicted."""


@functools.cache
def fitted_networks(path: Path = FILE) -> FittedNetworks:
    """Read the networks; each process reads the file once."""
    with safe_open(path, "np") as file:
        names = json.loads(file.metadata()["names"])
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    networks = {}
    for kind in ("plain", "rated"):
        own = {name.removeprefix(f"{kind}."): one for name, one in tensors.items() if name.startswith(f"{kind}.")}
        networks[kind] = QuantileNetwork.of(tuple(names[kind]), own)
    return FittedNetworks(**networks)
