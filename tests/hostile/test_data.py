"""Data folders that were damaged or forged, and sizes that nobody can make: each is refused soon and by name."""

import hashlib
import json
import os
import shutil
import struct
from dataclasses import replace
from pathlib import Path

import pytest
import torch
import trimesh
from safetensors import safe_open
from safetensors.torch import save_file

BUILT = Path(__file__).parents[1] / "data" / "version_0_1"
RECIPE = Path(__file__).parents[2] / "pcsr/recipes" / "smoke.yaml"
NAMES = [f"{split}-00000.safetensors" for split in ("train", "validation", "test")]


@pytest.fixture
def folder(tmp_path):
    return Path(shutil.copytree(BUILT, tmp_path / "data"))


def forge(folder, *keys, value):
    """Change one value of a manifest; a value that is a function makes it of the old one."""
    manifest = json.loads((folder / "manifest.json").read_text())
    *way, last = keys
    inner = manifest
    for key in way:
        inner = inner[key]
    inner[last] = value(inner[last]) if callable(value) else value
    (folder / "manifest.json").write_text(json.dumps(manifest))


def forge_shard(folder, change):
    """Change the training shard, its tensors or its card, and put its new hash into the manifest."""
    path = folder / NAMES[0]
    with safe_open(path, "pt") as file:
        tensors, card = {name: file.get_tensor(name) for name in file.keys()}, json.loads(file.metadata()["pcsr"])  # noqa: SIM118
    change(tensors, card)
    save_file(tensors, path, {"pcsr": json.dumps(card)})
    forge(folder, "splits", "train", "shards", 0, "sha256", value=hashlib.sha256(path.read_bytes()).hexdigest())


SHARDS = ("splits", "train", "shards")


@pytest.mark.parametrize(
    ("keys", "value", "said"),
    [
        (("format",), 2, "has format 2, and this version of pcsr reads 1: build the data again"),
        (("format",), "1", "format: it must be a whole number, got '1'"),
        (("fingerprint",), "x", "fingerprint: it must be text that matches"),
        (("data",), {}, "data.shapes: it is missing (and 7 more)"),
        (("data", "points"), "16", "data.points: it must be a whole number, got '16'"),
        (("data", "points"), True, "data.points: it must be a whole number"),
        (("data", "points"), 17, "'truth' has 32 rows for each object, but manifest.json lists 34"),
        (("data", "rate"), 3, "'truth' has 32 rows for each object, but manifest.json lists 48"),
        (("data", "shapes"), "cad-parts", "data.shapes: it must be a mapping, got 'cad-parts'"),
        (("data", "seed"), float("nan"), "data.seed: it must be a whole number"),
        (("splits",), [], "splits: it must be a mapping, got []"),
        (("splits", "other"), {}, "splits.other.objects: it is missing"),
        (("splits", "train", "objects"), 3, "splits.train.objects is 3, but its shards hold 2"),
        (("splits", "train", "rejected"), {"a": 3}, "splits.train.rejected: the reason for 'a' must be text"),
        (("splits", "train", "coverage"), [], "splits.train.coverage lists 0 touches, but data.touches is 2"),
        (("splits", "train", "coverage", 0, "mean"), 7, "coverage.0.mean: it must be at most 1"),
        ((*SHARDS,), lambda old: [*old, *old], "shards.1.file is 'train-00000.safetensors', not 'train-00001"),
        ((*SHARDS, 0, "file"), "../../x", "splits.train.shards.0.file is '../../x', not 'train-00000.safetensors'"),
        ((*SHARDS, 0, "file"), "/etc/passwd", "splits.train.shards.0.file is '/etc/passwd', not"),
        ((*SHARDS, 0, "file"), NAMES[2], f"splits.train.shards.0.file is '{NAMES[2]}', not"),
        ((*SHARDS, 0, "file"), "x" * 1_000_000, "splits.train.shards.0.file is 'xxx"),
        ((*SHARDS, 0, "sha256"), "0", "shards.0.sha256: it must be text that matches"),
        ((*SHARDS, 0, "sha256"), "0" * 64, "train-00000.safetensors has changed since it was built"),
        ((*SHARDS,), lambda old: old * 100_000, "splits.train.shards.1.file is 'train-00000.safetensors', not"),
        ((*SHARDS,), lambda old: old * 300_000, "has more than 33554432 bytes"),
        ((*SHARDS,), [3] * 1_000_000, "splits.train.shards.0: it must be a mapping, got 3"),
        (("splits", "train", "rejected"), {str(n): 0 for n in range(300_000)}, "the reason for '0' must be text"),
    ],
)  # fmt: skip
def test_a_forged_manifest_names_the_field(limited, folder, keys, value, said):
    forge(folder, *keys, value=value)
    outcome = limited("data", "info", "data", folder=folder.parent)
    outcome.refused("data/", said)
    assert len(outcome.err) < 600


