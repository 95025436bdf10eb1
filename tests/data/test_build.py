"""A build that is stopped goes on, and ends with the bytes of one that was not."""

import itertools
import json
import os
import signal
import subprocess
import sys
import time

import pytest
import torch

from pcsr import RunError, UserError
from pcsr.data import build as module
from pcsr.data import shards
from pcsr.data.build import build_split, load_or_build
from pcsr.data.dataset import Split
from pcsr.data.plan import Plan
from pcsr.data.shards import MANIFEST, damaged, read_manifest, shard_path, write_manifest
from pcsr.files import sha256
from pcsr.workers import WorkerPool, worker_pool

ALONE = WorkerPool(None, 1)


@pytest.fixture(autouse=True)
def small_shards(monkeypatch):
    monkeypatch.setattr(module, "SHARD", 4)


def files(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_a_split_is_built_in_shards_and_read_back(recipe, registry, tmp_path):
    plan = Plan.of(recipe("count=10"), registry)
    counts = []
    split = load_or_build(plan, "train", tmp_path, ALONE, counts.append)
    assert split.names == list(plan.names["train"])
    assert sum(counts) == 10
    assert sorted(p.name for p in tmp_path.glob("*.safetensors")) == [f"train-0000{i}.safetensors" for i in range(3)]
    assert split.truth[9].shape == (64, 3)
    assert split.points[9].shape == (16, 3)
    assert split.touches[9].shape == (2, 20, 3)
    # Ball 9 has radius 10, and its truth fills the unit sphere.
    assert float(split.truth[9].norm(dim=-1).max()) == pytest.approx(1, abs=1e-6)
    assert split.spheres[9].radius == pytest.approx(10, rel=0.1)
    assert 0 < split.coverage(1) < split.coverage(2) < 1
    assert split.coverage(0) == 0
    assert split.about["fingerprint"] == plan.fingerprint


def test_what_is_there_is_not_made_again(recipe, registry, tmp_path):
    mark = tmp_path / "made"
    plan = Plan.of(recipe("count=10", mark=str(mark)), registry)
    build_split(plan, "train", tmp_path / "data", ALONE)
    assert len(mark.read_text().split()) == 10
    build_split(plan, "train", tmp_path / "data", ALONE)
    assert len(mark.read_text().split()) == 10
    shard_path(tmp_path / "data", "train", 1).unlink()
    build_split(plan, "train", tmp_path / "data", ALONE)
    assert mark.read_text().split()[10:] == [f"train/00{i}" for i in range(4, 8)]


def damage(folder, kind):
    """Something that happened to a folder's training data."""
    path = shard_path(folder, "train", 1)
    whole = path.read_bytes()
    if kind == "torn":
        path.write_bytes(whole[:100])
    elif kind == "foreign":
        path.write_bytes(b"something else")
    elif kind == "bit":
        path.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
    elif kind == "missing":
        path.unlink()
    elif kind == "neighbour":
        path.write_bytes(shard_path(folder, "train", 0).read_bytes())
    elif kind == "exchanged":
        other = shard_path(folder, "test", 0)
        path = shard_path(folder, "train", 0)
        one, two = path.read_bytes(), other.read_bytes()
        path.write_bytes(two)
        other.write_bytes(one)
    elif kind == "manifest":
        manifest = json.loads((folder / MANIFEST).read_text())
        train = manifest["splits"]["train"]
        train["objects"] -= train["shards"].pop()["objects"]
        (folder / MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n")


DAMAGE = ["torn", "foreign", "bit", "missing", "neighbour", "exchanged"]


@pytest.mark.parametrize("kind", DAMAGE)
def test_damaged_data_is_refused_where_it_is_read(recipe, registry, tmp_path, kind):
    plan = Plan.of(recipe("count=10", "held_out=4"), registry)
    for split in ("train", "test"):
        build_split(plan, split, tmp_path, ALONE)
    damage(tmp_path, kind)
    with pytest.raises(UserError, match=r"train-0000\d\.safetensors (is|has) .*: run the command that built it again"):
        Split.load(tmp_path, "train")
    said = damaged(tmp_path, read_manifest(tmp_path))
    assert len(said) == (2 if kind == "exchanged" else 1)


@pytest.mark.parametrize(("kind", "listed"), [*itertools.product(DAMAGE, [True, False]), ("manifest", True)])
def test_a_damaged_shard_is_made_again_with_the_same_bytes(recipe, registry, tmp_path, kind, listed):
    """With `listed` off the build was stopped: the manifest has no hashes yet, and the shards' cards have to do."""
    plan = Plan.of(recipe("count=10", "held_out=4"), registry)
    for split in ("train", "test"):
        build_split(plan, split, tmp_path, ALONE)
    whole = files(tmp_path)
    if not listed:
        manifest = read_manifest(tmp_path)
        write_manifest(tmp_path, manifest.model_copy(update={"splits": {}}))
    damage(tmp_path, kind)
    for split in ("train", "test"):
        build_split(plan, split, tmp_path, ALONE)
    if listed or kind != "bit":  # that of a shard which nobody has hashed yet stays
        assert files(tmp_path) == whole


def test_a_shard_is_hashed_once_in_a_process_unless_it_changes(recipe, registry, tmp_path, monkeypatch):
    build_split(Plan.of(recipe("count=10"), registry), "train", tmp_path, ALONE)
    read = []
    monkeypatch.setattr(shards, "sha256", lambda path: read.append(path) or sha256(path))
    Split.load(tmp_path, "train")
    assert read == [], "the build has just hashed them"
    path = shard_path(tmp_path, "train", 1)
    path.write_bytes(path.read_bytes())
    for _ in range(2):
        Split.load(tmp_path, "train")
    assert read == [path]


def test_a_stop_at_any_object_changes_no_byte(recipe, registry, tmp_path):
    plan = Plan.of(recipe("count=10"), registry)
    build_split(plan, "train", tmp_path / "whole", ALONE)
    for stop in (1, 4, 6, 10):
        done = 0

        def advance(count, stop=stop):
            nonlocal done
            done += count
            if done >= stop:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            build_split(plan, "train", tmp_path / str(stop), ALONE, advance)
        assert len(list((tmp_path / str(stop)).glob("*.safetensors"))) == (stop - 1) // 4
        build_split(plan, "train", tmp_path / str(stop), ALONE)
        assert files(tmp_path / str(stop)) == files(tmp_path / "whole")


@pytest.mark.slow
def test_two_processes_make_the_same_bytes_as_one(recipe, registry, tmp_path):
    plan = Plan.of(recipe("count=12", "held_out=2", bad=[5]), registry)
    for split in ("train", "test"):
        build_split(plan, split, tmp_path / "one", ALONE)
    with worker_pool(2) as two:
        for split in ("train", "test"):
            build_split(plan, split, tmp_path / "two", two)
    assert files(tmp_path / "one") == files(tmp_path / "two")


def test_every_object_is_in_the_data_or_among_the_rejected_with_its_reason(recipe, registry, tmp_path):
    plan = Plan.of(recipe("count=10", bad=[2, 4, 5, 6, 7]), registry)
    split = load_or_build(plan, "train", tmp_path, ALONE)
    about = read_manifest(tmp_path).splits["train"]
    assert set(split.names) | set(about.rejected) == set(plan.names["train"])
    assert about.rejected == {f"train/00{i}": f"train/00{i}: a bad ball" for i in (2, 4, 5, 6, 7)}
    assert [shard.objects for shard in about.shards] == [3, 0, 2]
    assert split.about["rejected"] == about.rejected
    assert about.coverage[1].touches == 2
    assert about.coverage[1].mean == pytest.approx(split.coverage(2))


def test_a_split_without_a_usable_object_is_kept_and_said(recipe, registry, tmp_path):
    plan = Plan.of(recipe("count=2", bad=[0, 1]), registry)
    with pytest.raises(UserError, match="none of the objects of the split 'train' could be used: train/000: a bad"):
        load_or_build(plan, "train", tmp_path, ALONE)
    assert len(read_manifest(tmp_path).splits["train"].rejected) == 2


def test_a_fault_of_a_plugin_costs_one_object_and_is_tried_again(recipe, registry, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plan = Plan.of(recipe("count=10", "touch.fault=train/006"), registry)
    build_split(plan, "train", tmp_path / "data", ALONE)
    about = read_manifest(tmp_path / "data").splits["train"]
    assert about.rejected == {"train/006": "train/006: ZeroDivisionError: a slip of the plugin"}
    assert (about.faults, about.objects) == (1, 9)
    (tmp_path / "train-006").touch()  # mended
    build_split(plan, "train", tmp_path / "data", ALONE)
    about = read_manifest(tmp_path / "data").splits["train"]
    assert (about.faults, about.objects, about.rejected) == (0, 10, {})


def test_a_folder_of_other_data_is_left_alone(recipe, registry, tmp_path):
    build_split(Plan.of(recipe("count=4"), registry), "train", tmp_path, ALONE)
    before = files(tmp_path)
    with pytest.raises(UserError, match=r"holds other data .* choose another folder, or delete this one"):
        build_split(Plan.of(recipe("count=5"), registry), "train", tmp_path, ALONE)
    assert files(tmp_path) == before


def test_shards_without_a_manifest_are_used_if_they_are_of_this_data_and_left_alone_otherwise(
    recipe, registry, tmp_path
):
    mine, other = Plan.of(recipe("count=4"), registry), Plan.of(recipe("count=5"), registry)
    build_split(mine, "train", tmp_path, ALONE)
    before = files(tmp_path)
    (tmp_path / MANIFEST).unlink()
    with pytest.raises(UserError, match=r"train-00000\.safetensors belongs to other data"):
        build_split(other, "train", tmp_path, ALONE)
    build_split(mine, "train", tmp_path, ALONE)
    assert files(tmp_path) == before
    (tmp_path / MANIFEST).unlink()
    (tmp_path / "train-00000.safetensors").write_bytes(b"somebody's")
    with pytest.raises(UserError, match="is not a shard of pcsr data"):
        build_split(mine, "train", tmp_path, ALONE)
    assert (tmp_path / "train-00000.safetensors").read_bytes() == b"somebody's"


def test_splits_are_built_one_by_one_into_one_manifest(recipe, registry, tmp_path):
    plan = Plan.of(recipe("count=2", "held_out=1"), registry)
    for split in ("test", "train", "validation"):
        build_split(plan, split, tmp_path, ALONE)
    manifest = read_manifest(tmp_path)
    assert list(manifest.splits) == ["train", "validation", "test"]
    assert manifest.fingerprint == plan.fingerprint
    assert manifest.data.touch.use == "caps"
    assert manifest.splits["train"].sensors == ("cap",)


def test_touches_of_unequal_size_are_refused_by_name(recipe, registry, tmp_path):
    with pytest.raises(UserError, match=r"train-00000.*a touch source must return touches of equal size"):
        build_split(Plan.of(recipe("count=4", "touch.uneven=true"), registry), "train", tmp_path, ALONE)


def test_a_full_disk_is_one_line_and_loses_nothing(recipe, registry, tmp_path, monkeypatch):
    plan = Plan.of(recipe("count=10"), registry)
    real, calls = os.replace, []

    def full(source, target):
        calls.append(target)
        if str(target).endswith("00001.safetensors"):
            raise OSError(28, "No space left on device")
        real(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        with pytest.raises(RunError, match=r"00001\.safetensors could not be written: No space left"):
            build_split(plan, "train", tmp_path, ALONE)
    assert sorted(p.name for p in tmp_path.iterdir()) == [MANIFEST, "train-00000.safetensors"]
    build_split(plan, "train", tmp_path, ALONE)
    assert len(Split.load(tmp_path, "train")) == 10


def test_what_is_read_is_mapped_not_copied(recipe, registry, tmp_path):
    split = load_or_build(Plan.of(recipe("count=4"), registry), "train", tmp_path, ALONE)
    shared = {cloud.untyped_storage().data_ptr() for cloud in split.truth}
    assert len(shared) == 1
    assert torch.equal(split.truth[0], Split.load(tmp_path, "train").truth[0])


@pytest.mark.slow
def test_a_kill_in_the_middle_then_the_same_command_gives_the_same_bytes(world, tmp_path):
    command = [
        sys.executable, "-m", "pcsr.cli", "data", "make", "balls", "--plugin", str(world), "--set", "touch=caps",
        "--set", "points=16", "--set", "rate=64", "--set", "touches=2", "--set", "count=130", "--jobs", "2",
    ]  # fmt: skip
    for folder in ("whole", "killed"):
        made = tmp_path / folder
        process = subprocess.Popen(
            [*command, "-o", str(made)], start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        if folder == "killed":
            end = time.monotonic() + 60
            while not list(made.glob("train-*.safetensors")) and time.monotonic() < end:
                time.sleep(0.005)
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            assert "train" not in json.loads((made / MANIFEST).read_text())["splits"], "it was killed too late"
            process = subprocess.Popen([*command, "-o", str(made)], stdout=subprocess.DEVNULL)
        assert process.wait(timeout=120) == 0
    whole, killed = files(tmp_path / "whole"), files(tmp_path / "killed")
    assert {name: data for name, data in killed.items() if not name.startswith(".")} == whole


def test_a_split_that_nobody_built_says_why(recipe, registry, tmp_path):
    build_split(Plan.of(recipe("count=2"), registry), "train", tmp_path, ALONE)
    with pytest.raises(UserError, match=r"no split 'test' \(it has: train\): shapes 'balls' have no object"):
        Split.load(tmp_path, "test")
