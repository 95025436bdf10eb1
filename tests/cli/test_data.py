"""`pcsr data`, run as a person would run it."""

import json

import pytest
import trimesh
from click.testing import CliRunner

from pcsr.cli import pcsr

SMALL = ["touch=caps", "points=16", "rate=4", "touches=2"]


@pytest.fixture
def data(world):
    """Run `pcsr data …` with the small world's parts at hand."""

    def run(*arguments, settings=()):
        made = [word for setting in settings for word in ("--set", setting)]
        plugin = ["--plugin", str(world)] if arguments[0] == "make" else []
        return CliRunner().invoke(pcsr, ["data", *map(str, arguments), *made, *plugin], env={"COLUMNS": "200"})

    return run


def test_make_builds_every_split_and_says_what_is_in_them(data, tmp_path):
    done = data("make", "balls", "-o", tmp_path, settings=[*SMALL, "count=5", "held_out=1", "bad=[2]"])
    assert done.exit_code == 0, done.output
    assert "16 points to 64 (poisson; sparse: random), 2 touches, seed 0" in done.output
    assert "rejected from train: train/002: a bad ball" in done.output
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert {split: about["objects"] for split, about in manifest["splits"].items()} == {
        "train": 4,
        "validation": 1,
        "test": 1,
    }


