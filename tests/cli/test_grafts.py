"""Networks of somebody else at the command line: compared with and without touch, and used by `pcsr upsample`."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch
from click.testing import CliRunner

import pcsr
from pcsr.cli import pcsr as command
from pcsr.clouds.formats import read_points, write_points
from pcsr.errors import UserError
from pcsr.grafting import save_graft
from pcsr.recorded import write
from tests.foreign_networks import AT, FOLDER, module, network

TINY = [
    f"--set={setting}"
    for setting in (
        "data.shapes.count=8", "data.shapes.held_out=2", "data.points=64", "data.touch.points=32", "train.epochs=1",
        "evaluate.metrics=[cd]", "evaluate.examples=1",
    )
]  # fmt: skip


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run a command in a folder with the networks, a scan and a touch."""
    monkeypatch.chdir(tmp_path)
    for file in FOLDER.glob("*.*"):
        shutil.copy(file, tmp_path)
    directions = np.random.default_rng(0).normal(size=(80, 3))
    cloud = 50 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    write_points(Path("scan.ply"), cloud)
    write(Path("touches"), [pcsr.Touch.single(cloud[:20], None, 1.0, "digit")])
    return lambda *arguments: CliRunner().invoke(command, [str(argument) for argument in arguments])


@pytest.mark.slow
@pytest.mark.parametrize("name", AT)
def test_it_is_trained_by_a_recipe_compared_with_and_without_touch_and_used(run, tmp_path, name):
    study = tmp_path / "study.yaml"
    study.write_text(f"extends: {name}.yaml\nname: study\nmatrix: {{data.touches: [0, 2]}}\n")
    done = run("compare", "study.yaml", *TINY, "--jobs", "1", "--name", "mine")
    assert done.exit_code == 0, done.output
    page = (tmp_path / "runs" / "mine.html").read_text(encoding="utf-8")
    rows = re.findall(r'<th scope="row"><i[^>]*></i>(.*?)</th>', page)
    assert {"touches.0", "touches.2", "midpoint"} <= set(rows)
    assert done.output.count("training, loss") == 1, "both rows are of one network, whose weights are in the first run"
    (folder,) = (tmp_path / "runs").glob("study-touches.0-*")
    file = f"{name}.py"
    with_touch = [*("upsample", "scan.ply", "--model", folder, "--plugin", file, "--jobs", "1")]
    done = run(*with_touch, "-o", "dense.ply")
    assert done.exit_code == 0, done.output
    assert run(*with_touch, "-o", "touched.ply", "--touch", "touches", "--touch-as-is").exit_code == 0
    dense, touched = read_points(Path("dense.ply")), read_points(Path("touched.ply"))
    assert len(dense) == len(touched) == 320
    assert not np.array_equal(dense, touched)


@pytest.mark.parametrize("name", AT)
def test_a_graft_that_was_saved_is_a_model(run, tmp_path, name):
    made = network(name)
    grafted = pcsr.graft(made, AT[name], probe=64)
    save_graft("grafted.safetensors", grafted, touches=(2, 32))
    file = f"{name}.py"
    if name == "kernel_upsampler":  # its class needs a namespace, which a function of the user's file makes
        Path("mine.py").write_text("from kernel_upsampler import network\n\nKernelUpsampler = network\n")
        file = "mine.py"
    done = run("upsample", "scan.ply", "-o", "dense.ply", "--model", "grafted.safetensors", "--plugin", file)
    assert done.exit_code == 0, done.output
    assert len(read_points(Path("dense.ply"))) == 320
    model = pcsr.load("grafted.safetensors", plugins=[file])
    assert model.recipe.data.points == 64
    assert all(torch.equal(a, b) for a, b in zip(model.network.parameters(), grafted.parameters(), strict=True))
    assert np.array_equal(model.upsample(read_points(Path("scan.ply"))), read_points(Path("dense.ply")))


def test_a_function_may_build_the_network_of_a_graft(run, tmp_path):
    """Its class needs a namespace, which no file can hold."""
    theirs = module("kernel_upsampler")
    grafted = pcsr.graft(theirs.network(dim=8), "encoder.fuse", probe=64)
    arguments = ("upsample", "scan.ply", "-o", "dense.ply", "--model", "grafted.safetensors")
    plugin = ("--plugin", "kernel_upsampler.py")
    save_graft("grafted.safetensors", grafted, touches=(2, 32))
    done = run(*arguments, *plugin)
    assert done.exit_code == UserError.exit_code
    assert "kernel_upsampler.py:KernelUpsampler cannot be called with {}" in done.output
    assert "Save the graft again, and give save_graft the options of the network's class, or the builder" in done.output
    save_graft("grafted.safetensors", grafted, options={"dim": 8}, touches=(2, 32), builder=theirs.network)
    done = run(*arguments, *plugin)
    assert done.exit_code == 0, done.output
    assert len(read_points(Path("dense.ply"))) == 320
    with pytest.raises(UserError, match=r"builder 'neighbours' is not annotated: write `def neighbours\(…\) -> torch"):
        save_graft("grafted.safetensors", grafted, builder=theirs.neighbours)


def test_without_its_file_a_model_is_refused_and_no_other_code_is_run(run, tmp_path):
    save_graft("grafted.safetensors", pcsr.graft(network("cascade"), "first.features", probe=64))
    arguments = ("upsample", "scan.ply", "-o", "dense.ply", "--model", "grafted.safetensors")
    for more, message in {
        (): "need the network 'Cascade' of the file cascade.py: hand in that file with --plugin",
        ("--plugin", "kernel_upsampler.py"): "hand in that file with --plugin",
    }.items():
        done = run(*arguments, *more)
        assert done.exit_code == UserError.exit_code
        assert message in done.output
        assert done.output.count("\n") == 1
    Path("cascade.py").write_text("import torch\n\n\nclass Other(torch.nn.Module):\n    pass\n")
    done = run(*arguments, "--plugin", "cascade.py")
    assert "cascade.py has no network 'Cascade'" in done.output
    assert not (tmp_path / "dense.ply").exists()


def test_a_cloud_that_the_network_cannot_take_is_one_line(run, tmp_path):
    save_graft("grafted.safetensors", pcsr.graft(network("cascade"), "second.features", probe=64))
    Path("cascade.py").write_text(Path("cascade.py").read_text().replace("channels=32, k=8", "channels=32, k=90"))
    done = run("upsample", "scan.ply", "-o", "dense.ply", "--model", "grafted.safetensors", "--plugin", "cascade.py")
    assert done.exit_code == UserError.exit_code
    assert re.search(r"Cascade fails on points of \(1, 3, 64\): RuntimeError: .*k", done.output)
    assert "Traceback" not in done.output
    assert not (tmp_path / "dense.ply").exists()


def test_a_mistake_in_the_layer_is_found_before_the_data_are_built(run, tmp_path):
    done = run("run", "cascade.yaml", "--set", "model.graft.at=third.features")
    assert done.exit_code == UserError.exit_code
    assert "no layer 'third.features': did you mean 'first.features'" in done.output
    assert "It can be grafted at 'first.features' (16 channels)" in done.output
    assert not (tmp_path / "runs").exists()
