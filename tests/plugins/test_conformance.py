"""Every first-party part keeps the contract of its kind."""

import numpy as np
import pytest
import trimesh

from pcsr import Touch
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import KINDS
from pcsr.recorded import write
from pcsr.testing import checks_for
from pcsr.testing.touching import egg

REGISTRY = load_plugins()
PARTS = {(entry.kind, entry.name): entry.load() for entry in REGISTRY if entry.owner == "pcsr"}
LONG = {"export", "gradcheck", "items"}
"""Checks that take a second or two of some parts."""
CHECKS = [
    pytest.param(*case, id="-".join(case), marks=[pytest.mark.slow] if case[2] in LONG else [])
    for (kind, name), part in PARTS.items()
    for case in ((kind, name, check.name) for check in checks_for(part))
]


@pytest.fixture(scope="session")
def given(tmp_path_factory):
    """What parts need to be built or called, where their defaults don't do: options, an object, an upsampler."""
    meshes, recording = tmp_path_factory.mktemp("meshes"), tmp_path_factory.mktemp("recording")
    for number in range(8):
        trimesh.creation.box([1, 2, 3 + number]).export(meshes / f"box-{number}.stl")
    vertices = np.asarray(egg().mesh.vertices)
    write(recording, [Touch.single(vertices[i : i + 9], None, 1.0, "digit") for i in range(5)])
    return {
        ("shapes", "meshes"): {"folder": str(meshes)},
        ("touch", "recorded"): {"folder": str(recording)},
        ("objective", "grad-pu"): {"upsampler": PARTS.get(("upsampler", "descent"))},
        ("objective", "surface-passes"): {"upsampler": PARTS.get(("upsampler", "rated-edges"))},
    }


@pytest.mark.parametrize(("kind", "name", "check"), CHECKS)
def test_part(kind, name, check, given):
    run = {one.name: one for one in checks_for(PARTS[kind, name], **given.get((kind, name), {}))}
    run[check]()


def test_all_parts_are_there():
    assert REGISTRY.failures == []
    assert {kind for kind, _ in PARTS} == KINDS.keys()
