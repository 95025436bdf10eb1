"""Recordings that a stranger hands to `pcsr upsample --touch`."""

import json
import os
import pickle  # noqa: TID251
import struct
import zlib

import numpy as np
import pytest

from pcsr import UserError
from pcsr.recorded import read

POINTS = np.random.default_rng(0).normal(size=(40, 3))
HEAD = {"format": 1, "unit": "mm", "object_unit": "mm", "frame": "object", "sensor": "digit"}
STILL = {"translation": [0, 0, 0], "quaternion": [0, 0, 0, 1], "order": "xyzw"}
HEIGHT = {"mm_per_level": 0.01, "mm_per_pixel": 0.1, "indentation": "positive", "contact_above": 0.1, "pose": STILL}


@pytest.fixture
def touched(limited, tmp_path):
    """Upsamples a cloud with a recording, of what its manifest holds; the folder is `touches`."""
    np.save(tmp_path / "in.npy", POINTS)
    (tmp_path / "touches").mkdir()
    np.save(tmp_path / "touches" / "a.npy", POINTS[:5])

    def upsample(manifest):
        text = manifest if isinstance(manifest, bytes) else json.dumps(manifest).encode()
        (tmp_path / "touches" / "touches.json").write_bytes(text)
        command = "upsample", "in.npy", "-o", "out.npy", "--model", "midpoint", "--quiet"
        command += "--touch", "touches", "--touch-as-is"
        return limited(*command, folder=tmp_path)

    return upsample


def test_a_good_one(touched):
    outcome = touched({**HEAD, "touches": [{"cloud": "a.npy"}]})
    assert (outcome.code, outcome.err) == (0, "")


def test_a_million_touches(touched):
    text = json.dumps({**HEAD, "touches": [{"cloud": "a.npy"}]}).encode()
    many = text.replace(b'{"cloud": "a.npy"}', b",".join([b'{"cloud": "a.npy"}'] * 1_000_000))
    touched(many).refused("touches.json", "1000000, more than 10000", megabytes=600, seconds=30)


def test_one_file_a_thousand_times(tmp_path, monkeypatch):
    monkeypatch.setattr("pcsr.recorded.reading.MOST_TOUCHED_POINTS", 10_000)
    np.save(tmp_path / "a.npy", POINTS)
    for count in (250, 251, 1000):
        touches = [{"cloud": "a.npy"}] * count
        (tmp_path / "touches.json").write_text(json.dumps({**HEAD, "touches": touches}))
        if count == 250:
            assert len(read(tmp_path).touches) == count
        else:
            with pytest.raises(UserError, match="more than 10000 touches or 10000 touched points"):
                read(tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"[" * 100_000, "nested too deeply"),
        (b'{"a":' * 100_000, "nested too deeply"),
        (b'{"format": ' + b"1" * 5000 + b"}", "a number of 5000 digits"),
        (b'{"format": 1, "format": 1}', "'format' is written twice"),
        (b"{" + b",".join(b'"k%d": 1' % n for n in range(30_000)) + b"}", "more mistakes"),
        (b'{"format": 1, "layout": {"name": "' + b"a" * 100_000 + b'"}}', "no layout"),
        (b"\xff\xfe", "not valid JSON"),
    ],
)
def test_manifests_that_are_none(touched, text, words):
    outcome = touched(text)
    assert outcome.code == 2
    assert words in outcome.err
    assert len(outcome.err) < 5000
    assert outcome.seconds < 10
    assert outcome.megabytes < 100


def test_a_manifest_of_a_gigabyte(limited, tmp_path):
    np.save(tmp_path / "in.npy", POINTS)
    (tmp_path / "touches.json").write_bytes(b"{")
    os.truncate(tmp_path / "touches.json", 1 << 30)
    outcome = limited("upsample", "in.npy", "-o", "out.npy", "--touch", ".", folder=tmp_path)
    outcome.refused("touches.json has 1.07 GB", "more than the 33.6 MB that such a file may have", megabytes=30)


