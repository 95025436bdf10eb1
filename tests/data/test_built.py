"""Data that is built already: one folder or several as one, and a recipe on it."""

import hashlib
import json
import shutil
from pathlib import Path

import pytest
import torch

from pcsr import PcsrWarning, UserError
from pcsr.data.build import build_split
from pcsr.data.built import BuiltData
from pcsr.data.dataset import Split
from pcsr.data.plan import Plan
from pcsr.data.shards import MANIFEST, damaged, read_manifest, write_manifest
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import for_data
from pcsr.workers import worker_pool
from pcsr_plugins.touch.digit import Digit


@pytest.fixture(scope="module")
def folders(tmp_path_factory, registry, world):
    """Makes a folder of data and returns it, the same for the same settings."""
    made = {}

    def make(recipe, *splits):
        plan = Plan.of(recipe, registry)
        if (plan.fingerprint, splits) not in made:
            made[plan.fingerprint, splits] = folder = tmp_path_factory.mktemp("data")
            with worker_pool(1) as workers:
                for split in splits or plan.names:
                    build_split(plan, split, folder, workers)
        return made[plan.fingerprint, splits]

    return make


@pytest.fixture
def two(recipe, folders):
    """Three objects to train on, two to validate and two to test; then four, of a kind without held-out ones."""
    return folders(recipe("count=3", "held_out=2")), folders(recipe("count=4", "seed=1", "bad=[1]", "touches=3"))


def test_one_folder_is_what_it_is(two):
    (folder, _), built = two, BuiltData.read(two[:1])
    assert built.fingerprint == read_manifest(folder).fingerprint
    assert (built.joined, built.missing()) == ((), [])
    one, other = built.split("train"), Split.load(folder, "train")
    assert (one.names, one.about) == (other.names, other.about)
    assert all(torch.equal(a, b) for a, b in zip(one.touches, other.touches, strict=True))


def test_a_joined_split_holds_every_object_of_its_folders_in_order(two):
    whole, (first, second) = BuiltData.read(two).split("train"), (Split.load(folder, "train") for folder in two)
    assert whole.names == [*first.names, *second.names] == [f"train/{n:03d}" for n in (0, 1, 2, 0, 2, 3)]
    assert whole.groups == [*first.groups, *second.groups]
    for k, (split, row) in enumerate([*((first, i) for i in range(3)), *((second, i) for i in range(3))]):
        assert torch.equal(whole.truth[k], split.truth[row])
        assert torch.equal(whole.points[k], split.points[row])
        assert torch.equal(whole.touches[k], split.touches[row][:2]), "as many as all have"
        assert whole.spheres[k] is not None
        assert list(whole.covered[k]) == list(split.covered[row][:2])
    assert torch.stack(list(whole.touches)).shape == (6, 2, 20, 3)
    assert whole.about["rejected"] == {"2: train/001": "train/001: a bad ball"}


def test_the_fingerprint_is_a_hash_of_theirs_in_order(two):
    prints = [read_manifest(folder).fingerprint for folder in two]
    built, swapped = BuiltData.read(two), BuiltData.read(two[::-1])
    assert built.fingerprint == hashlib.sha256(json.dumps(prints).encode()).hexdigest()
    assert built.fingerprint != swapped.fingerprint
    assert built.joined == tuple(prints) == swapped.joined[::-1]
    assert built.split("train").about["fingerprint"] == built.split("test").about["fingerprint"] == built.fingerprint


@pytest.mark.parametrize("order", [1, -1])
def test_where_a_folder_lacks_a_split_the_others_serve(two, order):
    built = BuiltData.read(two[::order])
    assert built.split("test").names == ["test/000", "test/001"]
    said = built.missing()
    assert [line.partition(":")[0] for line in said] == [
        f"{two[1]} has no split '{split}'" for split in ("validation", "test")
    ]
    assert "have no object in the split 'test'" in said[1]


