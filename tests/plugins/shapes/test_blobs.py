import json
from functools import cache
from itertools import combinations
from multiprocessing.reduction import ForkingPickler
from pathlib import Path

import numpy as np
import pytest

from pcsr import UserError
from pcsr_plugins.shapes.blobs import FAMILIES, Blobs, animals, figures, fruit, growths, rings, vessels
from pcsr_plugins.shapes.blobs.isosurface import REACH
from pcsr_plugins.shapes.blobs.sdf import ellipsoid
from pcsr_plugins.shapes.shared.surfaces import FLATTEST, GRID

FINGERPRINTS = Path(__file__).with_name("blobs.json")
"""Numbers of the first body of each family. `python test_blobs.py` rewrites them."""


@cache
def body(name):
    return Blobs().item(name).mesh


def fingerprint(mesh):
    """What a machine whose sines differ in the last bit still reproduces."""
    return [round(float(number), 3) for number in [mesh.area, mesh.volume, *mesh.extents, *mesh.center_mass]]


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_every_body_is_sound_and_no_two_are_alike(family):
    looks = []
    for split in ("train", "validation", "test"):
        mesh = body(f"{split}/{family}/0000")
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        assert mesh.body_count == 1
        assert mesh.volume > 0.1 * mesh.convex_hull.volume
        assert 30 < mesh.extents.max() < 180
        assert np.abs(mesh.vertices).max() < REACH - 10
        assert 10_000 <= len(mesh.faces) <= 40_000
        assert mesh.area_faces.min() > FLATTEST
        looks.append([*np.log(mesh.extents / mesh.extents.max()), np.log(mesh.volume / mesh.convex_hull.volume)])
    for one, other in combinations(np.array(looks), 2):
        assert np.abs(one - other).max() > 0.02  # not one shape, scaled


@pytest.mark.parametrize("family", FAMILIES)
def test_surfaces_are_smooth(family):
    """Hardly an edge is sharp; of a machined part a third are."""
    mesh = body(f"train/{family}/0000")
    assert np.quantile(mesh.face_adjacency_angles, 0.5) < np.radians(8)
    assert np.mean(mesh.face_adjacency_angles > np.radians(45)) < 0.02


def test_rings_and_loops_have_holes():
    def holes(name):
        return (2 - body(name).euler_number) // 2

    assert holes("train/ring-body/0000") == holes("train/knot/0000") == 1
    assert holes("train/loops/0000") >= 2
    assert holes("train/stone-fruit/0000") == holes("train/fish/0000") == 0


def test_the_same_bodies_on_every_machine():
    stored = json.loads(FINGERPRINTS.read_text())
    assert list(stored) == list(FAMILIES)
    for family, numbers in stored.items():
        # The position of a vertex is known to a hundredth of a mm, wherever a sign on the grid may have flipped.
        np.testing.assert_allclose(fingerprint(body(f"train/{family}/0000")), numbers, rtol=1e-5, atol=1e-2)


def test_vertices_lie_on_the_grid():
    vertices = body("train/bird/0000").vertices / GRID
    np.testing.assert_allclose(vertices, np.round(vertices), atol=1e-3)


def test_generating_again_gives_the_same_bits_and_another_seed_another_body():
    first, again = (Blobs().item("train/pear/0001").mesh for _ in range(2))
    assert first.vertices.tobytes() == again.vertices.tobytes()
    assert first.faces.tobytes() == again.faces.tobytes()
    other = Blobs(seed=1).item("train/pear/0001").mesh
    assert abs(first.volume - other.volume) > 1
    assert Blobs().digest("train/pear/0001") != Blobs(seed=1).digest("train/pear/0001")


def test_families_come_in_turn_and_names_are_unique():
    shapes = Blobs(count=2 * len(FAMILIES) + 3, held_out=5)
    names = shapes.names("train")
    assert len(set(names)) == len(names) == 2 * len(FAMILIES) + 3
    assert [name.split("/")[1] for name in names[: len(FAMILIES)]] == list(FAMILIES)
    assert len(shapes.names("validation")) == len(shapes.names("test")) == 5
    assert Blobs(count=1).names("train") == names[:1]


def test_all_families_are_there_and_items_carry_theirs():
    written = [
        f
        for module in (animals, figures, fruit, growths, rings, vessels)
        for f in vars(module).values()
        if getattr(f, "__module__", "") == module.__name__ and not f.__name__.startswith("_")
    ]
    assert {f.__name__.replace("_", "-") for f in written} == set(FAMILIES)
    assert all(f.__doc__ for f in written)
    assert Blobs().item("test/pear/0000").group == "pear"


def test_what_a_worker_is_sent_is_small():
    assert len(ForkingPickler.dumps(Blobs(count=100_000))) < 300


@pytest.mark.parametrize(
    "name", ["train/gear/0000", "tests/pear/0000", "pear", "train/pear/x", "train/pear/-1", "train/pear/0500", ""]
)
def test_an_unknown_body_is_named(name):
    with pytest.raises(UserError, match=f"blobs has no object '{name}'"):
        Blobs().item(name)


def test_an_unknown_split_and_a_negative_count_are_named():
    with pytest.raises(UserError, match="blobs has no split 'val': it has train, validation, test"):
        Blobs().names("val")
    with pytest.raises(UserError, match="blobs: count 5 and held_out -2 must not be negative"):
        Blobs(count=5, held_out=-2)


def test_bodies_in_pieces_or_without_any_are_drawn_again(monkeypatch):
    ball, other = (ellipsoid((x, 0, 0), (20, 20, 20)) for x in (-30, 30))
    tries = [lambda at: np.minimum(ball(at), other(at)), lambda at: 0 * at[:, 0] + 9, ball]
    monkeypatch.setitem(FAMILIES, "pear", lambda draw: tries.pop(0))
    assert Blobs().item("train/pear/0000").mesh.volume == pytest.approx(33_510, rel=1e-2)
    assert not tries


if __name__ == "__main__":
    prints = {family: fingerprint(body(f"train/{family}/0000")) for family in FAMILIES}
    lines = [f'  "{family}": {json.dumps(numbers)}' for family, numbers in prints.items()]
    FINGERPRINTS.write_text("{\n" + ",\n".join(lines) + "\n}\n")
