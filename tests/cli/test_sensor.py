"""`pcsr sensor`, run as a person would run it, with a synthetic sensor."""

import json
import re
import shutil
import sys

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from pcsr.cli import pcsr
from pcsr.clouds.formats import read_cloud
from pcsr.recorded import read
from pcsr.sensors import Calibration, shaded
from tests.recorded.recordings import STILL, record
from tests.sensors.synthetic import PITCH, SIZE, background, ball, photo, presses, save


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder of presses, a background, images of touches, and their calibration."""
    folder = tmp_path_factory.mktemp("sensor")
    for name, diameter, count in (("presses", 6.0, 12), ("large", 8.0, 8)):
        (folder / name).mkdir()
        for press in presses(count, seed=int(diameter), diameter=diameter):
            save(folder / name / press.name, press.image)
    save(folder / "rest.png", background())
    (folder / "touches").mkdir()
    for number, depth in enumerate((0.6, 0.9)):
        save(folder / "touches" / f"{number}.png", photo(ball(depth, (70.0, 55.0)), 300 + number))
    done = run(folder, *CALIBRATE, "--sensor", "mine", "-o", "mine.json")
    assert done.exit_code == 0, done.output
    return folder


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    """A copy of it, as the current folder."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


CALIBRATE = ("calibrate", "presses", "--ball", 6, "--mm-per-pixel", PITCH, "--background", "rest.png")
NEW = ("--sensor", "mine", "-o", "new.json")
READ = ("read", "touches", "--background", "rest.png", "--calibration", "mine.json", "-o", "points")


def run(folder, *words):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return CliRunner().invoke(pcsr, ["sensor", *map(str, words)])


def rows(text):
    """The rows of numbers of a table, by their first cell."""
    found = [line.split() for line in text.splitlines()]
    return {cells[0]: cells[1:] for cells in found if len(cells) > 3 and re.fullmatch(r"[\d.]+|all|\S+png", cells[0])}


def refused(folder, *words, code=2, lines=1):
    """Run a command that is refused and leaves nothing behind; return what it says."""
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    done = run(folder, *words)
    assert done.exit_code == code, done.output
    said = done.stderr.replace("calibrating: 1 of 1\n", "")
    assert "--traceback" not in said
    if not said.startswith("Usage:"):
        assert len(said.splitlines()) == lines, said
    assert done.stdout == ""
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before
    return said


def test_from_presses_to_points_of_a_recording(folder):
    done = run(folder, *CALIBRATE, "--presses", 8, "--page", "new.html", *NEW)
    assert done.exit_code == 0, done.output
    assert "errors on 4 presses that are not used in the fit" in done.stdout
    assert "new.json: mine, 160 x 120 pixels of 0.12 mm, the gel flat; fitted to 8 presses, 0 refused" in done.stdout
    (row,) = rows(done.stdout).values()
    count, error, *_, area = map(float, row)
    assert (count, error < 5, 85 < area < 125) == (4, True, True)
    figures = Calibration.load(folder / "new.json").figures
    assert f"{100 * figures.radius_median:.1f}" == row[1]
    page = (folder / "new.html").read_text(encoding="utf-8")
    assert page.count("<image ") == 8
    assert "http" not in page.replace("http://www.w3.org", "")

    done = run(folder, *READ, "--preview", "seen")
    assert done.exit_code == 0, done.output
    assert "2 of 2 images: points, pictures: seen" in done.stdout
    for name, depth in (("0", 0.6), ("1", 0.9)):
        cloud = read_cloud(folder / "points" / f"{name}.ply")
        assert rows(done.stdout)[f"touches/{name}.png"][0] == str(len(cloud))
        assert cloud.points[:, 2].max() == pytest.approx(depth, rel=0.1)
        assert float(rows(done.stdout)[f"touches/{name}.png"][1]) == pytest.approx(depth, rel=0.1)
        assert (cloud.columns["error"] > 0).all()
        with Image.open(folder / "seen" / f"{name}.png") as picture:
            assert picture.width > 3 * 240

    record(
        folder,
        {"image": "touches/0.png", "pose": STILL},
        background="rest.png",
        calibration="new.json",
        object_unit="mm",
    )
    (touch,) = read(folder).touches
    assert touch.points[:, 2].max() == pytest.approx(0.6, rel=0.1)


