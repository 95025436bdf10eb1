"""`pcsr touch`, run as a person would run it; what it writes is what was simulated."""

import json

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

from pcsr import PoseError, ShapeItem, Touch
from pcsr.cli import pcsr
from pcsr.recorded import read, write
from tests.plugins.touch.plain_options import digit

OPTIONS = ("points", "finger", "poses", "unit", "sensor", "contact_area")


@pytest.fixture
def part(tmp_path):
    path = tmp_path / "part.stl"
    trimesh.creation.torus(0.03, 0.012, major_sections=60, minor_sections=30).export(path)
    return path


def touch(*arguments):
    return CliRunner().invoke(pcsr, ["touch", *map(str, arguments)])


def same(one, other):
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in OPTIONS)


@pytest.mark.parametrize(
    ("arguments", "options"),
    [
        ([], {}),
        (["--sensor", "gelsight-mini", "--policy", "spread"], {"sensor": "gelsight-mini", "policy": "spread"}),
        (["--sensor", "smith-2021", "--object-size", "320"], {"sensor": "smith-2021", "object_size": 320.0}),
        (
            ["--policy", "grasp", "--set", "noise.rotation_noise=1.0"],
            {"policy": "grasp", "noise": {"rotation_noise": 1.0}},
        ),
        (["--set", "press=[0.4,0.6]", "--set", "noise.blur=0.2"], {"press": (0.4, 0.6), "noise": {"blur": 0.2}}),
    ],
)
def test_what_is_read_back_is_what_was_felt_to_the_last_bit(part, tmp_path, arguments, options):
    done = touch(part, "-o", tmp_path / "touches", "--count", 3, "--seed", 4, *arguments)
    assert done.exit_code == 0, done.output
    mesh = trimesh.load(part, process=False)
    mesh.merge_vertices(merge_norm=True)
    expected = digit(**options).touches(ShapeItem("part.stl", "part.stl", mesh), np.zeros((1, 3)), 3, 4)
    recording = read(tmp_path / "touches")
    assert len(recording.touches) == 3
    assert recording.skipped == {}
    assert all(same(*pair) for pair in zip(recording.touches, expected, strict=True))


def test_it_says_what_was_felt(part, tmp_path):
    done = touch(part, "-o", tmp_path / "touches", "--count", 2)
    assert "2 touches of part.stl (60 mm long) by digit, 512 points each, contacts of " in done.output
    assert "% of its surface" in done.output


@pytest.mark.parametrize(
    ("noise", "stated"),
    [
        ([], PoseError(0.0, 0.0)),
        (["position_noise=0.3", "shared_position_noise=0.4", "rotation_noise=1.0"], PoseError(0.5, 1.0)),
        (["shared_rotation_noise=60"], PoseError(0.0, 45.0)),
    ],
)
def test_the_recording_states_the_error_of_its_poses(part, tmp_path, noise, stated):
    options = [word for term in noise for word in ("--set", f"noise.{term}")]
    done = touch(part, "-o", tmp_path / "touches", "--count", 1, *options)
    assert done.exit_code == 0, done.output
    assert read(tmp_path / "touches").pose_error == stated


def test_a_recording_of_recorded_touches_states_their_error(part, tmp_path):
    points = trimesh.load(part).sample(40, seed=0)
    for name, error in (("known", PoseError(0.3, 0.2)), ("unknown", None)):
        write(tmp_path / name, [Touch.single(points, None, 1000.0, "digit")], pose_error=error)
        command = ("--source", "recorded", "--set", f"folder={tmp_path / name}", "--count", 1)
        assert touch(part, "-o", tmp_path / f"{name}-again", *command).exit_code == 0
        assert read(tmp_path / f"{name}-again").pose_error == error


def test_the_sparse_policy_looks_at_the_cloud(part, tmp_path):
    mesh = trimesh.load(part)
    points = mesh.sample(3000, seed=0)
    np.save(tmp_path / "half.npy", points[points[:, 0] > 0])
    command = (part, "-o", tmp_path / "touches", "--count", 3, "--policy", "sparse", "--cloud", tmp_path / "half.npy")
    assert touch(*command).exit_code == 0
    assert all(one.points[:, 0].mean() < 0 for one in read(tmp_path / "touches").touches)


