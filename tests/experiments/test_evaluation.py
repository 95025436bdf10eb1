"""A network beside baselines on a small split: what is handed to each method, and what is measured of touch."""

from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from pcsr.data.dataset import Split
from pcsr.data.sample import make_sample
from pcsr.experiments.evaluation import Method, bound_stream, evaluate, measured_by, methods
from pcsr.metrics import METRICS
from pcsr.network.network import build
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr.results import gathered
from pcsr.threads import EACH
from pcsr_plugins.baselines.floor import Floor
from tests.experiments.test_brought_metrics import PLUGIN

ROOT = Path(__file__).parents[2]
SETTINGS = [
    "data.shapes={use: balls, held_out: 3}", "data.touch={use: caps}", "data.points=64", "data.rate=4",
    "data.touches=2", "train.touches=[0, 3]", "evaluate.baselines=[midpoint, floor]", "evaluate.metrics=[cd, p2f]",
]  # fmt: skip


@pytest.fixture(scope="module")
def registry(world):
    return load_plugins([world])


@pytest.fixture(scope="module")
def recipe(registry):
    return load(ROOT / "pcsr/recipes/smoke.yaml", registry, SETTINGS)[0]


@pytest.fixture(scope="module")
def split(recipe, registry):
    shapes, source = recipe.data.shapes.build(registry, "shapes"), recipe.data.touch.build(registry, "touch")
    samples = [
        make_sample(shapes.item(name), source, recipe.data, recipe.most_touches, recipe.data_seed)
        for name in shapes.names("test")
    ]
    return Split(
        [s.name for s in samples],
        [s.group for s in samples],
        *([torch.from_numpy(getattr(s, clouds)) for s in samples] for clouds in ("truth", "points", "touches")),
        [s.sphere for s in samples],
        [s.coverage for s in samples],
        {"fingerprint": "f", "rejected": {}},
    )


class Asked:
    """A method that gives the sparse cloud rate times, moved by what it was touched with, and notes its questions."""

    def __init__(self):
        self.touches = []

    def __call__(self, points, touches):
        self.touches.append(touches)
        return np.repeat(points, 4, axis=0) * (0.95 if touches else 0.9)


def test_the_network_is_asked_twice_and_baselines_once(recipe, registry, split):
    ours, other = Asked(), Asked()
    ticks = []
    compared = [Method("ours", 5, ours), Method("other", 0, other)]
    first, second = evaluate(recipe, registry, compared, split, jobs=1, advance=lambda: ticks.append(1))
    assert [len(touches) for touches in ours.touches] == [2, 0] * 3
    assert [len(touches) for touches in other.touches] == [2] * 3
    assert all(np.array_equal(felt, split.touches[k][:2]) for k, felt in enumerate(other.touches))
    assert len(ticks) == 2 * 3 * 2
    assert second.touch is None
    assert first.touch.touched == first.values["cd"]
    assert list(first.touch.errors) == ["ours", "ours without touch", "other"]
    for points, truth, value in zip(split.points, split.truth, first.touch.plain, strict=True):
        moved = torch.from_numpy(np.repeat(points.numpy(), 4, axis=0) * 0.9)
        assert value == METRICS["cd"](moved[None], truth[None])
    np.testing.assert_array_equal(first.dense[1], np.repeat(split.points[1].numpy(), 4, axis=0) * 0.95)


def test_the_second_upsampling_is_timed_apart(recipe, registry, split, monkeypatch):
    clock = [0.0]

    def slow(points, touches):
        clock[0] += 2.0 if touches else 7.0
        return np.repeat(points, 4, axis=0)

    monkeypatch.setattr("pcsr.experiments.evaluation.time.perf_counter", lambda: clock[0])
    (scores,) = evaluate(recipe, registry, [Method("ours", 5, slow)], split, jobs=1)
    assert (scores.seconds, scores.touch.seconds) == (2.0, 7.0)


