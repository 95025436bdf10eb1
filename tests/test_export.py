"""Networks as ONNX graphs: onnxruntime gives what torch gives, and what cannot be exported is said."""

import json
import sys

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from click.testing import CliRunner
from scipy.spatial import cKDTree

import pcsr.cli
from pcsr.cli.export import export
from pcsr.contracts import TouchBatch, Upsampler
from pcsr.errors import UserError
from pcsr.export import export_onnx
from pcsr.geometry.neighbours import knn, neighbour_max
from pcsr.model import Model, load
from pcsr.network.build import build
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import MODEL, from_resolved
from tests.small_model import M, N, clouds, tiny_model


@pytest.fixture
def tiny():
    return tiny_model()


@pytest.fixture(scope="module")
def shipped():
    return load("tapsr")


@pytest.fixture(scope="module", params=[0, 2], ids=lambda touches: f"{touches} touches")
def exported(request, shipped, tmp_path_factory):
    path = tmp_path_factory.mktemp("onnx") / "folder" / "model.onnx"
    shapes = export_onnx(shipped, path, points=N, touches=request.param, touch_points=M)
    return path, request.param, shapes


def run(source, *inputs):
    """What onnxruntime makes of a graph, in a file or in memory."""
    session = onnxruntime.InferenceSession(source, providers=["CPUExecutionProvider"])
    names = [given.name for given in session.get_inputs()]
    assert len(names) == len(inputs)
    return session.run(None, {name: tensor.numpy() for name, tensor in zip(names, inputs, strict=True)})[0]


@pytest.mark.slow
@pytest.mark.parametrize("batch", [1, 3])
def test_onnxruntime_gives_what_torch_gives(exported, shipped, batch):
    path, touches, _ = exported
    inputs = clouds(batch, touches)
    with torch.inference_mode():
        expected = shipped.network(inputs[0], shipped.recipe.data.rate, *map(TouchBatch.of, inputs[1:]))
    dense = run(path, *inputs)
    assert dense.shape == (batch, shipped.recipe.data.rate * N, 3)
    np.testing.assert_allclose(dense, expected, atol=1e-4)


@pytest.mark.slow
def test_points_that_coincide_give_the_same_set(exported, shipped):
    path, touches, _ = exported
    inputs = [tensor.clone() for tensor in clouds(1, touches)]
    inputs[0][:, 1::2] = inputs[0][:, ::2]  # which of two equal points is the nearer, nobody can say
    with torch.inference_mode():
        expected = shipped.network(inputs[0], shipped.recipe.data.rate, *map(TouchBatch.of, inputs[1:]))[0]
    dense = run(path, *inputs)[0]
    assert cKDTree(expected).query(dense)[0].max() < 1e-4
    assert cKDTree(dense).query(expected)[0].max() < 1e-4


@pytest.mark.slow
def test_the_file_says_what_it_is_and_nothing_of_the_machine(exported, shipped):
    path, touches, shapes = exported
    model = onnx.load(path)
    onnx.checker.check_model(model, full_check=True)
    about = {entry.key: entry.value for entry in model.metadata_props}
    assert from_resolved(json.loads(about["pcsr.recipe"]), load_plugins(), parts=MODEL) == shipped.recipe
    assert json.loads(about["pcsr.card"]) == shipped.card
    assert about["pcsr.version"] == pcsr.__version__
    written = {
        value.name: tuple(d.dim_param or d.dim_value for d in value.type.tensor_type.shape.dim)
        for value in (*model.graph.input, *model.graph.output)
    }
    assert {name: ("b", *shape[1:]) for name, shape in written.items()} == shapes
    assert all(shape[0] == "batch" for shape in written.values())
    assert shapes["points"] == ("b", N, 3)
    assert shapes.get("touches") == (("b", touches, M, 3) if touches else None)
    content = path.read_bytes()
    assert not [word for word in (b"site-packages", b"pcsr_plugins", b".py") if word in content]
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.slow
def test_the_model_stays_as_it_is_and_a_batch_can_be_fixed(tiny, tmp_path):
    tiny.network.train()
    before = {name: tensor.clone() for name, tensor in tiny.network.state_dict().items()}
    shapes = export_onnx(tiny, tmp_path / "tiny.onnx", batch=2)
    assert shapes == {"points": (2, 32, 3), "dense": (2, 128, 3)}
    assert tiny.network.training
    assert all(weight.requires_grad for weight in tiny.network.parameters())
    assert all(torch.equal(before[name], tensor) for name, tensor in tiny.network.state_dict().items())
    points = clouds(2, 0)[0][:, :32]
    with torch.no_grad():
        expected = tiny.network.eval()(points, 4)
    np.testing.assert_allclose(run(tmp_path / "tiny.onnx", points), expected, atol=1e-4)


