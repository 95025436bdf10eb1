"""benchmarks/pugan.py on made-up shapes: which rows there are, who is given touches, and what the numbers are."""

import importlib
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from scipy.spatial import cKDTree

import pcsr
from pcsr import UserError
from pcsr.geometry.sampling import surface_points
from pcsr.metrics import point_to_surface
from pcsr.network.build import build
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr.upsample import upsample

ROOT = Path(__file__).parents[2]
with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(ROOT / "benchmarks"))
    script = importlib.import_module("pugan")

REGISTRY = load_plugins()
INTERPOLATION = ["midpoint", "midpoint, whole cloud"]
SMALL = ["model.encoder.channels=16", "model.backbone.channels=[16, 32]", "model.upsampler.hidden=8"]
MESHES = {
    "ball": trimesh.creation.icosphere(subdivisions=2),
    "box": trimesh.creation.box((2.0, 1.5, 1.0)),
    "needle": trimesh.creation.cylinder(0.002, 2.0),
}


def model(recipe, *settings, name="small"):
    """A network of a recipe, untrained."""
    (read,) = load(ROOT / "pcsr/recipes" / f"{recipe}.yaml", REGISTRY, list(settings))
    return pcsr.Model(name, build(read, REGISTRY).eval(), read, {}, None, ())


@pytest.fixture(scope="module")
def tapsr():
    return model("tapsr", *SMALL, "model.touch_encoder.channels=8", name="tapsr")


@pytest.fixture(scope="module")
def vision():
    return model("pu-transformer", *SMALL[1:], name="vision")