def test_a_folder_that_is_not_built_to_its_end_is_told(two, recipe, folders):
    stopped = folders(recipe("count=3", "held_out=2", "seed=9"), "train")
    said = BuiltData.read([two[0], stopped]).missing()
    assert said[-1] == f"{stopped} has no split 'test': it is not finished"


def test_a_split_that_none_has_is_the_error_of_one_folder(recipe, folders):
    pair = [folders(recipe("count=2", f"seed={seed}")) for seed in (0, 1)]
    for some in (pair, pair[:1]):
        with pytest.raises(UserError, match=rf"{pair[0]} has no split 'test' \(it has: train\): shapes 'balls' have"):
            BuiltData.read(some).split("test")


@pytest.mark.parametrize(("key", "here", "there"), [("points", 16, 32), ("rate", 4, 2)])
def test_folders_of_other_sizes_are_refused(two, recipe, folders, key, here, there):
    other = folders(recipe("count=2", f"{key}={there}"))
    with pytest.raises(UserError, match=rf"{two[0]} and {other} cannot be joined: {key} is {here} .* and {there} .*"):
        BuiltData.read([two[0], other])


def test_touches_of_other_sizes_are_refused_unless_there_are_none(two, recipe, folders):
    other = folders(recipe("count=2", "touch.points=10"))
    with pytest.raises(UserError, match=r"data cannot be joined: touches of 10 and 20 points"):
        BuiltData.read([two[0], other]).split("train")
    without = folders(recipe("count=2", "touches=0"))
    none = BuiltData.read([two[0], without]).split("train")
    assert torch.stack(list(none.touches)).numel() == 0
    assert none.coverage(0) == 0


def test_a_folder_given_twice_is_refused_however_it_is_written(two):
    with pytest.raises(UserError, match="is given twice"):
        BuiltData.read([two[0], two[1], two[0] / ".." / two[0].name])


def test_a_folder_of_something_else_is_refused(two, tmp_path):
    with pytest.raises(UserError, match=f"{tmp_path} holds no {MANIFEST}"):
        BuiltData.read([two[0], tmp_path])


def test_a_recipe_on_built_data_takes_all_but_its_touches(two, recipe, registry):
    wanted = recipe("touches=1", "points=32", "seed=5")
    on = BuiltData.read(two[:1]).replace_data(wanted, registry)
    assert (on.data.points, on.data.touches, on.data_seed, on.seed) == (16, 1, 0, 0)
    assert (on.data.shapes.options["count"], on.joined) == (3, ())


def test_a_recipe_on_several_tells_them_apart(two, recipe, registry):
    ons = [BuiltData.read(some).replace_data(recipe(), registry) for some in (two, two[::-1], two[:1])]
    assert len({on.fingerprint for on in ons}) == 3
    assert [len(on.joined) for on in ons] == [2, 2, 0]
    assert [on.data.shapes.options["count"] for on in ons] == [3, 3, 3], "the first with a split `test` says it"
    again = BuiltData.read(two[:1]).replace_data(ons[0], registry)
    assert again.fingerprint == ons[2].fingerprint


def test_each_folder_needs_the_touches_that_are_asked_for(two, recipe, registry):
    text = rf"{two[0]} has 2 touches of each object, and 'data' needs 3: .*--set touches=3"
    for some in (two, two[::-1]):
        with pytest.raises(UserError, match=text):
            BuiltData.read(some).replace_data(recipe("touches=3"), registry)
    assert BuiltData.read(two).replace_data(recipe("touches=2"), registry).data.touches == 2


def test_with_weights_only_the_touches_of_evaluation_are_needed(two, recipe, registry):
    eager = recipe("touches=1")
    eager = eager.model_copy(update={"train": eager.train.model_copy(update={"touches": (0, 5)})})
    with pytest.raises(UserError, match="needs 5"):
        BuiltData.read(two).replace_data(eager, registry)
    weights = {"use": "tapsr", "sha256": "0" * 64}
    plain = type(eager).model_validate(eager.model_dump() | {"weights": weights})
    assert BuiltData.read(two).replace_data(plain, registry).weights.use == "tapsr"