class Sorted(Upsampler):
    """Every operator that is translated here."""

    def forward(self, points, features, rate):
        rising = torch.argsort(points[..., 0], dim=-1, stable=True)
        falling = torch.argsort(points[..., 1], dim=1, stable=True, descending=True)
        order = torch.cat([rising, falling] * (rate // 2), 1).float()[..., None]
        return order + torch.cdist(points[:, :10] / 2, points).mean(1).repeat(1, rate)[..., None] * torch.ones(3)


@pytest.mark.slow
def test_translated_operators_give_what_torch_gives(tiny, tmp_path):
    tiny.network.upsampler = Sorted()
    export_onnx(tiny, tmp_path / "sorted.onnx")
    points = torch.randint(0, 4, (3, 32, 3)).float()  # full of ties
    with torch.no_grad():
        expected = tiny.network(points, 4)
    np.testing.assert_allclose(run(tmp_path / "sorted.onnx", points), expected, atol=1e-4)


def test_exporting_branches_give_what_the_usual_ones_give(monkeypatch):
    points = torch.rand(2, 50, 3)
    near, greatest = knn(points[:, :7], points, 5), neighbour_max(points, knn(points, points, 5))
    monkeypatch.setattr(torch.compiler, "is_exporting", lambda: True)
    assert torch.equal(knn(points[:, :7], points, 5), near)
    assert torch.equal(neighbour_max(points, knn(points, points, 5)), greatest)


class Undecided(Upsampler):
    """Looks at the numbers to choose the way, as no graph can."""

    def forward(self, points, features, rate):
        if points.sum() > 0:
            return points.repeat(1, rate, 1)
        return -points.repeat(1, rate, 1)


class OfTwo(Upsampler):
    """Knows batches of two alone."""

    def forward(self, points, features, rate):
        if points.shape[0] != 2:
            raise ValueError("two are wanted")
        return points.repeat(1, rate, 1)


def test_what_cannot_be_exported_is_said_and_the_old_file_stays(tiny, tmp_path):
    path = tmp_path / "old.onnx"
    path.write_bytes(b"old")
    tiny.network.upsampler = Undecided()
    with pytest.raises(UserError, match="the network of 'tiny' cannot be written as ONNX: ") as caught:
        export_onnx(tiny, path)
    assert "\n" not in str(caught.value)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.slow
def test_a_batch_that_must_be_fixed_is_said(tiny, tmp_path):
    tiny.network.upsampler = OfTwo()
    with pytest.raises(UserError, match=r"needs a fixed batch size: give one \(batch=1, or --batch 1\)"):
        export_onnx(tiny, tmp_path / "two.onnx")
    export_onnx(tiny, tmp_path / "two.onnx", batch=2)
    assert run(tmp_path / "two.onnx", clouds(2, 0)[0][:, :32]).shape == (2, 128, 3)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"points": 4}, "6 neighbours were asked of 4 points"),
        ({"points": 0}, "points is 0: it must be 1 or more"),
        ({"touches": -1}, "touches is -1: 'tiny' was trained with at most 5"),
        ({"touches": 6}, "touches is 6: 'tiny' was trained with at most 5: give 0 to 5"),
        ({"touch_points": 0}, "touch_points is 0"),
        ({"batch": 0}, "batch is 0: it must be 1 or more"),
    ],
)
def test_impossible_numbers_are_said(tiny, tmp_path, options, said):
    with pytest.raises(UserError, match=said):
        export_onnx(tiny, tmp_path / "model.onnx", **options)
    assert not list(tmp_path.iterdir())