def test_seconds_are_the_median_and_come_with_threads_and_load(recipe, registry, split, monkeypatch):
    clock, seen, taken = [0.0], [], [9.0, 1.0, 2.0]

    def slow(points, touches):
        if touches:
            clock[0] += taken[len(seen)]
            seen.append(torch.get_num_threads())
        return np.repeat(points, 4, axis=0)

    monkeypatch.setattr("pcsr.experiments.evaluation.time.perf_counter", lambda: clock[0])
    monkeypatch.setattr("pcsr.experiments.evaluation.os.getloadavg", lambda: (2.5, 1.0, 0.5), raising=False)
    before = torch.get_num_threads()
    torch.set_num_threads(3)
    try:
        large = Method("ours", 2 * EACH // recipe.data.points + 1, slow)
        small = Method("other", 5, lambda points, touches: np.repeat(points, 4, axis=0))
        made = evaluate(recipe, registry, [large, small], split, jobs=1)
        assert torch.get_num_threads() == 3
    finally:
        torch.set_num_threads(before)
    assert seen == [2, 2, 2]
    assert [(scores.threads, scores.load) for scores in made] == [(2, 2.5), (1, 2.5)]
    assert made[0].seconds == 2.0
    told = gathered(recipe, split, made, {})
    assert (told["timing"], told["hardware"]["threads"], told["hardware"]["load"]) == ("median", 2, 2.5)


def test_without_touches_there_is_no_second_time(registry, split):
    (recipe,) = load(ROOT / "pcsr/recipes/smoke.yaml", registry, [*SETTINGS, "data.touches=0"])
    ours = Asked()
    (scores,) = evaluate(recipe, registry, [Method("ours", 5, ours)], split, jobs=1)
    assert ours.touches == [[]] * 3
    assert scores.touch is None
    assert gathered(recipe, split, [scores], {})["touch"] is None


def slowly_felt(truth, touches):
    """Of two touches: nearer to a touched point than twice the mean distance from those to their nearest."""
    felt = np.zeros(len(truth), bool)
    for touch in touches:
        apart = [np.linalg.norm(touch - point, axis=1) for point in np.unique(touch, axis=0)]
        gap = np.mean([min(d for d in distances if d > 0) for distances in apart])
        felt |= np.array([np.linalg.norm(touch - point, axis=1).min() <= 2 * gap for point in truth])
    return felt


def test_the_region_is_what_counts_as_felt(recipe, registry, split):
    """The truth, moved by less than would bring a point to another's: only what the first two touches felt returns."""
    clouds, expected, off = [], [], np.array([1e-4, 0, 0], np.float32)
    for truth, touches, shares in zip(split.truth, split.touches, split.felt, strict=True):
        felt = slowly_felt(truth.numpy(), touches[:2].numpy())
        assert felt.mean() == shares[1]
        clouds += [truth.numpy(), truth.numpy() + off]
        rest = torch.from_numpy(truth.numpy() + off * ~felt[:, None])
        expected.append(METRICS["cd"](rest[None], truth[None]))
    given = iter(clouds)
    (scores,) = evaluate(recipe, registry, [Method("ours", 5, lambda points, touches: next(given))], split, jobs=1)
    assert scores.touch.touched == [0.0] * 3
    assert scores.touch.replaced == pytest.approx(expected, rel=1e-4)
    assert scores.touch.plain == pytest.approx([2e-8] * 3, rel=1e-2)
    touched = [touches[:2].flatten(0, 1) for touches in split.touches]
    near = [torch.cdist(truth, t).amin(1) < 0.1 for truth, t in zip(split.truth, touched, strict=True)]
    assert sum(scores.touch.counts[:3]) == sum(int(of_object.sum()) for of_object in near)


def test_the_second_method_stays_midpoint_and_the_floor_is_on_the_surface(recipe, registry, split):
    network = build(recipe, registry).eval()
    compared = methods(recipe, network, registry)
    assert [method.name for method in compared] == ["smoke", "midpoint", "floor"]
    scores = evaluate(recipe, registry, compared, split, jobs=1)
    last = scores[-1]
    assert last.dense.shape == (3, 256, 3)
    assert max(last.values["p2f"]) < 1e-6
    assert min(last.values["cd"]) > 1e-3, "it is another sampling than the truth"
    assert all(a < b for a, b in zip(last.values["cd"], scores[0].values["cd"], strict=True))
    (again,) = evaluate(recipe, registry, compared[2:], split, jobs=1)
    np.testing.assert_array_equal(again.dense, last.dense)
    assert list(gathered(recipe, split, scores, {})["touch"]["errors"]) == [
        "smoke",
        "smoke without touch",
        "midpoint",
        "floor",
    ]


def test_the_floor_follows_the_name_and_the_seed():
    ball = trimesh.creation.icosphere(2)
    mesh = np.asarray(ball.vertices), np.asarray(ball.faces)

    def floor(mesh, count, seed, name):
        return Floor().upsample(np.zeros((count, 3)), 1, mesh, bound_stream(seed, name))

    one = floor(mesh, 100, 3, "a")
    assert one.shape == (100, 3)
    np.testing.assert_array_equal(floor(mesh, 100, 3, "a"), one)
    assert not np.array_equal(floor(mesh, 100, 4, "a"), one)
    assert not np.array_equal(floor(mesh, 100, 3, "b"), one)


def test_meshes_are_loaded_for_who_needs_them_only(recipe, registry, split, monkeypatch):
    loaded = []
    shapes = registry.get("shapes", "balls")
    original = shapes.item
    monkeypatch.setattr(shapes, "item", lambda self, name: loaded.append(name) or original(self, name))
    cheap = recipe.model_copy(update={"evaluate": recipe.evaluate.model_copy(update={"metrics": ("cd",)})})
    compared = methods(recipe, build(recipe, registry).eval(), registry)
    evaluate(cheap, registry, compared[1:2], split, jobs=1)
    assert loaded == []
    evaluate(cheap, registry, compared[1:], split, jobs=1)
    assert loaded == split.names
    evaluate(recipe, registry, compared[:2], split, jobs=1)
    assert loaded == 2 * split.names


def test_a_metric_and_a_baseline_of_a_plugin_file_are_in_the_results(world, split, tmp_path):
    (tmp_path / "extent.py").write_text(PLUGIN)
    registry = load_plugins([world, tmp_path / "extent.py"])
    settings = [*SETTINGS, "evaluate.metrics=[cd, extent]", "evaluate.baselines=[copies]"]
    (recipe,) = load(ROOT / "pcsr/recipes/smoke.yaml", registry, settings)
    compared = methods(recipe, build(recipe, registry).eval(), registry)
    scores = evaluate(recipe, registry, compared, split, jobs=1)
    results = gathered(recipe, split, scores, {}, measured_by(recipe, registry))
    assert results["metrics"]["extent"] == {"description": "difference of the extents along x", "scale": 10}
    assert [method["name"] for method in results["methods"]] == ["smoke", "copies"]
    extents = [
        abs(float(cloud[:, 0].max() - truth[:, 0].max()))
        for cloud, truth in zip(scores[1].dense, split.truth, strict=True)
    ]
    assert results["methods"][1]["values"]["extent"] == pytest.approx(extents)
