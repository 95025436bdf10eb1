"""Shards and manifests: read back as written, refused by name where they are not what they should be."""

import json

import numpy as np
import pytest
import torch

from pcsr import UserError
from pcsr.data.dataset import Split
from pcsr.data.sample import Rejection, Sample
from pcsr.data.shards import (
    MANIFEST,
    read_card,
    read_clouds,
    read_manifest,
    shard_path,
    write_shard,
)
from pcsr.files import sha256
from pcsr.geometry.frames import UnitSphere


def sample(name, touches=2, seed=0):
    rng = np.random.default_rng(seed)
    return Sample(
        name=name,
        group=f"group of {name}",
        truth=rng.normal(size=(40, 3)).astype(np.float32),
        points=rng.normal(size=(10, 3)).astype(np.float32),
        touches=rng.normal(size=(touches, 8, 3) if touches else (0, 0, 3)).astype(np.float32),
        sphere=UnitSphere(np.array([1e6, 0.1, 2.0]), 0.3),
        coverage=(0.1, 0.2)[:touches],
        sensor="digit",
    )


PRINT = "ab" * 32


def write(folder, results, number=0, fingerprint=PRINT):
    write_shard(shard_path(folder, "train", number), results, fingerprint)


def manifest(folder, shards, **changes):
    """Write a manifest of training shards that are there; `changes` go into what it says of the split."""
    paths = [shard_path(folder, "train", number) for number in shards]
    cards = [read_card(path) for path in paths]
    shares = [row for card in cards for row in card.coverage]
    touches = len(shares[0]) if shares else 2
    train = {
        "objects": len(shares),
        "groups": 1,
        "sensors": ["digit"],
        "coverage": [{"touches": k + 1, "mean": 0.1, "p10": 0.1, "p50": 0.1, "p90": 0.1} for k in range(touches)],
        "rejected": {},
        "faults": 0,
        "shards": [
            {"file": path.name, "objects": len(card.names), "sha256": sha256(path)}
            for path, card in zip(paths, cards, strict=True)
        ],
    }
    data = {
        "shapes": {"use": "balls"}, "touch": {"use": "caps"}, "touches": touches, "points": 10, "rate": 4,
        "truth": "fps", "sampling": "random", "view": {}, "seed": 0,
    }  # fmt: skip
    whole = {"format": 1, "made_by": "pcsr 0", "fingerprint": PRINT, "data": data, "empty": {}}
    (folder / MANIFEST).write_text(json.dumps({**whole, "splits": {"train": {**train, **changes}}}))


def test_objects_come_back_as_they_were(tmp_path):
    made = [sample("a", seed=1), sample("b", seed=2), sample("c", seed=3)]
    write(tmp_path, [("a", made[0]), ("bad", Rejection("bad: no")), ("b", made[1])])
    write(tmp_path, [("c", made[2])], number=1)
    manifest(tmp_path, [0, 1])
    split = Split.load(tmp_path, "train")
    assert split.names == ["a", "b", "c"]
    assert split.groups == ["group of a", "group of b", "group of c"]
    assert split.about == {"fingerprint": PRINT, "rejected": {"bad": "bad: no"}}
    for k, one in enumerate(made):
        for name in ("truth", "points", "touches"):
            assert torch.equal(getattr(split, name)[k], torch.from_numpy(getattr(one, name)))
        np.testing.assert_array_equal(split.spheres[k].centre, one.sphere.centre)
        assert split.spheres[k].radius == one.sphere.radius
    assert (split.coverage(0), split.coverage(1), split.coverage(2)) == (0, pytest.approx(0.1), pytest.approx(0.2))


def test_a_shard_may_hold_nothing_but_reasons(tmp_path):
    write(tmp_path, [("a", Rejection("a: no", fault=True)), ("b", Rejection("b: no"))])
    card = read_card(shard_path(tmp_path, "train", 0))
    assert (card.names, card.faults, len(card.rejected)) == ((), 1, 2)
    assert read_clouds(shard_path(tmp_path, "train", 0))["truth"].numel() == 0


def test_objects_without_touches_have_none(tmp_path):
    write(tmp_path, [("a", sample("a", touches=0))])
    manifest(tmp_path, [0])
    split = Split.load(tmp_path, "train")
    assert split.touches[0].shape == (0, 0, 3)
    assert split.coverage(0) == 0


def test_the_same_objects_give_the_same_bytes(tmp_path):
    for name in ("one", "two"):
        write(tmp_path / name, [("a", sample("a")), ("bad", Rejection("no"))])
    one, two = (shard_path(tmp_path / name, "train", 0).read_bytes() for name in ("one", "two"))
    assert one == two


def test_spread_takes_from_the_whole_split(tmp_path):
    write(tmp_path, [(str(i), sample(str(i), seed=i)) for i in range(10)])
    manifest(tmp_path, [0])
    split = Split.load(tmp_path, "train")
    few = split.spread(3)
    assert few.names == ["0", "3", "6"]
    assert torch.equal(few.truth[2], split.truth[6])
    assert split.spread(99).names == split.names


@pytest.mark.parametrize("content", [b"", b"noise", b'\x08\0\0\0\0\0\0\0{"a":1}}'])
def test_a_file_that_is_no_shard_is_named(tmp_path, content):
    path = tmp_path / "x.safetensors"
    path.write_bytes(content)
    with pytest.raises(
        UserError, match=r"x\.safetensors is not a shard of pcsr data .*: run the command that built it again"
    ):
        read_card(path)


def test_weights_are_no_shard(tmp_path):
    from safetensors.torch import save_file

    save_file({"w": torch.zeros(1)}, tmp_path / "w.safetensors", {"pcsr": "{}"})
    with pytest.raises(UserError, match="is not a shard"):
        read_card(tmp_path / "w.safetensors")


def test_a_missing_shard_is_named(tmp_path):
    write(tmp_path, [("a", sample("a"))])
    manifest(tmp_path, [0])
    shard_path(tmp_path, "train", 0).unlink()
    with pytest.raises(UserError, match=r"train-00000\.safetensors is missing: run the command that built it again"):
        Split.load(tmp_path, "train")


def test_a_shard_of_other_data_is_named(tmp_path):
    write(tmp_path, [("a", sample("a"))], fingerprint="cd" * 32)
    manifest(tmp_path, [0])
    with pytest.raises(UserError, match=r"train-00000\.safetensors belongs to other data"):
        Split.load(tmp_path, "train")


def test_a_split_that_is_not_there_is_named(tmp_path):
    manifest(tmp_path, [])
    with pytest.raises(UserError, match=r"has no split 'test' \(it has: train\)"):
        Split.load(tmp_path, "test")


def test_a_folder_without_a_manifest_is_named(tmp_path):
    with pytest.raises(UserError, match=r"holds no manifest\.json: give a folder that `pcsr data make` built"):
        read_manifest(tmp_path)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": 1}', '{"format": 1, "fingerprint": "a", "splits": 3}'])
def test_a_manifest_that_is_none_is_named(tmp_path, text):
    (tmp_path / MANIFEST).write_text(text)
    with pytest.raises(UserError, match="is not a manifest of pcsr data"):
        read_manifest(tmp_path)


def test_a_manifest_of_a_later_format_is_named(tmp_path):
    (tmp_path / MANIFEST).write_text(json.dumps({"format": 99}))
    with pytest.raises(UserError, match="has format 99, and this version of pcsr reads 1: build the data again"):
        read_manifest(tmp_path)