def test_a_fusion_that_joins_touches_goes_without_them_only(tiny, tmp_path):
    plain = tiny.recipe.resolved()
    plain["model"] |= {"fusion": {"use": "none"}, "touch_encoder": None}
    recipe = from_resolved(plain, load_plugins())
    joining = Model("joining", build(recipe, load_plugins()).eval(), recipe, {}, None, ())
    with pytest.raises(UserError, match="the fusion of 'joining' adds the touched points to the cloud"):
        export_onnx(joining, tmp_path / "model.onnx", touches=1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("part", "touches", "said"),
    [
        ({"upsampler": {"use": "edge-offsets"}}, 0, "its upsampler makes more points .* such as 'shuffle'"),
        ({"fusion": {"use": "edge-conv"}}, 1, "with touches the network has more points .* export it without touches"),
    ],
)
def test_a_network_whose_points_are_thinned_is_refused(tiny, tmp_path, part, touches, said):
    plain = tiny.recipe.resolved()
    plain["model"] |= part
    recipe = from_resolved(plain, load_plugins())
    thinned = Model("thinned", build(recipe, load_plugins()).eval(), recipe, {}, None, ())
    with pytest.raises(UserError, match=said):
        export_onnx(thinned, tmp_path / "model.onnx", touches=touches)
    assert not list(tmp_path.iterdir())


def test_interpolation_and_folders_are_refused(tiny, tmp_path):
    with pytest.raises(UserError, match="model 'midpoint' has no network"):
        export_onnx(load("midpoint"), tmp_path / "model.onnx")
    with pytest.raises(UserError, match="is a folder: name the file"):
        export_onnx(tiny, tmp_path)


@pytest.mark.parametrize("package", ["onnx", "onnxscript"])
def test_a_missing_extra_is_named(tiny, tmp_path, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(UserError, match=rf"needs {package}, which is not installed: pip install 'pcsr\[onnx\]'"):
        export_onnx(tiny, tmp_path / "model.onnx")


def test_the_command_hands_everything_on(monkeypatch, tmp_path):
    def fake(model, path, **options):
        path.write_bytes(b"0" * 123_456)
        asked.append((model.name, path, options))
        return {"points": ("b", 64, 3), "touches": ("b", 2, 32, 3), "dense": ("b", 1024, 3)}

    asked, out = [], tmp_path / "model.onnx"
    monkeypatch.setattr("pcsr.export.export_onnx", fake)
    arguments = ["midpoint", "-o", str(out), "--touches", "2", "--points", "64", "--touch-points", "32"]
    result = CliRunner().invoke(export, arguments)
    assert result.output == f"{out}: points (b 64 3), touches (b 2 32 3) to dense (b 1024 3), 0.1 MB\n"
    options = {"points": 64, "touches": 2, "touch_points": 32, "batch": None}
    assert asked == [("midpoint", out, options)]
    assert CliRunner().invoke(export, [*arguments, "--batch", "8"]).exit_code == 0
    assert asked[1][2] == {**options, "batch": 8}
    for wrong in ("0", "many"):
        assert CliRunner().invoke(export, [*arguments, "--batch", wrong]).exit_code == 2
    assert len(asked) == 2


def test_the_command_says_what_is_wrong_in_one_line(tmp_path):
    result = CliRunner().invoke(pcsr.cli.pcsr, ["export", "midpoint", "-o", str(tmp_path / "m.onnx")])
    assert (result.exit_code, result.output.count("\n")) == (2, 1)
    assert "model 'midpoint' has no network" in result.output
