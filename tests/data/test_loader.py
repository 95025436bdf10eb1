"""`pcsr.Loader`: batches for a training loop of one's own, the same as those of `pcsr run`."""

import os
import subprocess
import sys

import pytest
import torch

import pcsr
from pcsr.data.batches import Batches
from pcsr.data.build import build_split
from pcsr.data.dataset import Split
from pcsr.data.loader import DEFAULT_AUGMENT
from pcsr.data.plan import Plan
from pcsr.errors import UserError
from pcsr.workers import worker_pool
from tests.data.splits import clouds
from tests.processes import ROOT


@pytest.fixture(scope="module")
def folder(tmp_path_factory, registry):
    """Seven objects to train on, with two touches each."""
    from pcsr.recipe import for_data

    settings = ["touch=caps", "points=16", "rate=4", "touches=2"]
    plan = Plan.of(for_data("balls", {}, registry, [*settings, "count=7", "held_out=2"]), registry)
    made = tmp_path_factory.mktemp("data")
    with worker_pool(1) as workers:
        for split in plan.names:
            build_split(plan, split, made, workers)
    return made


def test_the_batches_are_those_of_a_run(folder):
    loader = pcsr.Loader(folder, batch=3, touches=(0, 2), seed=5)
    expected = Batches(Split.load(folder, "train"), 3, (0, 2), DEFAULT_AUGMENT, 5)
    assert len(loader) == expected.per_epoch == 2
    for epoch in range(2):
        for index, (points, touches, mask, truth) in enumerate(loader):
            step = clouds(expected.at(2 * epoch + index))
            assert all(torch.equal(a, b) for a, b in zip((points, touches, mask, truth), step, strict=True))
    assert loader.epoch == 2


def test_an_epoch_is_continued_where_it_is_set(folder):
    first, second = pcsr.Loader(folder), pcsr.Loader(folder)
    list(first)
    second.epoch = 1
    assert torch.equal(next(iter(first)).points, next(iter(second)).points)


def test_shapes_and_frames(folder):
    batch = next(iter(pcsr.Loader([folder], "validation", batch=2, augment=())))
    assert [tuple(one.shape) for one in batch] == [(2, 16, 3), (2, 2, batch.touches.shape[2], 3), (2, 2), (2, 64, 3)]
    assert batch.mask.all()
    torch.testing.assert_close(batch.points.norm(dim=2).amax(1), torch.ones(2))
    patch = next(iter(pcsr.Loader(folder, batch=4, touches=1, patches=(16, 2))))
    assert (patch.points.shape, patch.truth.shape, patch.mask.shape) == ((4, 16, 3), (4, 32, 3), (4, 1))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"touches": 3}, "touches is 3: the data have 2 of each object, so give 0 to 2"),
        ({"touches": (2, 1)}, r"touches is \(2, 1\)"),
        ({"augment": ["rotat"]}, r"augmentation 'rotat' is unknown: did you mean 'rotate'\?"),
        ({"batch": 0}, "batch is 0: it must be at least 1"),
        ({"seed": -1}, "seed is -1: it must be 0 or more"),
        ({"split": "tests"}, "has no split 'tests'"),
    ],
)
def test_mistakes_are_named(folder, options, message):
    with pytest.raises(UserError, match=message):
        pcsr.Loader(folder, **options)


def test_a_recipe_of_many_runs_is_refused(tmp_path):
    (tmp_path / "many.yaml").write_text("extends: smoke\nname: many\nmatrix: {train.epochs: [1, 2]}\n")
    with pytest.raises(UserError, match=r"many\.yaml describes 2 runs"):
        pcsr.Loader(tmp_path / "many.yaml")
    with pytest.raises(UserError, match="nothing"):
        pcsr.Loader("nothing")
    with pytest.raises(UserError, match=r"split is 'tests': did you mean 'test'\?"):
        pcsr.Loader("smoke", "tests")
    with pytest.raises(UserError, match=r"plugins='mine\.py' is one file: give a list, plugins=\['mine\.py'\]"):
        pcsr.Loader("smoke", plugins="mine.py")


SCRIPT = """\
import pcsr

for batch in pcsr.Loader("tiny.yaml", batch=2):
    print(tuple(batch.points.shape))
"""


def test_a_plain_script_builds_the_data_of_a_recipe(tmp_path):
    """Worker processes would import the script again, and it starts them outside of `if __name__ == "__main__":`."""
    data = "{shapes: {use: blobs, count: 14, held_out: 2}, points: 16, rate: 4, touches: 1}"
    (tmp_path / "tiny.yaml").write_text(f"extends: smoke\nname: tiny\ndata: {data}\n")
    (tmp_path / "script.py").write_text(SCRIPT)
    path = os.pathsep.join([str(ROOT), str(ROOT / "plugins"), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "script.py"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.splitlines() == ["(2, 16, 3)"] * 7, done.stderr
    assert "Traceback" not in done.stderr
