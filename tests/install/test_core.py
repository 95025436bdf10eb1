"""`pip install pcsr` with no extra: upsampling, measuring and grafting work, all else names the extra that it needs."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from packaging.requirements import Requirement

from pcsr import Touch
from pcsr.cli import COMMANDS
from pcsr.clouds.formats import read_points, write_points
from pcsr.extras import PACKAGES
from pcsr.recorded import write

ROOT = Path(__file__).parents[2]
CODE = """
import numpy as np
import torch
import pcsr

pcsr.load
import pcsr.model

directions = np.random.default_rng(0).normal(size=(1100, 3))
cloud = 50 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
few = cloud[:100]
model = pcsr.load()
dense = model.upsample(few, [few[:20] + 1.0], rate=2)
assert dense.shape == (200, 3)
assert pcsr.load("midpoint").upsample(few, rate=2).shape == (200, 3)
assert set(pcsr.evaluate(dense, dense[::-1])) == {"cd", "hd", "hd-pugcn", "emd"}, "up to 1024 points scipy is enough"
assert set(pcsr.evaluate(cloud, cloud)) == {"cd", "hd", "hd-pugcn"}
try:
    pcsr.evaluate(cloud, cloud, metrics=["emd"])
except pcsr.UserError as error:
    assert "emd of more than 1024 points needs pot, which is not installed: pip install 'pcsr[train]'" in str(error)
else:
    raise AssertionError("emd was measured without POT")