def png(width, height):
    """A picture of one grey level, packed a thousand to one."""

    def part(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    row = zlib.compress(bytes(width + 1) * min(height, 16), 1)
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + part(b"IHDR", head) + part(b"IDAT", row) + part(b"IEND", b"")


@pytest.mark.parametrize(("width", "height"), [(9000, 9000), (40_000, 40_000), (2**31 - 1, 1)])
def test_an_image_of_many_megapixels(touched, tmp_path, width, height):
    (tmp_path / "touches" / "a.png").write_bytes(png(min(width, 10**6), height) if width < 10**6 else png(1, 1))
    if width > 10**6:
        data = bytearray(png(1, 1))
        data[16:20] = struct.pack(">I", width)
        data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
        (tmp_path / "touches" / "a.png").write_bytes(data)
    outcome = touched({**HEAD, "touches": [{"height": "a.png", **HEIGHT}]})
    assert outcome.code == 2
    assert "16777216" in outcome.err
    assert outcome.megabytes < 60


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("/dev/zero", "not inside"),
        ("../in.npy", "not inside"),
        ("~nobody/a.npy", "cannot be read"),
        ("a\0.npy", "not inside"),
        ("a" * 300 + ".npy", "cannot be read"),
        ("zero.npy", "not inside"),
        ("folder.npy", "a folder"),
    ],
)
@pytest.mark.parametrize("key", ["cloud", "height"])
def test_files_that_are_none(touched, tmp_path, key, name, words):
    folder = tmp_path / "touches"
    (folder / "zero.npy").symlink_to("/dev/zero")
    (folder / "folder.npy").mkdir()
    more = HEIGHT if key == "height" else {}
    outcome = touched({**HEAD, "touches": [{key: name, **more}]})
    assert outcome.code == 2
    assert words in outcome.err
    assert outcome.megabytes < 60
    assert outcome.seconds < 20


def test_many_fingers(touched):
    outcome = touched({**HEAD, "touches": [{"fingers": [{"cloud": "a.npy"}] * 100_000}]})
    assert outcome.code == 2
    assert "100000, more than 1000" in outcome.err


def pickled(data):
    head = b"{'descr': '|O', 'fortran_order': False, 'shape': (), }\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(head)) + head + data


def doubling(levels):
    """Lists of two that are one: small in a pickle, endless when they are written out."""
    one = [0.0, 0.0]
    for _ in range(levels):
        one = [one, one]
    return one


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (pickle.dumps(np.array({"points": 0}, dtype=object)), "has no cam_pos"),
        (b"(" * 1_100_000, "more than 1000000 steps"),
        (b"]" + b"2" * 1_100_000 + b".", "more than 1000000 steps"),
        (b"\x8e" + struct.pack("<Q", 1 << 60), "cannot be read"),
        (b"r\xff\xff\xff\xff", "cannot be read"),
        (b"cos\nsystem\n(S'true'\ntR.", "asks to run"),
    ],
)
def test_pickles_that_ask_for_too_much(touched, tmp_path, data, words):
    (tmp_path / "touches" / "a.npy").unlink()
    (tmp_path / "touches" / "0.npy").write_bytes(pickled(data))
    outcome = touched({"format": 1, "layout": {"name": "smith-2020"}})
    assert outcome.code == 2
    assert words in outcome.err
    assert outcome.megabytes < 500
    assert outcome.seconds < 30


@pytest.mark.parametrize("key", ["points", "touch_success", "cam_pos"])
def test_pickles_that_are_endless_when_written_out(touched, tmp_path, key):
    (tmp_path / "touches" / "a.npy").unlink()
    grasp = {"cam_pos": [[0, 0, 0]], "cam_rot": [[0, 0, 0]], "touch_success": [True], "points": [[[0, 0, 0]]]}
    grasp[key] = [doubling(40)]
    np.save(tmp_path / "touches" / "0.npy", np.array(grasp, dtype=object))
    outcome = touched({"format": 1, "layout": {"name": "smith-2020"}})
    assert outcome.code == 2
    assert outcome.megabytes < 100
    assert len(outcome.err) < 1000
