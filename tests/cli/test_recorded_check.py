"""`pcsr recorded check`, run as a person would run it."""

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner

from pcsr.cli import pcsr
from pcsr.clouds.formats import write_points
from tests.recorded.pressed import PITCH, pressed
from tests.recorded.recordings import STILL

HEIGHT = {"mm_per_level": 1, "mm_per_pixel": PITCH, "indentation": "positive"}


def entry(name, x):
    return HEIGHT | {"height": f"{name}.npy", "name": name, "pose": STILL | {"translation": [x, 0, -0.3]}}


@pytest.fixture
def folder(tmp_path):
    """A recording of two touches of a plane, and a scan of it."""
    (tmp_path / "touches").mkdir()
    for name, press in (("left", 0.3), ("right", 0.4)):
        np.save(tmp_path / "touches" / f"{name}.npy", pressed(press)[0])
    record(tmp_path, entry("left", -4), entry("right", 4), pose_error={"position": 0.5, "rotation": 0.2})
    x, y = np.meshgrid(np.linspace(-12, 12, 80), np.linspace(-8, 8, 60))
    write_points(tmp_path / "scan.ply", np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]))
    return tmp_path


def record(folder, *touches, **head):
    plain = {"format": 1, "unit": "mm", "object_unit": "mm", "frame": "sensor", "sensor": "gelsight-mini"}
    (folder / "touches" / "touches.json").write_text(json.dumps(plain | {"touches": list(touches)} | head))


def check(folder, *more):
    words = ["recorded", "check", folder / "touches", *more]
    return CliRunner().invoke(pcsr, [str(word) for word in words])


def test_the_touches_are_listed(folder):
    done = check(folder, "--cloud", folder / "scan.ply")
    assert (done.exit_code, done.stderr) == (0, ""), done.output
    rows = [line.split() for line in done.stdout.splitlines()]
    assert rows[0] == ["touch", "sensor", "points", "depth", "mm", "area", "mm²", "position", "mm", "cloud", "mm"]
    assert rows[2][:2] == ["left", "gelsight-mini"]
    assert rows[2][3] == "0.30"
    assert rows[2][5:8] == ["-4", "0", "-0.3"]
    assert float(rows[2][8]) < 0.3
    assert rows[3][3] == "0.40"
    assert done.stdout.endswith("touches: all 2 touches can be used, with an error of 0.5 mm and 0.2 degrees\n")


def test_odd_names_are_written_as_escapes(folder):
    names = ["a\nb", "\x1b[31mred", "\ud800", "[/b]"]
    record(folder, *({**entry("left", k), "name": name} for k, name in enumerate(names)), entry("\x1b\nnone", 9))
    done = check(folder, "--page", folder / "page.html")
    assert done.exit_code == 2
    rows = [line.split()[0] for line in done.stdout.splitlines()[2:6]]
    assert rows == [r"a\nb", r"\x1b[31mred", r"\ud800", "[/b]"]
    assert r"touch \x1b\nnone is skipped: " in done.stdout
    assert "\x1b" not in done.output
    assert r"\ud800" in (folder / "page.html").read_text(encoding="utf-8")


def test_what_cannot_be_used_is_said_and_is_the_exit_code(folder):
    wrong = entry("right", 4) | {"indentation": "negative"}
    missing = [entry(f"none{k}", k) for k in range(5)]
    record(folder, entry("left", -4), wrong, *missing)
    done = check(folder)
    assert done.exit_code == 2
    assert "touch right is skipped: touches.json: touches.1: indentation: the surface goes 0 mm into" in done.stdout
    assert "touch none0 and 4 more like it are skipped: " in done.stdout
    assert "pose_error is not stated" in done.stdout
    assert done.stderr == "pcsr: error: 6 of 7 touches cannot be used: the reasons are listed above\n"


def test_a_touch_in_another_frame_than_the_cloud_is_said(folder):
    record(folder, entry("left", -4), entry("right", 400))
    done = check(folder, "--cloud", folder / "scan.ply")
    assert done.exit_code == 2
    assert f"touch right cannot be used with {folder / 'scan.ply'}: it is 2." in done.stdout
    assert "1 of 2 touches cannot be used" in done.stderr
    assert check(folder).exit_code == 0


def test_the_page_is_written(folder):
    done = check(folder, "--page", folder / "touches.html")
    assert done.exit_code == 0, done.output
    assert f"pictures: {folder / 'touches.html'}" in done.stdout
    text = (folder / "touches.html").read_text(encoding="utf-8")
    assert "<title>touches: recording</title>" in text
    assert text.count("data:image/png") == 2


def test_mistakes_in_the_options_are_said_before_the_work(folder):
    done = check(folder, "--page", folder / "scan.ply")
    assert done.exit_code == 2
    assert "a page is written as HTML: name a file with the suffix .html" in done.stderr
    (folder / "a.html").mkdir()
    assert "a.html" in check(folder, "--page", folder / "a.html").stderr
    assert "cannot be read" in check(folder, "--cloud", folder / "none.ply").stderr
    done = CliRunner().invoke(pcsr, ["recorded", "check", str(folder)])
    assert done.exit_code == 2
    assert "touches.json cannot be read" in done.stderr


def test_the_group_lists_its_commands():
    done = CliRunner().invoke(pcsr, ["recorded", "--help"])
    assert done.exit_code == 0
    assert re.search(r"^  check +Check a recording, and show what its touches hold\.$", done.stdout, re.MULTILINE)
    assert "No such command 'chek'" in CliRunner().invoke(pcsr, ["recorded", "chek"]).stderr