def test_a_text_that_is_no_manifest_is_refused(limited, folder):
    path = folder / "manifest.json"
    for text in (
        b"",
        b"\xff\xfe",
        b"null",
        b"[" * 1_000_000,
        b'{"format": 1e999}',
        b'{"format": 1' + b" " * 40_000_000,
    ):
        path.write_bytes(text)
        limited("data", "info", "data", folder=folder.parent).refused(
            "data/manifest.json is not a manifest", "delete it"
        )


@pytest.mark.parametrize("name", ["manifest.json", "train-00000.safetensors"])
def test_what_is_no_file_is_never_opened(limited, folder, name):
    for put in (os.mkfifo, os.mkdir, lambda path: os.symlink("/dev/zero", path), lambda path: os.symlink(path, path)):
        path = folder / name
        path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink()
        put(path)
        limited("data", "info", "data", folder=folder.parent).refused(f"data/{name}")


def _names(tensors, card):
    card["names"].append("third")


def _all_names(tensors, card):
    for key in ("names", "groups", "spheres", "coverage"):
        card[key].append(card[key][0])


def _half(tensors, card):
    tensors["truth"] = tensors["truth"].half()


def _flat(tensors, card):
    tensors["points"] = tensors["points"].flatten(1)


def _plane(tensors, card):
    tensors["points"] = tensors["points"][..., :2].contiguous()


def _nan(tensors, card):
    tensors["touches"][1, 1, 3, 0] = torch.nan


def _without(tensors, card):
    del tensors["touches"]


def _point(tensors, card):
    card["spheres"][0][3] = 0.0


def _infinite(tensors, card):
    card["spheres"][0][0] = float("inf")


def _touches(tensors, card):
    card["coverage"] = [[*row, 1.0] for row in card["coverage"]]


def _uneven(tensors, card):
    card["coverage"][0].append(1.0)


def _other(tensors, card):
    card["fingerprint"] = "0" * 64


def _empty(tensors, card):
    card.clear()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (_names, "it has 3 names and 2 groups"),
        (_all_names, "its truth have shape (2, 32, 3), for 3 objects"),
        (_half, "its truth are F16 instead of F32"),
        (_flat, "its points have shape (2, 48)"),
        (_plane, "its points have shape (2, 16, 2)"),
        (_nan, "its touches have a coordinate that is not finite"),
        (_without, "it has no 'touches'"),
        (_point, "spheres.0.3: it must be more than 0, got 0.0"),
        (_infinite, "spheres.0.0: it must be a finite number, got inf"),
        (_touches, "its touches have shape (2, 2, 8, 3)"),
        (_uneven, "its coverage lists 2 and 3 touches"),
        (_other, "belongs to other data"),
        (_empty, "fingerprint: it is missing (and 7 more)"),
    ],
)
def test_a_forged_shard_is_refused_though_its_hash_is_right(limited, folder, change, said):
    forge_shard(folder, change)
    limited("data", "info", "data", folder=folder.parent).refused(
        "data/train-00000.safetensors", said, "built it again"
    )


def test_a_header_without_end_is_not_read(limited, folder):
    path = folder / NAMES[0]
    with path.open("wb") as file:
        file.write(struct.pack("<Q", 90 << 20))
        file.truncate(100 << 20)
    limited("data", "info", "data", folder=folder.parent).refused("its header has 94371840 bytes", megabytes=50)


def _exchange(folder, one, other):
    texts = [(folder / name).read_bytes() for name in (one, other)]
    for name, text in zip((other, one), texts, strict=True):
        (folder / name).write_bytes(text)


def _flip(folder, name):
    text = bytearray((folder / name).read_bytes())
    text[-100] ^= 1
    (folder / name).write_bytes(text)