class Net(torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.features = torch.nn.Linear(3, 8)
        self.out = torch.nn.Linear(8, 3)

    def forward(self, x):
        return self.out(self.features(x))


grafted = pcsr.graft(Net(), at="features", fusion="concat")
points = torch.from_numpy(few[None]).float()
assert grafted(points, touches=torch.from_numpy(few[None, None, :20]).float()).shape == (1, 100, 3)
assert pcsr.recorded.read("touches").touches
"""
SMALL = ["--set", "touches=0", "--set", "points=32", "--set", "rate=2"]
WORK = {
    "code": ["-c", CODE],
    "upsample": ["upsample", "scan.ply", "-o", "dense.ply", "--rate", "2"],
    "upsample with touches": ["upsample", "scan.ply", "-o", "touched.xyz", "--rate", "2", "--touch", "touches"],
    "evaluate": ["evaluate", "large.ply", "large.ply"],
    "recipe check": ["recipe", "check", str(ROOT / "pcsr/recipes" / "pu-gan.yaml")],
    "plugins": ["plugins"],
    # Meshes of one's own, without touches and without a camera: nothing is simulated.
    "data make": ["data", "make", "objects", "-o", "data", "--jobs", "1", *SMALL],
}
REFUSED = {
    "touch": (["touch", "objects/ball.stl", "-o", "new"], "touch 'digit' needs embreex", "simulate"),
    "data make": (
        ["data", "make", "cad-parts", "-o", "new"],
        "shapes 'cad-parts' needs manifold3d, touch 'digit' needs embreex, none of which is installed",
        "simulate",
    ),
    "view": (
        ["data", "make", "objects", "-o", "new", "--set", "touches=0", "--set", "sampling=view"],
        "sampling: view needs embreex",
        "simulate",
    ),
    "data info": (["data", "info", "data"], "the page of pictures needs plotly", "report"),
    "figures": (["figures", "run"], "a figure needs matplotlib", "report"),
    "run": (
        ["run", str(ROOT / "pcsr/recipes" / "tapsr.yaml"), "--runs", "new"],
        "training needs lightning-fabric, the report needs plotly, the metric 'emd' needs pot, "
        "shapes 'cad-parts' needs manifold3d, touch 'digit' needs embreex",
        "report,simulate,train",
    ),
    "run a matched loss": (
        ["run", str(ROOT / "pcsr/recipes" / "pu-net.yaml"), "--runs", "new", "--set", "evaluate.metrics=[cd]"],
        "objective 'pu-net' needs pot",
        "train",
    ),
    "compare": (
        ["compare", str(ROOT / "pcsr/recipes" / "smoke.yaml"), "--seeds", "2", "--runs", "new"],
        "training needs lightning-fabric",
        "train",
    ),
    "plugins check": (["plugins", "check", "digit"], "touch 'digit' needs embreex", "simulate"),
    "evaluate": (["evaluate", "large.ply", "large.ply", "--metric", "emd"], "needs pot", "train"),
    "read PCD": (["upsample", "scan.pcd", "-o", "new.ply"], "scan.pcd: the format PCD needs pypcd4", "pcd"),
    "write PCD": (["upsample", "scan.ply", "-o", "new.pcd"], "the format PCD needs pypcd4", "pcd"),
    "read a bag": (["upsample", "scan.mcap:/points", "-o", "new.ply"], "a ROS bag needs rosbags", "ros"),
    "import a bag": (
        ["recorded", "import", "scan.mcap", "--touch", "/gel", "--pose", "gel", "-o", "new"],
        "a ROS bag needs rosbags",
        "ros",
    ),
    "write LAS": (["upsample", "scan.ply", "-o", "new.las"], "the format LAS needs laspy", "las"),
    "surface": (["upsample", "scan.ply", "-o", "new.ply", "--mesh", "new.obj"], "needs open3d", "open3d"),
    "page of clouds": (["view", "scan.ply"], "the viewer needs plotly", "report"),
    "picture of clouds": (["view", "scan.ply", "-o", "new.png"], "a picture needs matplotlib", "report"),
    "Dask": (
        ["upsample", "scan.ply", "-o", "new.ply", "--scheduler", "tcp://localhost:1"],
        "--scheduler tcp://localhost:1 needs distributed",
        "cluster",
    ),
    "hub": (["upsample", "scan.ply", "-o", "new.ply", "--model", "some/one"], "needs huggingface-hub", "hub"),
    "ONNX": (["export", "tapsr", "-o", "new.onnx"], "exporting a graph needs onnx", "onnx"),
}
HELP = [["--help"], *([name, "--help"] for name in COMMANDS)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Clouds, a mesh and a recording."""
    path = tmp_path_factory.mktemp("core")
    directions = np.random.default_rng(0).normal(size=(1100, 3))
    cloud = 50 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    write_points(path / "scan.ply", cloud[:100])
    write_points(path / "large.ply", cloud)
    (path / "scan.pcd").write_bytes(b"# .PCD v0.7\n")
    (path / "scan.mcap").write_bytes(b"\x89MCAP0\r\n")
    (path / "objects").mkdir()
    for name in ("ball", "other", "third"):
        trimesh.creation.icosphere(subdivisions=2, radius=50).export(path / "objects" / f"{name}.stl")
    write(path / "touches", [Touch.single(cloud[:20], None, 1.0, "digit")])
    return path


@pytest.fixture(scope="module")
def outcomes(folder, absent):
    """What each command did in a process without the extras."""
    commands = [*HELP, *WORK.values(), *(command for command, _, _ in REFUSED.values())]
    done = subprocess.run(
        [sys.executable, Path(__file__).with_name("bare.py")],
        input=json.dumps({"absent": absent, "commands": commands}),
        capture_output=True,
        text=True,
        cwd=folder,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return dict(zip(map(tuple, commands), json.loads(done.stdout), strict=True))


def test_every_optional_package_that_is_here_is_hidden(absent):
    """Also those that optional packages bring along; what the core needs is not."""
    assert {"embreex", "manifold3d", "lightning_fabric", "ot", "plotly", "matplotlib", "pypcd4", "aiohttp"} <= set(
        absent
    )
    assert not {"torch", "numpy", "scipy", "trimesh", "PIL", "networkx", "yaml_that_nobody_has"} & set(absent)


@pytest.mark.slow
@pytest.mark.parametrize("name", WORK)
def test_the_core_works(outcomes, folder, name):
    outcome = outcomes[tuple(WORK[name])]
    assert outcome["code"] == 0, outcome["err"]
    assert set(outcome["asked"]) <= {"ot"}, "none is looked for, but POT where emd may be measured"


def test_the_core_upsamples_files(outcomes, folder):
    assert len(read_points(folder / "dense.ply")) == len(read_points(folder / "touched.xyz")) == 200


def test_evaluate_says_what_it_leaves_out(outcomes):
    outcome = outcomes[tuple(WORK["evaluate"])]
    assert "hd-pugcn" in outcome["out"]
    assert "emd" not in outcome["out"].split()
    said = "skipped: emd of more than 1024 points needs pot, which is not installed: pip install 'pcsr[train]'"
    assert said in outcome["err"]


@pytest.mark.parametrize("name", REFUSED)
def test_what_needs_an_extra_names_it(outcomes, folder, name):
    command, words, extras = REFUSED[name]
    outcome = outcomes[tuple(command)]
    assert outcome["code"] == 2, outcome
    assert len(outcome["err"].strip().splitlines()) == 1
    assert words in outcome["err"]
    named = set(outcome["err"].rpartition("pip install 'pcsr[")[2].rpartition("]'")[0].split(","))
    assert set(extras.split(",")) <= named
    assert not list(folder.glob("new*")), "nothing is written"


@pytest.mark.parametrize("page", HELP, ids=" ".join)
def test_no_help_page_asks_for_an_extra(outcomes, page):
    outcome = outcomes[tuple(page)]
    assert outcome["code"] == 0
    assert outcome["asked"] == []


def test_the_table_of_packages_is_that_of_the_extras(project):
    extras = project["optional-dependencies"]
    declared = {
        (Requirement(line).name, extra): Requirement(line)
        for extra, lines in extras.items()
        if extra != "all"
        for line in lines
    }
    brought = {("lazrs", "las")}  # by laspy[lazrs]
    assert {(package.title, package.extra) for package in PACKAGES.values()} == declared.keys() | brought
    for package in PACKAGES.values():
        requirement = declared.get((package.title, package.extra))
        for machine in ("x86_64", "aarch64", "arm64", "AMD64"):
            here = (
                requirement is None
                or not requirement.marker
                or requirement.marker.evaluate({"platform_machine": machine})
            )
            assert here == (machine not in package.machines_without)


def test_all_is_every_extra_but_open3d(project):
    extras = project["optional-dependencies"]
    (everything,) = map(Requirement, extras["all"])
    assert everything.extras == extras.keys() - {"all", "open3d"}
