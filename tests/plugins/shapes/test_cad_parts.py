import json
from functools import cache
from multiprocessing.reduction import ForkingPickler
from pathlib import Path

import numpy as np
import pytest
from manifold3d import Manifold

from pcsr import UserError
from pcsr_plugins.shapes.cad_parts import CadParts
from pcsr_plugins.shapes.cad_parts.catalogue import FAMILIES
from pcsr_plugins.shapes.shared.surfaces import FLATTEST, GRID

FINGERPRINTS = Path(__file__).with_name("fingerprints.json")
"""Numbers of the first part of each family. `python test_cad_parts.py` rewrites them."""


@cache
def part(name):
    return CadParts().item(name).mesh


def fingerprint(mesh):
    """What a machine whose sines differ in the last bit still reproduces."""
    numbers = [mesh.area, mesh.volume, *mesh.extents, *mesh.center_mass, *mesh.centroid]
    return [round(float(number), 3) for number in numbers]


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("split", ["train", "validation", "test"])
def test_every_part_is_one_sound_body(family, split):
    for number in range(2 if split == "train" else 1):
        mesh = part(f"{split}/{family}/{number:04d}")
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        assert mesh.body_count == 1
        assert mesh.volume > 0.001 * mesh.convex_hull.volume
        assert 10 < mesh.extents.max() < 200
        assert 250 <= len(mesh.faces) <= 20_000
        assert mesh.area_faces.min() > FLATTEST


@pytest.mark.parametrize("family", FAMILIES)
def test_a_family_is_not_one_shape_stretched(family):
    structures = {len(part(f"train/{family}/{number:04d}").faces) for number in range(6)}
    assert len(structures) >= 3


def test_the_same_parts_on_every_machine():
    stored = json.loads(FINGERPRINTS.read_text())
    assert list(stored) == list(FAMILIES)
    for family, numbers in stored.items():
        np.testing.assert_allclose(fingerprint(part(f"train/{family}/0000")), numbers, rtol=1e-6, atol=1.5e-3)


def test_vertices_lie_on_the_grid():
    vertices = part("train/gear/0000").vertices / GRID
    np.testing.assert_allclose(vertices, np.round(vertices), atol=1e-3)


def test_generating_again_gives_the_same_bits_and_another_seed_another_part():
    first, again = (CadParts().item("train/cam/0001").mesh for _ in range(2))
    assert first.vertices.tobytes() == again.vertices.tobytes()
    assert first.faces.tobytes() == again.faces.tobytes()
    other = CadParts(seed=1).item("train/cam/0001").mesh
    assert abs(first.volume - other.volume) > 1


def test_a_name_means_the_same_part_however_many_there_are():
    few, many = CadParts(count=1).names("train"), CadParts(count=500).names("train")
    assert many[:1] == few
    np.testing.assert_array_equal(
        CadParts(count=1).item(few[0]).mesh.vertices, CadParts(count=500).item(few[0]).mesh.vertices
    )


def test_families_come_in_turn_and_names_are_unique():
    shapes = CadParts(count=2 * len(FAMILIES) + 3, held_out=5)
    names = shapes.names("train")
    assert len(set(names)) == len(names) == 2 * len(FAMILIES) + 3
    assert [name.split("/")[1] for name in names[: len(FAMILIES)]] == list(FAMILIES)
    assert len(shapes.names("validation")) == len(shapes.names("test")) == 5
    assert not set(shapes.names("validation")) & set(shapes.names("test"))


def test_items_carry_their_family():
    item = CadParts().item("test/nut/0000")
    assert (item.name, item.group) == ("test/nut/0000", "nut")


def test_every_family_has_a_docstring_and_there_are_enough():
    assert len(FAMILIES) >= 26
    assert all(function.__doc__ for function in FAMILIES.values())


def test_what_a_worker_is_sent_is_small():
    assert len(ForkingPickler.dumps(CadParts(count=100_000))) < 300


@pytest.mark.parametrize(
    "name",
    ["train/teapot/0000", "tests/gear/0000", "gear", "train/gear/x", "train/gear/-1", "train/gear/0500", ""],
)
def test_an_unknown_part_is_named(name):
    with pytest.raises(UserError, match=f"no object '{name}'"):
        CadParts().item(name)


def test_an_unknown_split_is_named():
    with pytest.raises(UserError, match="no split 'val': it has train, validation, test"):
        CadParts().names("val")


def test_a_negative_count_is_refused():
    with pytest.raises(UserError, match="count -1"):
        CadParts(count=-1)


def test_a_draw_that_falls_apart_is_drawn_again(monkeypatch):
    cube = Manifold.cube((30.0, 30.0, 30.0))
    solids = [cube + cube.translate((99, 0, 0)), cube - cube.scale((9, 9, 9)).translate((-9, -9, -9)), cube]
    monkeypatch.setitem(FAMILIES, "gear", lambda draw: solids.pop(0))
    assert CadParts().item("train/gear/0000").mesh.volume == pytest.approx(27_000)


def test_a_family_that_always_falls_apart_is_reported(monkeypatch):
    monkeypatch.setitem(FAMILIES, "gear", lambda draw: Manifold())
    with pytest.raises(UserError, match=r"train/gear/0000.*seed 0: take another seed"):
        CadParts().item("train/gear/0000")


if __name__ == "__main__":
    prints = {family: fingerprint(part(f"train/{family}/0000")) for family in FAMILIES}
    lines = [f'  "{family}": {json.dumps(numbers)}' for family, numbers in prints.items()]
    FINGERPRINTS.write_text("{\n" + ",\n".join(lines) + "\n}\n")
