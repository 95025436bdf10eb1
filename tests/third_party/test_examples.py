"""examples/third_party: separate distributions, built, installed beside pcsr, used and uninstalled."""

import re
import shlex
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest

from pcsr.clouds.formats import write_points
from pcsr.weights.file import read_card

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples" / "third_party"
pytestmark = pytest.mark.slow
PARTS = {
    "attention": "pcsr-fusion-attention",
    "taxels": "pcsr-touch-taxels",
    "tensorboard": "pcsr-logger-tensorboard",
    "wandb": "pcsr-logger-wandb",
}


@pytest.fixture(scope="module")
def place(environment, tmp_path_factory):
    """A folder with copies of the examples, which are built there and installed."""
    folder = tmp_path_factory.mktemp("examples")
    shutil.copytree(EXAMPLES, folder, dirs_exist_ok=True)
    for name in PARTS.values():
        environment(f"pip wheel -w wheels ./{name}", folder)
        environment(f"pip install wheels/{name.replace('-', '_')}-0.1.0-py3-none-any.whl", folder)
    return folder


@pytest.fixture(scope="module")
def run_folder(environment, place):
    """Of a network that was trained with a part of each."""
    environment("pcsr run recipe.yaml", place)
    (folder,) = (place / "runs").glob("third-party-*")
    return folder


def listed(printed):
    """Owner and version of each part in the table of `pcsr plugins`."""
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in printed.splitlines()]
    return {(row[0], row[1]): row[2:4] for row in rows if len(row) == 5}


def test_all_examples_are_tested():
    networks = "networks"  # tests/grafting/test_foreign_styles.py
    assert {path.name for path in EXAMPLES.iterdir() if path.is_dir()} == {*PARTS.values(), networks}


def test_their_parts_are_listed_with_their_owners(environment, place):
    rows = [
        [cell.strip() for cell in line.split("│")[1:-1]] for line in environment("pcsr plugins", place).splitlines()
    ]
    owners = {(row[0], row[1]): row[2:4] for row in rows if len(row) == 5}
    assert owners["fusion", "attention"] == ["pcsr-fusion-attention", "0.1.0"]
    assert owners["touch", "taxels"] == ["pcsr-touch-taxels", "0.1.0"]
    assert owners["logger", "tensorboard"] == ["pcsr-logger-tensorboard", "0.1.0"]
    assert owners["logger", "wandb"] == ["pcsr-logger-wandb", "0.1.0"]
    assert owners["fusion", "iterative"][0] == "pcsr"


def test_their_own_tests_pass(environment, place):
    message = environment(f"pytest -q -p no:cacheprovider {' '.join(PARTS.values())}", place)
    assert int(re.search(r"(\d+) passed", message)[1]) >= 30


def test_a_recipe_runs_with_both(run_folder):
    card = read_card(run_folder / "weights.safetensors")
    assert [(part["kind"], part["owner"], part["version"]) for part in card["parts"]] == [
        ("touch", "pcsr-touch-taxels", "0.1.0"),
        ("fusion", "pcsr-fusion-attention", "0.1.0"),
    ]
    assert (run_folder / "report.html").is_file()


def test_uninstalled_it_leaves_the_rest_working_and_is_explained(environment, place, run_folder):
    scan = np.random.default_rng(0).normal(size=(200, 3))
    write_points(place / "scan.ply", scan / np.linalg.norm(scan, axis=1, keepdims=True))
    environment("pip uninstall -y pcsr-fusion-attention", place)
    try:
        owners = listed(environment("pcsr plugins", place))
        assert ("fusion", "attention") not in owners
        assert {("touch", "taxels"), ("fusion", "iterative")} <= owners.keys()
        why = environment("pcsr plugins --why attention", place, code=2)
        assert "no installed plugin registers a part or is called 'attention'" in why
        message = environment("pcsr recipe check recipe.yaml", place, code=2)
        assert "recipe.yaml:12:17: there is no fusion 'attention'" in message
        # Nothing that is installed knows who brought it; the weights do.
        message = environment(f"pcsr upsample scan.ply -o dense.ply --model runs/{run_folder.name}", place, code=2)
        assert (
            "need fusion 'attention' of pcsr-fusion-attention 0.1.0: pip install pcsr-fusion-attention==0.1.0"
            in message
        )
        environment("pcsr recipe check recipe.yaml --set model.fusion=iterative", place)
    finally:
        environment("pip install wheels/pcsr_fusion_attention-0.1.0-py3-none-any.whl", place)


def test_the_wheel_of_pcsr_has_all_that_a_plugin_author_needs(environment, tmp_path):
    environment(f"pip wheel -w . {shlex.quote(str(ROOT))}", tmp_path)
    (wheel,) = tmp_path.glob("pcsr-*.whl")
    held = set(zipfile.ZipFile(wheel).namelist())
    wanted = {path.relative_to(ROOT).as_posix() for path in (ROOT / "pcsr" / "cli" / "templates").iterdir()}
    assert len(wanted) >= 10
    assert wanted <= held
    assert not [name for name in held if name.split("/")[0] in ("tests", "recipes", "docs", "examples")]