DAMAGE = {
    "exchanged": lambda folder: _exchange(folder, NAMES[0], NAMES[2]),
    "a bit of the training data": lambda folder: _flip(folder, NAMES[0]),
    "a bit of the test data": lambda folder: _flip(folder, NAMES[2]),
    "the test data is the training data": lambda folder: shutil.copy(folder / NAMES[0], folder / NAMES[2]),
    "cut off": lambda folder: os.truncate(folder / NAMES[1], 900),
    "gone": lambda folder: (folder / NAMES[2]).unlink(),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_nothing_is_trained_on_damaged_data(limited, folder, damage):
    DAMAGE[damage](folder)
    few = ("--set", "data.touches=2", "--set", "train.touches=2", "--jobs", 1)
    outcome = limited("run", RECIPE, "--data", "data", *few, folder=folder.parent)
    warning, log, error = outcome.err.split("\n", 2)
    assert "names of pcsr 0.1" in warning
    assert "is replaced by data" in log
    replace(outcome, err=error).refused("data/", ".safetensors", "run the command that built it again")
    assert not (folder.parent / "runs").exists()
    assert "training" not in outcome.out


def test_a_thousand_million_points_are_refused_before_anything_is_made(limited, tmp_path):
    make = ("data", "make", "cad-parts", "-o", "out")
    for setting, said in {
        "points=1000000000": "data.points: it must be at most 1048576, got 1000000000",
        "points=1000000": "data.points × data.rate are 16000000 points of an object, more than 1048576",
        "rate=65": "data.rate: it must be at most 64",
        "view.pixels=20000": "data.view.pixels: it must be at most 4096, got 20000",
        "view={pixels: 4096, cameras: 64}": "64 cameras of 4096 × 4096 pixels are 1073741824 rays",
        "view.distance=1e300": "data.view.distance: it must be at most 1000",
        "count=1000000000": "shapes 'cad-parts'.count: it must be at most 1000000",
        f"shapes.seed=1{'0' * 90}": "shapes 'cad-parts'.seed: it must be less than 9223372036854775808",
        "touch.points=1000000000": "touch 'digit'.points: it must be at most 1048576",
        "touch.policy.tries=100000000": "touch 'digit'.policy.tries: it must be at most 10000, got 100000000",
        "touch.sensor.pixels=20000": "touch 'digit'.sensor.pixels: it must be at most 4096, got 20000",
        "touch.sensor.pixels=4000": "4000 × 3000 pixels are more than 1048576: lower pixels",
        "touch.sensor={height: 1000, width: 0.01}": "pixels are more than 1048576: lower pixels, or height beside",
        "touch.sensor.housing=[1.0, 1e9]": "touch 'digit'.sensor.housing.1: it must be at most 1000",
        "touch.noise.blur=500": "touch 'digit': blur is 500.0 mm, wider than the sensor",
    }.items():
        outcome = limited(*make, "--set", setting, "--jobs", 1, folder=tmp_path)
        outcome.refused(said, megabytes=100)
    assert not (tmp_path / "out").exists()


def test_no_command_takes_a_thousand_million_processes(limited, folder):
    for command in (("data", "make", "cad-parts", "-o", "out"), ("run", RECIPE, "--data", "data")):
        limited(*command, "--jobs", 10**18, folder=folder.parent).refused(f"jobs is {10**18}", "from 1 to 1024")


def test_more_touches_than_anybody_needs_are_refused(limited, tmp_path):
    trimesh.creation.icosphere(2).export(tmp_path / "ball.stl")
    touch = ("touch", "ball.stl", "-o", "touches")
    outcome = limited(*touch, "--count", 10_000, folder=tmp_path)
    assert outcome.code == 2
    assert "10000 is not in the range 1<=x<=2000" in outcome.err
    many = limited(*touch, "--count", 2000, "--set", "points=100000", folder=tmp_path)
    many.refused("2000 touches of 100000 points are 200000000 points, more than 4194304", megabytes=100)
    assert not (tmp_path / "touches").exists()


def test_an_object_beyond_all_numbers_costs_itself_alone(limited, tmp_path):
    (tmp_path / "parts").mkdir()
    for name, scale in (("good", 1.0), ("huge", 1e200), ("tiny", 1e-200)):
        ball = trimesh.creation.icosphere(1)
        lines = [f"v {' '.join(map(repr, map(float, row * scale)))}" for row in ball.vertices]
        lines += [f"f {' '.join(map(str, row + 1))}" for row in ball.faces]
        (tmp_path / "parts" / f"{name}.obj").write_text("\n".join(lines))
    settings = ("--set", "validation=0.0", "--set", "test=0.0", "--set", "touches=0", "--set", "points=16")
    outcome = limited("data", "make", "parts", "-o", "out", *settings, "--jobs", 1, folder=tmp_path)
    assert outcome.code == 0, outcome.err
    train = json.loads((tmp_path / "out" / "manifest.json").read_text())["splits"]["train"]
    assert (train["objects"], sorted(train["rejected"])) == (1, ["huge.obj", "tiny.obj"])
    assert all("Error" not in reason for reason in train["rejected"].values()), train["rejected"]
