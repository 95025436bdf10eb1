"""A plan's fingerprint hangs on all that decides the data, and on nothing else."""

import pytest
import trimesh

import pcsr.data.plan
from pcsr import ShapeItem, ShapeSource, UserError
from pcsr.data.plan import Plan
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import for_data


def fingerprint(recipe, registry):
    return Plan.of(recipe, registry).fingerprint


def test_a_plan_names_every_object_and_the_splits_that_have_none(recipe, registry):
    plan = Plan.of(recipe("count=3"), registry)
    assert plan.names == {"train": ["train/000", "train/001", "train/002"]}
    assert plan.empty.keys() == {"validation", "test"}
    assert plan.split("train") == plan.names["train"]
    with pytest.raises(UserError, match="shapes 'balls' have no object in the split 'test'"):
        plan.split("test")


def test_nothing_at_all_to_build_is_said(recipe, registry):
    with pytest.raises(UserError, match="'balls' have no object in the split 'train'"):
        Plan.of(recipe("count=0"), registry)


@pytest.mark.parametrize(
    "change",
    ["count=4", "points=17", "rate=5", "touches=3", "seed=1", "truth=fps", "sampling=fps", "touch.points=21"],
)
def test_what_decides_the_data_changes_the_fingerprint(recipe, registry, change):
    assert fingerprint(recipe("count=3", change), registry) != fingerprint(recipe("count=3"), registry)


def test_the_camera_counts_only_where_it_is_used(recipe, registry):
    assert fingerprint(recipe("view.noise=0.1"), registry) == fingerprint(recipe(), registry)
    seen = [fingerprint(recipe("sampling=view", f"view.noise={noise}"), registry) for noise in (0.0, 0.1)]
    assert seen[0] != seen[1]


def test_every_key_of_the_registration_counts_and_so_does_its_version(recipe, registry, monkeypatch):
    changes = ["registration={}", "registration.position=0.5", "registration.rotation=0.5", "registration=null"]
    prints = [fingerprint(recipe(change), registry) for change in changes]
    assert len(set(prints)) == len(changes)
    assert prints[-1] == fingerprint(recipe(), registry)
    untouched = [recipe("touches=0", change) for change in changes]
    assert len({fingerprint(one, registry) for one in untouched}) == 1
    monkeypatch.setattr(pcsr.data.plan, "REGISTRATION", 2)
    assert [fingerprint(recipe(change), registry) == known for change, known in zip(changes, prints, strict=True)] == [
        False, False, False, True,
    ]  # fmt: skip


def test_a_part_with_a_new_version_gives_new_data(recipe, registry, monkeypatch):
    before = fingerprint(recipe(), registry)
    for kind, name in (("touch", "caps"), ("shapes", "balls")):
        with monkeypatch.context() as patch:
            patch.setattr(registry.get(kind, name), "version", 2)
            assert fingerprint(recipe(), registry) != before
    assert fingerprint(recipe(), registry) == before


def test_the_fingerprint_of_meshes_hangs_on_their_content_not_on_their_place(tmp_path):
    registry = load_plugins()
    prints = {}
    for name, size in (("here", 1), ("there", 1), ("other", 2)):
        folder = tmp_path / name
        folder.mkdir()
        trimesh.creation.box((size, 2, 3)).export(folder / "box.stl")
        settings = ["shapes.validation=0.0", "shapes.test=0.0"]
        prints[name] = fingerprint(for_data("meshes", {"folder": str(folder)}, registry, settings), registry)
    assert prints["here"] == prints["there"] != prints["other"]


def test_a_split_of_meshes_that_no_file_fell_to_is_no_error(tmp_path):
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "box.stl")
    registry = load_plugins()
    settings = ["shapes.validation=0.0", "shapes.test=1e-9"]
    plan = Plan.of(for_data("meshes", {"folder": str(tmp_path)}, registry, settings), registry)
    assert list(plan.names) == ["train"]
    assert "take another seed" in plan.empty["test"]


def test_without_a_digest_of_its_own_an_object_is_its_mesh():
    class Box(ShapeSource):
        size = 1.0

        def item(self, name):
            if name == "bad":
                raise UserError("bad: no")
            return ShapeItem(name, name, trimesh.creation.box((1, 1, self.size)))

    one, other = Box(), Box()
    other.size = 2.0
    assert one.digest("a") == one.digest("b") != other.digest("a")
    assert one.digest("bad") == "refused: bad: no"