@pytest.mark.slow
def test_balls_of_several_diameters(folder):
    more = ("--press", "large", "--ball", 8, "--test", "touches", "--test-ball", 6)
    done = run(folder, *CALIBRATE, *more, *NEW)
    assert done.exit_code == 0, done.output
    assert "fitted to 20 presses" in done.stdout
    assert {name: cells[0] for name, cells in rows(done.stdout).items()} == {"6": "2"}
    done = run(folder, *CALIBRATE, "--press", "large", "--ball", 8, "--presses", 8, *NEW, "--overwrite")
    found = rows(done.stdout)
    assert list(found) == ["6", "8", "all"]
    assert int(found["6"][0]) + int(found["8"][0]) == int(found["all"][0]) == 12
    one = run(folder, *CALIBRATE, "--press", "touches", *NEW, "--overwrite")
    assert "fitted to 14 presses" in one.stdout


@pytest.mark.slow
def test_the_wrong_diameter_of_a_ball_shows(folder):
    swapped = run(folder, *CALIBRATE[:2], "--ball", 6, "--press", "large", "--ball", 6, *CALIBRATE[4:], *NEW)
    right = run(
        folder, *CALIBRATE[:2], "--ball", 6, "--press", "large", "--ball", 8, *CALIBRATE[4:], *NEW, "--overwrite"
    )
    assert float(rows(swapped.stdout)["6"][1]) > 2 * float(rows(right.stdout)["all"][1])


def test_without_a_background_it_is_the_median_of_the_presses(folder):
    done = run(folder, *CALIBRATE[:-2], *NEW)
    assert done.exit_code == 0, done.output
    assert "errors on 12 presses by cross-validation, in 10 fits" in done.stdout
    background = Calibration.load(folder / "new.json").background
    np.testing.assert_allclose(background, Calibration.load(folder / "mine.json").background, atol=4)
    small = ("calibrate", *(f"presses/{number}.png" for number in range(4)), *CALIBRATE[2:-2])
    assert "the median of 4 presses is no background" in refused(folder, *small, "--sensor", "x", "-o", "x.json")


def test_the_gel_is_that_of_the_sensor_or_of_the_option(folder):
    for words, dome in (
        (("--sensor", "digit"), (50.0, 23.0)),
        (("--sensor", "digit", "--dome", "flat"), None),
        (("--sensor", "mine", "--dome", "80,40.5"), (80.0, 40.5)),
    ):
        done = run(folder, *CALIBRATE, *words, "--presses", 8, "-o", "new.json", "--overwrite")
        assert done.exit_code == 0, done.output
        assert Calibration.load(folder / "new.json").gel.dome == dome
        assert ("the gel flat" if dome is None else f"a dome of radii {dome[0]:g} and {dome[1]:g} mm") in done.stdout