def test_samplings_that_differ_are_mixed(two, recipe, registry, folders):
    even = folders(recipe("count=2", "sampling=fps"))
    assert BuiltData.read(two).replace_data(recipe(), registry).data.sampling == "random"
    assert BuiltData.read([two[0], even]).replace_data(recipe(), registry).data.sampling == "mixed"


@pytest.mark.parametrize("wish", [{"metrics": ("cd", "p2f")}, {"baselines": ("floor",)}])
def test_meshes_of_several_folders_are_refused(two, recipe, registry, folders, wish):
    other = folders(recipe("count=1", "held_out=1"))
    moved = folders(recipe("count=3", "held_out=2", "seed=3"))
    wanted = recipe()
    wanted = wanted.model_copy(update={"evaluate": wanted.evaluate.model_copy(update=wish)})
    name = next(iter(wish.values()))[-1]
    with pytest.raises(
        UserError, match=rf"'{name}' needs the meshes, and the test objects of {two[0]} and {other} are"
    ):
        BuiltData.read([two[0], other]).replace_data(wanted, registry)
    BuiltData.read(two).replace_data(wanted, registry)  # only one has a split `test`
    BuiltData.read([two[0], moved]).replace_data(wanted, registry)  # the same shapes, seen anew


def test_the_card_lists_each_folder_without_where_it_lies(two):
    first, second = BuiltData.read(two).card()
    assert first["folder"] == two[0].name
    assert first["objects"] == {"train": 3, "validation": 2, "test": 2}
    assert (second["objects"], second["settings"]["seed"]) == ({"train": 3}, 1)
    assert [one["fingerprint"] for one in (first, second)] == list(BuiltData.read(two).joined)
    assert str(two[0].parent) not in json.dumps([first, second])


def test_a_manifest_without_settings_is_refused(tmp_path, two):
    manifest = json.loads((two[0] / MANIFEST).read_text())
    (tmp_path / MANIFEST).write_text(json.dumps({**manifest, "data": {}}))
    with pytest.raises(UserError, match=r"is not a manifest of pcsr data: data\.shapes: it is missing \(and 7 more\)"):
        BuiltData.read([two[0], tmp_path])


def test_a_folder_that_0_1_wrote_is_read_and_gone_on_with(tmp_path, monkeypatch):
    folder = Path(shutil.copytree(Path(__file__).with_name("version_0_1"), tmp_path / "data"))
    built = BuiltData.read([folder])
    assert damaged(folder, built.manifests[0]) == ()
    assert built.split("train").names == ["train/adapter/0000", "train/arch/0000"]
    assert torch.stack(list(built.split("test").touches)).shape == (1, 2, 8, 3)
    text = (folder / MANIFEST).read_bytes()
    write_manifest(folder, built.manifests[0])
    assert (folder / MANIFEST).read_bytes() == text
    small = ["count=2", "held_out=1", "points=16", "rate=2", "touch.points=8", "touches=2"]
    registry = load_plugins()
    assert Plan.of(for_data("cad-parts", {}, registry, small), registry).fingerprint != built.fingerprint
    monkeypatch.setattr(Digit, "version", 1)  # as it was in 0.1
    registry = load_plugins()
    plan = Plan.of(for_data("cad-parts", {}, registry, small), registry)
    assert plan.fingerprint == built.fingerprint
    with pytest.warns(PcsrWarning, match=r"uses names of pcsr 0\.1, which are still read: of touch 'digit' projection"):
        replaced = built.replace_data(plan.recipe, registry)
    assert replaced.data == plan.recipe.data.model_copy(update={"seed": 0})


def test_progress_is_told_in_objects(two):
    counts = []
    built = BuiltData.read(two)
    built.split("train", counts.append)
    assert sum(counts) == built.objects("train") == 6
    assert all(path.is_file() for path in built.shards("train"))
