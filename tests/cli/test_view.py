"""`pcsr view`: a page or a picture of clouds, on any machine."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from pcsr import Touch, recorded
from pcsr.cli import browser, pcsr
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import write_cloud
from pcsr.report.clouds import shown

POINTS = np.random.default_rng(0).uniform(size=(100, 3))


@pytest.fixture
def view(tmp_path, monkeypatch):
    """The command, in a folder with a scan and a dense cloud, on a machine without a desktop."""
    monkeypatch.chdir(tmp_path)
    for name in ("BROWSER", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    heat = POINTS[:, 0].astype(np.float32)
    write_cloud(Path("scan.ply"), Cloud(POINTS[:25], {"heat": heat[:25]}))
    write_cloud(Path("dense.ply"), Cloud(POINTS, {"heat": heat}))
    return lambda *arguments, **options: CliRunner().invoke(pcsr, ["view", *map(str, arguments)], **options)


def test_without_a_desktop_the_page_is_written_and_named(view):
    done = view("scan.ply", "dense.ply")
    assert (done.exit_code, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        "scan.ply, 25 points",
        "dense.ply, 100 points",
        "view.html: no browser can be opened from here; open this file in one",
    ]
    page = Path("view.html").read_text(encoding="utf-8")
    assert "<title>scan.ply and 1 more</title>" in page
    assert "Plotly" in page, "it needs no network"


def test_the_page_is_opened_where_there_is_a_browser(view, monkeypatch):
    opened = []
    monkeypatch.setattr(browser, "open_page", lambda path: opened.append(path) or True)
    done = view("scan.ply")
    assert opened == [Path("view.html")]
    assert done.stdout.splitlines()[-1] == "view.html: opened in the browser"


@pytest.mark.parametrize(("name", "begins"), [("a/page.html", b"<!doctype html>"), ("picture.PNG", b"\x89PNG")])
def test_a_named_file_is_written_and_nothing_is_opened(view, monkeypatch, name, begins):
    monkeypatch.setattr(browser, "open_page", lambda _: pytest.fail("a browser was opened"))
    done = view("scan.ply", "dense.ply", "-o", name)
    assert (done.exit_code, done.stdout.splitlines()[-1]) == (0, name)
    assert Path(name).read_bytes().startswith(begins)
    assert not Path("view.html").exists()


def test_a_page_of_its_own_is_replaced_and_no_other_file(view):
    assert view("scan.ply").exit_code == 0
    assert view("dense.ply").exit_code == 0
    assert "<title>dense.ply</title>" in Path("view.html").read_text(encoding="utf-8")
    Path("view.html").write_text("<p>mine</p>")
    done = view("scan.ply")
    assert done.exit_code == 2
    assert "view.html exists, and is no page of this command: name another file with -o" in done.stderr
    assert Path("view.html").read_text() == "<p>mine</p>"


def test_a_folder_that_cannot_be_written_to_is_left_alone(view, monkeypatch):
    access = os.access
    monkeypatch.setattr("os.access", lambda path, mode, **options: path != Path() and access(path, mode, **options))
    done = view("scan.ply")
    assert done.exit_code == 0
    path = Path(done.stdout.splitlines()[-1].partition(":")[0])
    assert path.is_absolute()
    assert path.name == "view.html"
    assert path.is_file()
    assert not Path("view.html").exists()


def test_points_that_a_cloud_had_before_are_old(view):
    done = view("dense.ply", "--before", "scan.ply")
    assert done.stdout.splitlines()[0] == "dense.ply, 100 points: 25 old, 75 new"
    write_cloud(Path("moved.xyz"), Cloud(POINTS + 1))
    done = view("moved.xyz", "--before", "scan.ply")
    assert done.stderr == "moved.xyz: none of its points is in scan.ply: is it in another frame or unit?\n"
    assert done.exit_code == 0


def test_before_is_stronger_than_the_columns_of_the_file(view):
    source = np.repeat([0, 1, 2], [10, 60, 30]).astype(np.uint8)
    write_cloud(Path("sourced.ply"), Cloud(POINTS, {"source": 2 - source, "source_2": source}))
    assert view("sourced.ply").stdout.startswith("sourced.ply, 100 points: 10 old, 60 new, 30 touched\n")
    done = view("sourced.ply", "--before", "scan.ply")
    assert done.stdout.startswith("sourced.ply, 100 points: 25 old, 45 new, 30 touched\n")


def test_expected_errors_set_the_colours_where_there_are_some(view):
    errors = np.where(np.arange(len(POINTS)) < 20, np.nan, 0.1 + np.arange(len(POINTS)) / 1000)
    write_cloud(Path("rated.ply"), Cloud(POINTS, {"error": errors}))
    assert view("rated.ply", "--color", "error").exit_code == 0
    page = Path("view.html").read_text(encoding="utf-8")
    assert "<span>error</span><span>0.12</span>" in page
    assert "<span>0.199</span>" in page
    assert view("rated.ply", "--color", "error", "-o", "rated.png").exit_code == 0


def test_recorded_touches_are_shown(view):
    recorded.write(Path("touches"), [Touch.single(POINTS[:30], None, unit=1.0, sensor="digit")])
    assert view("scan.ply", "--touch", "touches").exit_code == 0
    assert "recorded touches, 30 points" in Path("view.html").read_text(encoding="utf-8")


def test_a_large_cloud_is_thinned_and_that_is_said(view, monkeypatch):
    monkeypatch.setattr(shown, "MOST_EACH", 40)
    done = view("dense.ply")
    assert done.stdout.splitlines()[0] == "dense.ply, 40 of 100 points"
    assert done.stderr == "dense.ply: shown: 40 of 100 points, drawn at random\n"


def test_points_that_are_not_finite_are_left_out_and_that_is_said(view):
    Path("holes.xyz").write_text("0 0 0\nnan 1 1\n1 1 1\n")
    done = view("holes.xyz")
    assert done.stderr == "holes.xyz: 1 points are not finite and are not shown\n"
    assert done.stdout.startswith("holes.xyz, 2 points\n")


def test_a_cloud_comes_from_a_pipe(view):
    command = [sys.executable, "-c", "from pcsr.cli import main; main()", "view", "-", "scan.ply", "--format", "xyz"]
    done = subprocess.run(command, input=b"0 0 0\n1 1 1\n", capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.decode().splitlines()[:2] == ["standard input, 2 points", "scan.ply, 25 points"]
    assert view("-", "-").exit_code == 2


def test_the_format_of_a_file_whose_suffix_names_none_is_given(view):
    Path("a.bin").write_bytes(np.hstack([POINTS[:7], np.ones((7, 1))]).astype("<f4").tobytes())
    done = view("scan.ply", "a.bin", "--format", "kitti", "--before", "a.bin")
    assert done.exit_code == 0, done.output
    assert done.stdout.splitlines()[1] == "a.bin, 7 points: 7 old"
    assert "name the right one, --format kitti" in view("a.bin").stderr


def test_the_columns_of_text_are_named(view):
    rows = np.column_stack([np.arange(25), POINTS[:25]])
    np.savetxt("rows.txt", rows, "%d %.17g %.17g %.17g")
    names = ("--columns", "-,x,y,z")
    done = view("dense.ply", "rows.txt", "--before", "rows.txt", *names)
    assert (done.exit_code, done.stderr) == (0, "")
    assert done.stdout.splitlines()[:2] == ["dense.ply, 100 points: 25 old, 75 new", "rows.txt, 25 points: 25 old"]
    command = [sys.executable, "-m", "pcsr.cli", "view", "-", "--format", "txt", "--before", "scan.ply", *names]
    piped = subprocess.run(
        [*command, "-o", "piped.html"], input=Path("rows.txt").read_bytes(), capture_output=True, check=False
    )
    assert piped.returncode == 0, piped.stderr
    assert piped.stdout.decode().splitlines()[0] == "standard input, 25 points: 25 old"


def test_files_of_the_same_name_are_distinguished(view):
    Path("b").mkdir()
    Path("b/scan.ply").write_bytes(Path("scan.ply").read_bytes())
    lines = view("scan.ply", "b/scan.ply").stdout.splitlines()
    assert lines[:2] == ["scan.ply, 25 points", "b/scan.ply, 25 points"]


def test_a_name_that_is_no_text_is_shown(view):
    name = b"caf\xe9.ply".decode("utf-8", "surrogateescape")
    Path(name).write_bytes(Path("scan.ply").read_bytes())
    done = view(name)
    assert done.exit_code == 0, done.output
    assert r"caf\udce9.ply" in Path("view.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["scan.ply", "-o", "page.pdf"], "-o page.pdf: a view is written as .html, .htm, .png: give the file such a"),
        (["scan.ply", "-o", "page"], "-o page: a view is written as"),
        (["scan.ply", "--color", "heet"], "--color heet: no cloud has such a column: did you mean 'heat'?"),
        (["missing.ply"], "missing.ply"),
        (["scan.ply", "--before", "missing.ply"], "missing.ply"),
        (["scan.ply", "--format", "xyz"], "--format xyz: the suffixes of all clouds name their formats: leave it out"),
        (
            ["scan.ply", "--before", "dense.ply", "--columns", "x,y,z"],
            "--columns x,y,z: no cloud is text, whose columns it could name: leave it out",
        ),
        (["scan.ply", "--touch", "missing"], "missing"),
        ([], "FILE..."),
    ],
)
def test_mistakes_are_named_and_nothing_is_written(view, arguments, said):
    before = sorted(Path().iterdir())
    done = view(*arguments)
    assert done.exit_code == 2
    assert said in done.stderr
    assert sorted(Path().iterdir()) == before