def test_make_again_changes_nothing(data, tmp_path):
    command = ("make", "balls", "-o", tmp_path / "out")
    first = data(*command, settings=[*SMALL, "count=3"])
    before = {path: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    again = data(*command, settings=[*SMALL, "count=3"])
    assert (first.exit_code, again.exit_code) == (0, 0)
    assert {path: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before
    other = data(*command, settings=[*SMALL, "count=4"])
    assert other.exit_code == 2
    assert "holds other data" in other.output


def test_make_takes_a_folder_of_meshes(data, tmp_path):
    (tmp_path / "parts").mkdir()
    for size in (1, 2):
        trimesh.creation.box((size, 2, 3)).export(tmp_path / "parts" / f"{size}.stl")
    (tmp_path / "parts" / "torn.stl").write_text("not a mesh")
    settings = ["touches=0", "points=16", "rate=2", "validation=0.0", "test=0.0"]
    done = data("make", tmp_path / "parts", "-o", tmp_path / "out", settings=settings)
    assert done.exit_code == 0, done.output
    assert "no validation data" in done.output
    about = json.loads((tmp_path / "out" / "manifest.json").read_text())["splits"]["train"]
    assert about["objects"] == 2
    assert list(about["rejected"]) == ["torn.stl"]
    assert "torn.stl: it has 10 bytes, and an STL file has 84 or more" in about["rejected"]["torn.stl"]


def test_data_of_which_nothing_can_be_used_is_a_failure_with_its_reasons(data, tmp_path):
    done = data("make", "balls", "-o", tmp_path, settings=[*SMALL, "count=2", "bad=[0, 1]"])
    assert done.exit_code == 2
    assert "rejected from train: 2 objects, such as train/000: a bad ball" in done.output
    assert "none of the objects of 'balls' could be used" in done.output


@pytest.mark.parametrize(
    ("shapes", "setting", "said"),
    [
        (
            "cad-part",
            "count=1",
            "'cad-part' is neither a folder, nor a recipe, nor a shape source: did you mean 'cad-parts'?",
        ),
        ("balls", "cuont=1", "--set cuont=1: shapes 'balls' takes no 'cuont': did you mean 'count'?"),
        ("balls", "points=4", "--set points=4: data.points: it must be 16 or more, got 4"),
        ("balls", "touch=tuoch", "there is no touch 'tuoch'"),
        (
            "balls",
            "sampling=look",
            "data.sampling: it must be 'random', 'poisson', 'fps', 'view' or 'mixed', got 'look'",
        ),
    ],
)
def test_a_mistake_is_one_line_and_makes_no_folder(data, tmp_path, shapes, setting, said):
    done = data("make", shapes, "-o", tmp_path / "out", settings=[setting])
    assert done.exit_code == 2
    assert said in done.output
    assert len(done.output.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_info_prints_it_again_and_draws_the_objects(data, tmp_path):
    data("make", "balls", "-o", tmp_path / "out", settings=[*SMALL, "count=6"])
    done = data("info", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert "pictures of train/000, train/001, train/003, train/004: " in done.output
    page = (tmp_path / "out" / "info.html").read_text(encoding="utf-8")
    drawn = json.loads(page.split('id="drawn">')[1].split("</script>")[0])
    assert [row["name"] for row in drawn["examples"]] == ["train/000", "train/001", "train/003", "train/004"]
    titles = [view["title"] for view in drawn["examples"][0]["views"]]
    assert titles[0] == "(a) truth, 64 points"
    assert titles[1].startswith("(b) 16 points, 2 touches, ")
    assert titles[2] == "(c) the first touch, 20 points"
    counts = [len(trace["x"]) for view in drawn["examples"][0]["views"] for trace in view["traces"]]
    assert counts == [64, 16, 40, 20]


def test_info_shows_the_object_that_is_asked_for(data, tmp_path):
    data("make", "balls", "-o", tmp_path / "out", settings=[*SMALL, "count=3", "held_out=2"])
    done = data("info", tmp_path / "out", "--object", "test/001", "--picture", tmp_path / "one.html")
    assert done.exit_code == 0, done.output
    assert "test/001" in (tmp_path / "one.html").read_text(encoding="utf-8")
    assert not (tmp_path / "out" / "info.html").exists()
    wrong = data("info", tmp_path / "out", "--object", "test/00l")
    assert wrong.exit_code == 2
    assert "has no object 'test/00l': did you mean 'test/00" in wrong.output


def test_info_without_touches_shows_two_views(data, tmp_path):
    data("make", "balls", "-o", tmp_path / "out", settings=["touches=0", "points=16", "rate=2", "count=1"])
    assert data("info", tmp_path / "out").exit_code == 0
    page = (tmp_path / "out" / "info.html").read_text(encoding="utf-8")
    drawn = json.loads(page.split('id="drawn">')[1].split("</script>")[0])
    assert len(drawn["examples"][0]["views"]) == 2


def test_info_of_something_else_is_one_line(data, tmp_path):
    done = data("info", tmp_path)
    assert done.exit_code == 2
    assert "holds no manifest.json" in done.output


def test_info_verifies_every_file_if_it_is_asked_to(data, tmp_path):
    data("make", "balls", "-o", tmp_path / "out", settings=[*SMALL, "count=3", "held_out=1"])
    assert "files not verified" in data("info", tmp_path / "out").output
    whole = data("info", tmp_path / "out", "--verify")
    assert whole.exit_code == 0, whole.output
    assert "all 3 files are intact" in whole.output
    for name in ("test", "validation"):
        shard = tmp_path / "out" / f"{name}-00000.safetensors"
        shard.write_bytes(shard.read_bytes()[:-1] + b"?")
    assert data("info", tmp_path / "out").exit_code == 0, "it shows objects that are trained on"
    done = data("info", tmp_path / "out", "--verify")
    assert done.exit_code == 2
    for name in ("test", "validation"):
        assert f"{name}-00000.safetensors has changed since it was built" in done.output
    assert "2 of the 3 files" in done.output
    data("make", "balls", "-o", tmp_path / "out", settings=[*SMALL, "count=3", "held_out=1"])
    assert data("info", tmp_path / "out", "--verify").exit_code == 0


def test_info_shows_no_object_of_a_damaged_file(data, tmp_path):
    data("make", "balls", "-o", tmp_path / "out", settings=[*SMALL, "count=3"])
    shard = tmp_path / "out" / "train-00000.safetensors"
    shard.write_bytes(shard.read_bytes()[:-1] + b"?")
    done = data("info", tmp_path / "out")
    assert done.exit_code == 2
    assert "train-00000.safetensors has changed since it was built" in done.output


def test_make_takes_the_data_of_a_recipe(data, tmp_path):
    (tmp_path / "mine.yaml").write_text(
        "name: mine\ndata: {shapes: {use: balls, count: 3}, touch: caps, touches: 2, points: 16, rate: 4}\n"
    )
    done = data("make", tmp_path / "mine.yaml", "-o", tmp_path / "out", settings=["rate=2"])
    assert done.exit_code == 0, done.output
    assert json.loads((tmp_path / "out" / "manifest.json").read_text())["splits"]["train"]["objects"] == 3
    assert "16 points to 32" in done.output
    (tmp_path / "many.yaml").write_text("name: many\nmatrix: {data.touches: [0, 1]}\n")
    many = data("make", tmp_path / "many.yaml", "-o", tmp_path / "other")
    assert many.exit_code == 2
    assert "many.yaml describes 2 runs" in many.output