def shape(name="ball", touches=()):
    mesh = MESHES[name]
    rng = np.random.default_rng(0)
    sparse = {rate: surface_points(mesh, 512 // rate, rng) for rate in (4, 16)}
    return script.Shape(name, mesh, sparse, surface_points(mesh, 512, rng), touches)


@pytest.fixture
def file(tmp_path):
    """The made-up shapes in the layout of the field's."""
    shapes = [shape(name) for name in MESHES]
    arrays = {key: np.stack([one.sparse[rate] for one in shapes]) for rate, key in script.INPUTS.items()}
    arrays |= {f"vertices_{one.name}": one.mesh.vertices for one in shapes}
    arrays |= {f"faces_{one.name}": one.mesh.faces for one in shapes}
    path = tmp_path / "shapes.npz"
    np.savez(path, names=list(MESHES), gt_8192=np.stack([one.truth for one in shapes]), **arrays)
    return path


def rows(text):
    """Of each table in the output its rows, cells by name."""
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]
    tables = []
    for line in lines:
        if line[0] == "method":
            assert line[1:] == ["protocol", "cd", "hd-pugcn", "p2f", "cd, truth's frame", "spacing CV"]
            tables.append({})
        elif not line[0].startswith("-"):
            tables[-1][line[0]] = line[1:]
    return tables


def test_a_network_is_in_the_tables_of_the_rates_that_it_makes(tapsr, capsys):
    def served(one):
        return [rate for rate in (4, 16) if script.serves(*script.trained(one), rate)]

    patched = model("pu-net", "patches.rate=4")
    assert served(tapsr) == [16]
    assert served(model("frames")) == [4, 16]
    assert served(patched) == [4, 16]
    assert served(model("pu-net", "patches.rate=16")) == [16]
    assert list(script.methods([tapsr, patched], 4, 0)) == [*INTERPOLATION, "small"]
    assert capsys.readouterr().err == "tapsr cannot make 4x and is not in that table\n"
    with pytest.raises(UserError, match="model 'midpoint' has no network"):
        script.trained(pcsr.load("midpoint"))


def test_touches_go_to_the_row_that_names_them_and_only_to_networks_trained_with_some(tapsr, vision, monkeypatch):
    given = []
    monkeypatch.setattr(script, "upsample_as", lambda *args: given.append(args))
    compared = script.methods([tapsr, vision], 16, 4)
    assert list(compared) == [*INTERPOLATION, "tapsr", "tapsr, 4 touches", "vision"]
    points, contacts = np.zeros((16, 3)), (np.ones((5, 3)),)
    for name in ("tapsr", "tapsr, 4 touches", "vision"):
        compared[name].upsample(points, contacts)
    assert [touches for *_, touches in given] == [(), contacts, ()]
    assert [network for _, network, *_ in given] == [tapsr.network, tapsr.network, vision.network]
    assert list(script.methods([tapsr], 16, 1)) == [*INTERPOLATION, "tapsr", "tapsr, 1 touch"]
    assert list(script.methods([tapsr], 16, 0)) == [*INTERPOLATION, "tapsr"]


def test_each_rate_is_asked_of_the_network_whatever_it_was_trained_at():
    frames = model("frames")
    for rate in (4, 16):
        compared = script.methods([frames], rate, 2)
        points, contacts = shape().sparse[rate], (shape().truth[:40], shape().truth[40:80])
        dense = {name: method.upsample(points, contacts) for name, method in compared.items()}
        assert list(dense) == [*INTERPOLATION, "small", "small, 2 touches"]
        assert {len(cloud) for cloud in dense.values()} == {512}
        for name, one in {"small": frames, "midpoint": pcsr.load("midpoint")}.items():
            np.testing.assert_array_equal(dense[name], one.upsample(points, rate=rate))
            assert compared[name].protocol == "as pcsr upsample"
        np.testing.assert_array_equal(dense["small, 2 touches"], frames.upsample(points, contacts, rate=rate))
        away = [cKDTree(dense[name]).query(contacts[0])[0] for name in ("small, 2 touches", "small")]
        same = [float((distance < 1e-5).mean()) for distance in away]
        assert same[0] > 0.3, "many touched points are in the result, to the digit"
        assert same[1] == 0


def test_only_models_of_any_rate_without_patches_go_the_way_of_the_library(tapsr):
    patched = model("pu-net", "patches.rate=4", name="patched")
    compared = script.methods([tapsr, patched, model("frames", name="frames")], 16, 0)
    assert {name: method.protocol for name, method in compared.items()} == {
        "midpoint": "as pcsr upsample",
        "midpoint, whole cloud": "whole cloud, 4x twice",
        "tapsr": "whole cloud in one pass, as TAPSR",
        "patched": "by patches of 256 points at 4x, as PU-Net",
        "frames": "as pcsr upsample",
    }
    points = shape().sparse[16]
    whole = script.midpoint(points, 16, passes=2)
    np.testing.assert_array_equal(compared["midpoint, whole cloud"].upsample(points, ()), whole)
    np.testing.assert_array_equal(compared["tapsr"].upsample(points, ()), upsample(tapsr.network, points, 16))
    assert script.methods([], 4, 0)["midpoint, whole cloud"].protocol == "whole cloud in one pass"


def test_the_spacing_is_that_of_every_point_to_its_nearest():
    points = shape().truth[:40]
    nearest = [min(np.linalg.norm(a - b) for j, b in enumerate(points) if j != i) for i, a in enumerate(points)]
    mean = sum(nearest) / 40
    deviation = (sum((one - mean) ** 2 for one in nearest) / 40) ** 0.5
    assert script.spacing_variation(points) == pytest.approx(deviation / mean, rel=1e-9)
    assert script.scores(points, shape())[-1] == script.spacing_variation(points), "not times 10³"
    grid = np.stack(np.meshgrid(*[np.arange(4.0)] * 3), -1).reshape(-1, 3)
    assert script.spacing_variation(grid) == pytest.approx(0, abs=1e-12)


def test_shapes_that_cannot_be_touched_are_named_and_left_out(capsys):
    source = REGISTRY.get("touch", "digit")(object_size=60.0)
    kept = script.touched([shape(name) for name in MESHES], source, 2)
    assert [one.name for one in kept] == ["ball", "box"]
    said = capsys.readouterr().err
    assert said.startswith("needle is left out, as it cannot be touched: needle: touch 'digit' found 0 of 2 touches")
    assert said.count("left out, ") == 1
    for one in kept:
        assert [len(touch) for touch in one.touches] == [512, 512]
        own = point_to_surface(np.concatenate(one.touches), one.mesh.vertices, one.mesh.faces)
        assert own.max() < 0.005, "in the shape's own frame and unit: the noise is 0.02 mm of 60"
    with pytest.raises(UserError, match="none of 1 shapes can be touched 2 times"):
        script.touched([shape("needle")], source, 2)


def test_the_size_decides_how_much_a_touch_covers():
    across = []
    for size in (60.0, 240.0):
        source = REGISTRY.get("touch", "digit")(object_size=size, at_least=100)
        (one,) = script.touched([shape("box")], source, 1)
        across.append(np.ptp(one.touches[0], axis=0).max())
    assert across[0] > 2.5 * across[1]


def test_a_shift_shows_in_the_frame_of_the_truth_alone():
    one = shape()
    moved = one.truth + np.array([0.0, 0.0, 0.1])
    cd, hd, _, own, _ = script.scores(moved, one)
    assert cd == pytest.approx(0, abs=1e-9)
    assert hd == pytest.approx(0, abs=1e-9)
    radius = np.linalg.norm(one.truth - one.truth.mean(0), axis=1).max()
    both = (cKDTree(a / radius).query(b / radius)[0] for a, b in ((one.truth, moved), (moved, one.truth)))
    assert own == pytest.approx(1e3 * sum((far**2).mean() for far in both), rel=1e-4)


def test_an_outlier_moves_and_shrinks_what_fills_the_sphere_by_itself():
    one = shape()
    cd, _, _, own, _ = script.scores(np.vstack([one.truth, [[0.0, 0.0, 2.0]]]), one)
    assert cd > 2 * own


def test_the_distance_to_the_mesh_is_in_its_unit():
    one = shape("box")
    lifted = one.truth + np.where(np.isclose(one.truth[:, 2:], 0.5), [0.0, 0.0, 0.2], 0.0)
    on_top = np.isclose(one.truth[:, 2], 0.5).mean()
    assert script.scores(lifted, one)[2] == pytest.approx(1e3 * 0.2 * on_top, rel=1e-6)


def test_cells_are_means_and_standard_deviations_over_the_shapes():
    shapes = [shape("ball"), shape("box")]
    table = script.table(shapes, {"again": script.Method("unchanged", lambda points, contacts: points)}, 16, "title")
    values = np.array([script.scores(one.sparse[16], one) for one in shapes])
    cells = [next(iter(column.cells)) for column in table.columns]
    wanted = [f"{values[:, k].mean():.3f} ± {values[:, k].std(ddof=1):.3f}" for k in range(5)]
    assert cells == ["again", "unchanged", *wanted]
    alone = script.table(shapes[:1], {"a": script.Method("", lambda points, contacts: points)}, 4, "").columns[2]
    assert next(iter(alone.cells)).endswith("± nan")


def test_the_file_is_read_as_it_was_written(file):
    read = script.read(file)
    assert [one.name for one in read] == list(MESHES)
    for one in read:
        made = shape(one.name)
        assert {rate: len(cloud) for rate, cloud in one.sparse.items()} == {4: 128, 16: 32}
        np.testing.assert_array_equal(one.sparse[16], made.sparse[16])
        np.testing.assert_array_equal(one.truth, made.truth)
        np.testing.assert_array_equal(one.mesh.triangles, made.mesh.triangles)


def test_the_command_prints_both_tables(file, tmp_path, tapsr):
    weights = tmp_path / "tapsr.safetensors"
    save_weights(weights, tapsr.network, {"recipe": tapsr.recipe.resolved()})
    result = CliRunner().invoke(script.main, [str(file), str(weights), "--touches", "2"])
    assert result.exit_code == 0, result.output
    four, sixteen = rows(result.stdout)
    assert list(four) == INTERPOLATION
    assert list(sixteen) == [*INTERPOLATION, str(weights), f"{weights}, 2 touches"]
    assert "4x, 2 of 3 shapes" in result.stdout
    assert "needle is left out" in result.stderr
    one, other = (script.scores(script.midpoint(shape(name).sparse[4], 4), shape(name))[0] for name in ("ball", "box"))
    assert four["midpoint, whole cloud"][:1] == ["whole cloud in one pass"]
    assert four["midpoint, whole cloud"][1] == f"{(one + other) / 2:.3f} ± {abs(one - other) / 2**0.5:.3f}"


@pytest.mark.slow
def test_without_touches_every_shape_counts_and_without_models_the_shipped_ones(file, monkeypatch, vision):
    loaded, known = [], {"one": vision, "another": vision, "midpoint": pcsr.load("midpoint")}
    monkeypatch.setattr(script.weights, "names", lambda: ["one", "another"])
    monkeypatch.setattr(pcsr, "load", lambda name: loaded.append(name) or known[name])
    result = CliRunner().invoke(script.main, [str(file)])
    assert result.exit_code == 0, result.output
    assert [name for name in loaded if name != "midpoint"] == ["one", "another"]
    assert "16x, 3 of 3 shapes" in result.stdout
    result = CliRunner().invoke(script.main, [str(file), "--first", "2"])
    assert "16x, 2 of 3 shapes" in result.stdout


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["tapsr-"], "there are no weights 'tapsr-'"),
        (["midpoint"], "model 'midpoint' has no network"),
        (["--size", "0"], "0.0 is not in the range x>0"),
        (["--touches", "17"], "17 is not in the range 0<=x<=16"),
    ],
)
def test_mistakes_are_named(file, more, message):
    result = CliRunner().invoke(script.main, [str(file), *more])
    assert result.exit_code != 0
    assert message in result.output
    assert not isinstance(result.exception, UserError)