def test_presses_that_cannot_be_used_are_listed_and_the_others_go_on(folder):
    save(folder / "presses" / "large.png", photo(ball())[::2])
    save(folder / "presses" / "black.png", np.zeros((*SIZE, 3), np.uint8))
    save(folder / "presses" / "white.png", np.full((*SIZE, 3), 255, np.uint8))
    save(folder / "presses" / "grey.png", photo(ball())[..., 0])
    save(folder / "presses" / "rest.png", background(7))
    save(folder / "presses" / "edge.png", photo(ball(centre=(3.0, 60.0))))
    save(folder / "presses" / "bar.png", photo(bar()))
    whole = (folder / "presses" / "0.png").read_bytes()
    (folder / "presses" / "short.png").write_bytes(whole[: len(whole) // 2])
    (folder / "presses" / "notes.txt").write_text("no image")
    (folder / "presses" / "._0.png").write_bytes(b"what another system leaves")
    done = run(folder, *CALIBRATE, *NEW, "--page", "new.html")
    assert done.exit_code == 0, done.output
    lines = dict(re.findall(r"^presses/(\w+)\.png is refused: (.*)$", done.stderr, re.MULTILINE))
    assert list(lines) == sorted(lines)
    reasons = {
        "bar": "it shows something else, or a ball of another diameter",
        "black": "it is black, at a mean level of 0.0 of 255: was the light on?",
        "edge": "the ball is cut off by the edge of the image",
        "grey": "it is an image of mode L, not of red, green and blue",
        "large": "it has 160 x 60 pixels, but its background 160 x 120",
        "rest": "no ball: the colour changes by",
        "short": "it cannot be read as an image: it is damaged, cut off",
        "white": "it is saturated at 100% of its pixels",
    }
    assert lines.keys() == reasons.keys()
    assert not [name for name, reason in reasons.items() if reason not in lines[name]]
    assert "fitted to 12 presses, 8 refused" in done.stdout
    page = (folder / "new.html").read_text(encoding="utf-8")
    assert all(f'<th scope="row">presses/{name}.png</th>' in page for name in reasons)


def bar():
    """The indentation by a bar across the gel."""
    apart = np.abs(np.mgrid[: SIZE[0], : SIZE[1]][0] - 60) * PITCH
    return np.maximum(0.8 - apart, 0) * (np.abs(np.arange(SIZE[1]) - 80) < 60)


def test_at_most_twenty_reasons_are_printed(folder):
    for number in range(25):
        save(folder / "presses" / f"rest{number:02d}.png", background(number))
    done = run(folder, *CALIBRATE, *NEW)
    assert done.exit_code == 0
    assert done.stderr.count(" is refused: no ball") == 20
    assert "\nand 5 more\n" in done.stderr
    said = refused(
        folder,
        "calibrate",
        *(f"presses/rest{n:02d}.png" for n in range(25)),
        *CALIBRATE[2:],
        "--sensor",
        "x",
        "-o",
        "x.json",
        lines=22,
    )
    assert "pcsr: error: 0 of 25 presses can be used, and a calibration needs 5, better 12" in said
    assert said.endswith("  and 5 more\n")


def test_too_few_presses_end_with_the_reasons(folder):
    for number in range(8):
        save(folder / "presses" / f"{number}.png", background(number))
    (folder / "presses" / "8.png").write_bytes(b"")
    said = refused(folder, *CALIBRATE, *NEW, lines=10)
    assert said.startswith("presses/8.png is refused: it cannot be read as an image")
    assert "3 of 11 presses can be used" in said
    assert said.count("no ball") == 8


def test_a_background_of_another_sensor_refuses_every_press(folder):
    other = shaded(np.zeros(SIZE), PITCH)[..., [2, 0, 1]] // 3
    save(folder / "rest.png", other)
    said = refused(folder, *CALIBRATE, *NEW, lines=13)
    assert said.count("it is of another sensor or light") == 12


def test_a_folder_that_is_a_file_is_noticed_before_the_work(folder):
    (folder / "file").write_text("x")
    said = refused(folder, *CALIBRATE, *NEW[:-1], "file/new.json")
    assert said == "pcsr: error: -o file/new.json: file is a file: name a folder that exists, or can be made\n"


def test_more_presses_than_the_memory_holds_are_refused_while_they_are_read(folder, monkeypatch):
    monkeypatch.setattr("pcsr.limits.free_memory", lambda: 60 * 5 * 160 * 120)
    monkeypatch.setattr("pcsr.limits.UNCHECKED_SIZE", 0)
    said = refused(folder, *CALIBRATE, *NEW)
    assert "calibration with 6 or more presses of 19200 pixels needs about" in said
    assert "give fewer presses, such as 20" in said


def test_presses_in_one_place_are_remarked(folder):
    done = run(folder, *CALIBRATE, *NEW)
    assert "extrapolated" not in done.stdout
    for number in range(6):
        place = (80.0 + number, 55.0 + number)
        save(folder / "large" / f"{number}.png", photo(ball(0.6 + 0.04 * number, place), number))
    files = [f"large/{number}.png" for number in range(6)]
    done = run(folder, "calibrate", *files, *CALIBRATE[2:], *NEW, "--overwrite")
    assert done.exit_code == 0, done.output
    assert re.search(r"^the balls lie within \d% of the image's width: elsewhere", done.stdout, re.MULTILINE)


@pytest.mark.slow
def test_presses_of_one_name_in_two_folders_are_two_presses(folder):
    (folder / "again").mkdir()
    for press in presses(5, seed=77):
        save(folder / "again" / press.name, press.image)
    done = run(folder, *CALIBRATE, "--press", "again", *NEW, "--page", "new.html")
    assert "fitted to 17 presses" in done.stdout
    page = (folder / "new.html").read_text(encoding="utf-8")
    assert "again/0.png" in page
    assert "presses/0.png" in page
    said = refused(folder, *CALIBRATE, "--test", "./presses/../presses/3.png", "--sensor", "x", "-o", "x.json")
    assert "presses/3.png is given twice, also as presses/3.png: give each image once" in said


@pytest.mark.skipif(sys.platform != "linux", reason="other systems' names of files are text")
def test_names_that_are_no_text_are_shown_as_escapes(folder):
    odd = folder / "presses" / "a\udcff\n[red].png"
    (folder / "presses" / "0.png").rename(odd)
    (folder / "presses" / "1.png").write_bytes(b"")
    (folder / "presses" / "1.png").rename(folder / "presses" / "b\udcff.png")
    done = run(folder, *CALIBRATE, *NEW, "--page", "new.html")
    assert done.exit_code == 0, done.output
    assert "presses/b\\udcff.png is refused: it cannot be read as an image" in done.stderr
    assert "presses/a\\udcff\\n[red].png, 6 mm" in (folder / "new.html").read_text(encoding="utf-8")
    done = run(folder, "read", odd, *READ[2:])
    assert done.exit_code == 0, done.output
    assert "a\\udcff\\n[red].png" in done.stdout


def test_a_background_in_the_folder_of_the_presses_is_no_press(folder):
    save(folder / "presses" / "background.png", background())
    done = run(folder, *CALIBRATE[:-1], "presses/background.png", *NEW)
    assert (done.exit_code, "fitted to 12 presses, 0 refused" in done.stdout) == (0, True), done.output


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--ball", 8), "--ball is given 2 times for 1 group of presses: give it once for all, or once for PRESS and"),
        (("--test-ball", 8), "--test-ball: it is the ball of --test, which is not given"),
        (("--test", "large", "--test-ball", 8, "--test-ball", 9), "--test-ball is given 2 times for 1 group of"),
        (("--press", "nothing"), "--press nothing: there is no such file or folder"),
        (("--test", "empty"), "--test empty: the folder has no image (.png, .jpg, .jpeg, .bmp)"),
        (("--sensor", "GelSight mini"), "sensor 'GelSight mini' is written 'gelsight-mini'"),
        (("--sensor", ""), "the sensor's name has 0 characters: it must have 1 to 200"),
        (("--background", "none.png"), "none.png cannot be read: No such file or directory"),
        (("--background", "mine.json"), "mine.json cannot be read as an image"),
        (("--page", "new.pdf"), "--page new.pdf: name a file with the suffix .html"),
        (("-o", "new.ply"), "-o new.ply: name a file with the suffix .json"),
        (("-o", "mine.json"), "-o mine.json exists already: choose another file, or replace it (--overwrite)"),
        (("-o", "folder.json"), "folder.json is a folder"),
        (("--mm-per-pixel", "nan"), "nan is not a number"),
        (("--mm-per-pixel", "0"), "0.0 is not in the range"),
        (("--ball", "-1"), "-1.0 is not in the range"),
        (("--presses", 4), "4 is not in the range x>=5"),
        (("--dome", "50"), "'50': it must be two radii in mm, as in 50,23, or flat"),
        (("--dome", "50,nan"), "nan is not a number"),
    ],
    ids=lambda one: " ".join(map(str, one))[:40] if isinstance(one, tuple) else None,
)
def test_a_mistake_is_one_line_and_writes_nothing(folder, words, said):
    (folder / "empty").mkdir()
    (folder / "folder.json").mkdir()
    assert said in refused(folder, *CALIBRATE, *NEW, *words)