def test_the_format_of_the_cloud_is_given(part, tmp_path):
    points = trimesh.load(part).sample(300, seed=0)
    (tmp_path / "a.bin").write_bytes(np.hstack([points, np.ones((300, 1))]).astype("<f4").tobytes())
    command = (part, "-o", tmp_path / "touches", "--count", 1, "--cloud", tmp_path / "a.bin")
    assert "name the right one, --format kitti" in touch(*command).output
    assert touch(*command, "--format", "kitti").exit_code == 0


@pytest.mark.filterwarnings("always::pcsr.PcsrWarning")
def test_the_columns_of_a_text_cloud_are_named(part, tmp_path):
    points = trimesh.load(part).sample(300, seed=0)
    points = points[points[:, 0] > 0]
    np.savetxt(tmp_path / "half.txt", np.column_stack([np.arange(len(points)), points]), "%d %.17g %.17g %.17g")
    command = (part, "-o", tmp_path / "touches", "--count", 3, "--policy", "sparse", "--cloud", tmp_path / "half.txt")
    guessed = touch(*command).output
    assert "name the columns by --columns -,x,y,z" in guessed
    assert "it is in another unit or frame" in guessed
    done = touch(*command, "--columns", "-,x,y,z")
    assert done.exit_code == 0, done.output
    assert all(one.points[:, 0].mean() < 0 for one in read(tmp_path / "touches").touches)


def test_a_recording_is_not_overwritten_unless_asked(part, tmp_path):
    command = (part, "-o", tmp_path / "touches", "--count", 1)
    assert touch(*command).exit_code == 0
    before = json.loads((tmp_path / "touches" / "touches.json").read_text())
    again = touch(*command, "--seed", 1)
    assert again.exit_code == 2
    assert "holds a recording already" in again.output
    assert json.loads((tmp_path / "touches" / "touches.json").read_text()) == before
    assert touch(*command, "--seed", 1, "--overwrite").exit_code == 0
    assert json.loads((tmp_path / "touches" / "touches.json").read_text()) != before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--sensor", "digti"], "touch 'digit'.sensor: there is no sensor 'digti': did you mean 'digit'?\n"),
        (["--set", "pres=[0.4,0.6]"], "touch 'digit' takes no 'pres': did you mean 'press'?"),
        (["--object-size", "null"], "part.stl is 0.084 mm long, smaller than the gel"),
        (["--source", "recordde"], "there is no touch 'recordde': did you mean 'recorded'?"),
        (["--cloud", "no.ply"], "no.ply"),
        (["--format", "kitti"], "--format kitti: it is the format of --cloud, which is not given"),
        (["--columns", "x,y,z"], "--columns x,y,z: they are the columns of --cloud, which is not given"),
        (["--cloud", "a.ply", "--columns", "x,y,z"], "a.ply is a .ply file, whose format names its columns"),
    ],
)
def test_a_mistake_is_one_line_and_writes_nothing(part, tmp_path, arguments, said):
    done = touch(part, "-o", tmp_path / "touches", *arguments)
    assert done.exit_code == 2
    assert said in done.output
    assert len(done.output.strip().splitlines()) == 1
    assert not (tmp_path / "touches").exists()


def test_a_mesh_that_is_not_there_is_named(tmp_path):
    done = touch(tmp_path / "no.stl", "-o", tmp_path / "touches")
    assert done.exit_code == 2
    assert "no.stl: there is no such file" in done.output


def test_a_cloud_of_points_is_no_mesh(tmp_path):
    trimesh.PointCloud(np.eye(3)).export(tmp_path / "cloud.ply")
    done = touch(tmp_path / "cloud.ply", "-o", tmp_path / "touches")
    assert done.exit_code == 2
    assert "cloud.ply has no faces" in done.output
