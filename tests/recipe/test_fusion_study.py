"""recipes/fusions: the rows that docs/experiments.md lists, alike but for what each is about."""

import re
from pathlib import Path

import pytest

from pcsr.data.plan import Plan
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load

PAGE = (Path(__file__).parents[2] / "docs" / "experiments.md").read_text(encoding="utf-8")
REGISTRY = load_plugins()
ROWS = {recipe.name.removeprefix("fusions-"): recipe for recipe in load(Path("fusions/study"), REGISTRY, ["seed=0"])}
DIFFERENCES = {
    "iterative": set(),
    "concat": {"model.fusion"},
    "nearest": {"model.fusion"},
    "nearest-offsets": {"model.fusion"},
    "pool": {"model.fusion"},
    "file-order": {"model.encoder", "model.touch_encoder"},
    "normalised": {"model.encoder", "model.touch_encoder"},
    "origin": {"model.upsampler"},
    "cross-attention": {"model.fusion"},
    "edge-conv": {"model.fusion"},
    "edge-conv-points": {"model.fusion"},
    "other-touches": {"train.augment"},
    "surface": {"data.touch"},
    "surface-nearest-offsets": {"data.touch", "model.fusion"},
    "surface-edge-conv": {"data.touch", "model.fusion"},
    "surface-edge-conv-single": {"data.touch", "model.fusion"},
    "surface-leaky": {"data.touch", "model.encoder", "model.touch_encoder", "model.backbone", "model.fusion"},
    "four-touches": {"train.touches"},
    "no-touches": {"train.touches"},
    "upright": {"train.augment"},
    "upright-edge-conv": {"train.augment", "model.fusion"},
}


def flat(recipe):
    plain = recipe.resolved()
    return {
        f"{section}.{key}": value for section in ("data", "model", "train") for key, value in plain[section].items()
    }


def test_each_row_differs_from_the_first_in_what_it_is_about_alone():
    first = flat(ROWS["iterative"])
    found = {name: {key for key, value in flat(recipe).items() if value != first[key]} for name, recipe in ROWS.items()}
    assert found == DIFFERENCES


NOT_TOUCHED = 6
"""Number of training parts that refuse a touch."""


def test_the_page_lists_the_rows():
    section = PAGE[PAGE.index("## What fusions make of touches") : PAGE.index("## Training clouds")]
    described, _, _ = section.partition("```sh")  # measured below
    listed = re.findall(r"^\| (`.*?`) \|", described, re.MULTILINE)
    assert [name for cell in listed for name in re.findall(r"`(.*?)`", cell)] == list(ROWS)


def test_each_row_is_trained_for_20_000_steps_with_two_seeds_on_the_same_data():
    runs = load(Path("fusions/study"), REGISTRY)
    assert [(run.seed, run.data_seed) for run in runs] == [(0, 0), (1, 0)] * len(ROWS)
    for recipe in ROWS.values():
        assert recipe.train.snapshots[-1] == 20_000
        touched = recipe.data.shapes.options["count"] - NOT_TOUCHED
        assert 0 <= recipe.train.epochs * (touched // recipe.train.batch) - 20_000 < 2 * touched // recipe.train.batch


@pytest.mark.slow
def test_rows_share_their_objects_and_touches():
    prints = {name: Plan.of(recipe, REGISTRY).fingerprint for name, recipe in ROWS.items()}
    kinds = {"four-touches": "four", "no-touches": "four"}
    pairs = {
        ("surface" if name.startswith("surface") else kinds.get(name, "digit"), one) for name, one in prints.items()
    }
    assert len(pairs) == len(set(prints.values())) == 3
