"""The page of a data set: its objects, chosen or spread, and the sentence that says what they are."""

import re

import pytest

from pcsr import UserError
from pcsr.data.build import build_split
from pcsr.data.plan import Plan
from pcsr.data.shards import read_manifest
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import for_data
from pcsr.report.web.data_page import write_data_page
from pcsr.workers import WorkerPool


@pytest.fixture(scope="module")
def folder(world, tmp_path_factory):
    registry = load_plugins([world])
    settings = ["touch=caps", "points=16", "rate=4", "touches=2"]
    plan = Plan.of(for_data("balls", {"count": 9, "held_out": 1}, registry, settings), registry)
    made = tmp_path_factory.mktemp("pages") / "balls & <caps>"
    for split in ("train", "test"):
        build_split(plan, split, made, WorkerPool(None, 1))
    return made


def shown(folder, path, name=None):
    """The names on a page, and its text."""
    names = write_data_page(path, folder, read_manifest(folder), name)
    page = path.read_text(encoding="utf-8")
    return names, page


def test_a_few_objects_are_spread_over_the_first_split(folder, tmp_path):
    names, page = shown(folder, tmp_path / "page.html")
    assert names == [f"train/{i:03d}" for i in (0, 2, 4, 6)]
    assert "<h1>balls &amp; &lt;caps&gt;</h1>" in page
    assert "Objects: 9 train, 1 test, of balls. 64 true points" in page
    assert "16 sparse ones" in page
    assert "2 touches by caps" in page


def test_one_object_is_shown_whichever_split_it_is_in(folder, tmp_path):
    names, page = shown(folder, tmp_path / "page.html", "test/000")
    assert names == ["test/000"]
    for title in ("(a) truth, 64 points", "(b) 16 points, 2 touches, ", "(c) the first touch, "):
        assert title in page


@pytest.mark.parametrize(
    ("name", "said"), [("test/00", "did you mean 'test/000'"), ("?", "it has 10, such as 'train/000'")]
)
def test_an_object_that_is_not_there_is_named(folder, tmp_path, name, said):
    with pytest.raises(UserError, match=re.escape(f"has no object '{name}': {said}")):
        shown(folder, tmp_path / "page.html", name)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_without_a_finished_split_is_refused(folder, tmp_path):
    empty = read_manifest(folder).model_copy(update={"splits": {}})
    with pytest.raises(UserError, match="has no finished split with an object in it: run `pcsr data make` to its end"):
        write_data_page(tmp_path / "page.html", folder, empty)