def test_presses_and_the_sensors_name_must_be_given(folder):
    assert "PRESS is missing" in refused(folder, "calibrate", *CALIBRATE[2:], *NEW)
    assert "Missing option '--sensor'" in refused(folder, *CALIBRATE, "-o", "x.json")
    assert "Missing option '--ball'" in refused(folder, *CALIBRATE[:2], *CALIBRATE[4:], *NEW)


def test_one_image_is_one_file_of_any_format(folder):
    one = ("read", "touches/0.png", *READ[2:-1])
    for out in ("touch.ply", "touch.npz", "touch.csv"):
        done = run(folder, *one, out, "--preview", "touch.PNG")
        assert done.exit_code == 0, done.output
        assert len(read_cloud(folder / out)) == int(rows(done.stdout)["touches/0.png"][0])
    assert run(folder, *one, "folder").exit_code == 0
    assert len(read_cloud(folder / "folder" / "0.ply"))


def test_images_that_cannot_be_used_are_listed_and_the_others_go_on(folder):
    save(folder / "touches" / "2.png", background(3))
    save(folder / "touches" / "3.png", photo(ball())[::2])
    save(folder / "touches" / "4.png", photo(ball())[..., 0])
    done = run(folder, *READ, "--preview", "seen")
    assert done.exit_code == 0
    assert "2 of 5 images: points" in done.stdout
    lines = done.stderr.splitlines()[-3:]
    assert lines[0].startswith("touches/2.png is skipped: no contact: the gel is indented by")
    assert lines[1].startswith("touches/3.png is skipped: it has 160 x 60 pixels, but the calibration of sensor")
    assert lines[2].startswith("touches/4.png is skipped: it is an image of mode L")
    for name in ("points", "seen"):
        assert sorted(path.stem for path in (folder / name).iterdir()) == ["0", "1"]


def test_no_image_at_all_is_a_mistake(folder):
    save(folder / "touches" / "0.png", background(3))
    said = refused(folder, "read", "touches/0.png", *READ[2:-1], "touch.ply", lines=2)
    assert said.endswith("pcsr: error: none of 1 images can be used: the reasons are above\n")


def test_a_background_that_cannot_be_right_is_one_line(folder):
    save(folder / "other.png", shaded(np.zeros(SIZE), PITCH) // 3)
    save(folder / "small.png", background()[::2])
    words = ("read", "touches", "--calibration", "mine.json", "-o", "points", "--background")
    assert "--background other.png differs by 67% from that of the calibration" in refused(folder, *words, "other.png")
    assert "--background small.png has 160 x 60 pixels" in refused(folder, *words, "small.png")


def test_a_background_that_may_be_of_another_sensor_is_remarked(folder):
    for name in ("rest", "touches/0", "touches/1"):
        with Image.open(folder / f"{name}.png") as image:
            save(folder / f"{name}.png", np.clip(np.asarray(image) * 1.25, 0, 255).astype(np.uint8))
    done = run(folder, *READ)
    assert done.exit_code == 0, done.output
    said = "--background rest.png differs by 25% from that of the calibration: is it of the sensor 'mine'?\n"
    assert done.stderr.startswith(said)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-o", "points.ply"), "-o points.ply: it is one file for 2 images: name a folder"),
        (("-o", "rest.png/x"), "-o rest.png/x: rest.png is a file: name a folder"),
        (("--preview", "seen.png"), "--preview seen.png: it is one file for 2 images"),
        (("--preview", "touches"), "--preview touches: touches/0.png is an input of this command"),
        (("touches/0.png",), "touches/0.png is given twice: give each image once"),
        (("again",), "touches/0.png and again/0.jpg would both be written to points/0.ply"),
        (("none.png",), "IMAGE none.png: there is no such file or folder"),
        (("--calibration", "none.json"), "none.json cannot be read: No such file or directory"),
    ],
    ids=lambda one: " ".join(one) if isinstance(one, tuple) else None,
)
def test_a_mistake_of_reading_is_one_line_and_writes_nothing(folder, words, said):
    (folder / "again").mkdir()
    save(folder / "again" / "0.jpg", photo(ball()))
    assert said in refused(folder, *READ, *words)


def test_one_image_needs_a_format_that_is_known(folder):
    one = ("read", "touches/0.png", *READ[2:-1])
    assert "-o touch.plx: name a file with the suffix .asc, .csv" in refused(folder, *one, "touch.plx")
    assert "--preview a.jpg: name a file with the suffix .png" in refused(folder, *one, "a.ply", "--preview", "a.jpg")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda plain: plain["coefficients"].__setitem__(3, [1e9, 0.0]), "coefficients.3.0: it must be at most 1000"),
        (lambda plain: plain["coefficients"].__setitem__(3, [float("nan"), 0.0]), "coefficients.3.0: it must be a fin"),
        (lambda plain: plain["coefficients"].pop(), "coefficients: it must be a list of"),
        (lambda plain: plain.pop("held_out"), "held_out is missing: add it"),
        (lambda plain: plain["gel"].pop("dome"), "gel.dome is missing: add it"),
        (lambda plain: plain.update(mm_per_pixel=-0.1), "mm_per_pixel: it must be more than 0, got -0.1"),
        (lambda plain: plain.update(columns="160"), "columns: it must be a whole number, got '160'"),
        (lambda plain: plain.update(row=3), "takes no 'row': did you mean 'rows'?"),
        (lambda plain: plain.update(background=[]), "background must be 6 rows of 8 colours"),
        (lambda plain: plain.update(format=2), "format: it must be 1, got 2"),
    ],
)
def test_a_calibration_that_was_edited_is_checked(folder, change, said):
    plain = json.loads((folder / "mine.json").read_text())
    change(plain)
    (folder / "mine.json").write_text(json.dumps(plain))
    assert said in refused(folder, *READ)


def test_a_damaged_calibration_is_named(folder):
    text = (folder / "mine.json").read_text()
    (folder / "mine.json").write_text(text[: len(text) // 2])
    assert "mine.json is no calibration of a sensor: it is no valid JSON" in refused(folder, *READ)
