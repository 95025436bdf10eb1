"""A network beside baselines on a small split: what is handed to each method, and what is measured of touch."""

import dataclasses
import itertools
import os
import time
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

import pcsr
from pcsr.data.dataset import Split
from pcsr.data.sample import make_sample
from pcsr.errors import UserError
from pcsr.experiments.evaluation import evaluate
from pcsr.experiments.methods import Method, bound_stream, methods
from pcsr.experiments.run import results_of
from pcsr.metrics import METRICS
from pcsr.network.build import build
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr_plugins.baselines.floor import Floor

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
    made = evaluate(recipe, registry, compared, split, jobs=1, advance=lambda: ticks.append(1))
    assert [len(touches) for touches in ours.touches] == [2, 0] * 3
    assert [len(touches) for touches in other.touches] == [2] * 3
    assert all(np.array_equal(region, split.touches[k][:2]) for k, region in enumerate(other.touches))
    assert len(ticks) == 2 * 3 * 2
    assert [method.name for method in made.methods] == ["ours", "other"]
    assert made.touch.touched == made.methods[0].values["cd"]
    assert list(made.touch.errors) == ["ours", "ours without touch", "other"]
    for points, truth, value in zip(split.points, split.truth, made.touch.plain, strict=True):
        moved = torch.from_numpy(np.repeat(points.numpy(), 4, axis=0) * 0.9)
        assert value == METRICS["cd"](moved[None], truth[None])
    np.testing.assert_array_equal(made.dense[0][1], np.repeat(split.points[1].numpy(), 4, axis=0) * 0.95)


def test_objects_whose_touches_were_refused_count_too(recipe, registry, split):
    fewer = dataclasses.replace(split, touches=[touches[:k] for k, touches in enumerate(split.touches)])
    ours = Asked()
    made = evaluate(recipe, registry, [Method("ours", 5, ours)], fewer, jobs=1)
    assert [len(touches) for touches in ours.touches] == [0, 0, 1, 0, 2, 0]
    effect, whole = made.touch, evaluate(recipe, registry, [Method("ours", 5, Asked())], split, jobs=1).touch
    assert effect.plain == whole.plain
    assert effect.touched[0] == effect.plain[0] == effect.replaced[0]
    assert all(one < other for one, other in zip(effect.replaced[1:], effect.plain[1:], strict=True))
    assert sum(effect.counts) == sum(whole.counts) == 3 * 256
    assert results_of(recipe, fewer, made, {}).touch == effect
    none = dataclasses.replace(split, touches=[touches[:0] for touches in split.touches])
    effect = evaluate(recipe, registry, [Method("ours", 5, Asked())], none, jobs=1).touch
    assert effect.touched == effect.plain == effect.replaced == whole.plain
    assert (effect.counts[-1], effect.efficiency) == (3 * 256, None)


def test_touches_of_another_object_show_whether_it_matters_what_was_touched(recipe, registry, split):
    ours = Asked()
    compared = [Method("ours", 5, ours, exchange_touches=True)]
    effect = evaluate(recipe, registry, compared, split, jobs=1).touch
    given = {tuple(np.ravel(split.touches[k][:2])): k for k in range(3)}
    owners = [given[tuple(np.ravel(some))] if some else None for some in ours.touches]
    assert owners == [0, None, 1, 1, None, 2, 2, None, 0]
    assert effect.exchanged == effect.touched  # `Asked` makes the same of any touches
    assert effect.exchanged_efficiency == effect.efficiency
    usual = evaluate(recipe, registry, [Method("ours", 5, Asked())], split, jobs=1).touch
    assert (usual.exchanged, usual.exchanged_efficiency) == (None, None)
    single = dataclasses.replace(
        split,
        **{
            field.name: getattr(split, field.name)[:1]
            for field in dataclasses.fields(split)
            if isinstance(getattr(split, field.name), list)
        },
    )
    alone = evaluate(recipe, registry, [Method("ours", 5, Asked(), exchange_touches=True)], single, jobs=1).touch
    assert alone.exchanged is None


@pytest.mark.parametrize(
    ("changes", "exchanged"),
    [
        (["model.fusion=iterative"], True),
        (["model.fusion=edge-conv"], False),
        (["model.fusion={use: edge-conv, keeps_touched_points: false}"], True),
        (["model.fusion=joint-cloud", "model.touch_encoder=null"], False),
        (["model.fusion=none", "model.touch_encoder=null"], False),
    ],
)
def test_only_networks_that_get_touches_as_features_alone_get_those_of_others(registry, changes, exchanged):
    (of,) = load(ROOT / "pcsr/recipes/smoke.yaml", registry, [*SETTINGS, *changes])
    own, *_ = methods(of, build(of, registry), registry)
    assert own.exchange_touches is exchanged


class Slow:
    """A method that takes its time, and notes how long it took and on how many threads."""

    def __init__(self, touched, untouched=0.0):
        self.naps = {True: itertools.cycle(touched), False: itertools.cycle([untouched])}
        self.took, self.threads = {True: [], False: []}, set()

    def __call__(self, points, touches):
        start = time.perf_counter()
        self.threads.add(torch.get_num_threads())
        time.sleep(next(self.naps[bool(touches)]))
        self.took[bool(touches)].append(time.perf_counter() - start)
        return np.repeat(points, 4, axis=0)


def test_the_second_upsampling_is_timed_apart(recipe, registry, split):
    slow = Slow([0.01], 0.2)
    made = evaluate(recipe, registry, [Method("ours", 5, slow)], split, jobs=1)
    assert np.median(slow.took[True]) <= made.methods[0].seconds < made.touch.seconds
    assert made.touch.seconds >= np.median(slow.took[False])


def test_seconds_are_the_median_and_come_with_threads_and_load(recipe, registry, split, monkeypatch):
    monkeypatch.setattr(os, "getloadavg", lambda: (2.5, 1.0, 0.5), raising=False)
    slow, before = Slow([0.6, 0.01, 0.02]), torch.get_num_threads()
    torch.set_num_threads(3)
    try:
        large = Method("ours", 5, slow, threads=2)
        small = Method("other", 5, lambda points, touches: np.repeat(points, 4, axis=0))
        made = evaluate(recipe, registry, [large, small], split, jobs=1)
        assert torch.get_num_threads() == 3
    finally:
        torch.set_num_threads(before)
    assert slow.threads == {2}
    assert (made.threads, made.load) == ([2, 1], 2.5)
    assert np.median(slow.took[True]) <= made.methods[0].seconds < np.mean(slow.took[True]), "not the mean"
    assert made.protocol is None
    results = results_of(recipe, split, made, {})
    assert (results.timing, results.hardware["threads"], results.hardware["load"]) == ("median", 2, 2.5)


def test_without_touches_there_is_no_second_time(registry, split):
    (recipe,) = load(ROOT / "pcsr/recipes/smoke.yaml", registry, [*SETTINGS, "data.touches=0"])
    ours = Asked()
    made = evaluate(recipe, registry, [Method("ours", 5, ours)], split, jobs=1)
    assert ours.touches == [[]] * 3
    assert made.touch is None
    assert results_of(recipe, split, made, {}).touch is None


def slowly_covered(truth, touches):
    """Of two touches: nearer to a touched point than twice the mean distance from those to their nearest."""
    region = np.zeros(len(truth), bool)
    for touch in touches:
        apart = [np.linalg.norm(touch - point, axis=1) for point in np.unique(touch, axis=0)]
        gap = np.mean([min(d for d in distances if d > 0) for distances in apart])
        region |= np.array([np.linalg.norm(touch - point, axis=1).min() <= 2 * gap for point in truth])
    return region


def test_the_region_is_what_the_touches_cover(recipe, registry, split):
    """The truth, moved by less than the distance to another point: only what the first two touches cover returns."""
    clouds, expected, off = [], [], np.array([1e-4, 0, 0], np.float32)
    for truth, touches, shares in zip(split.truth, split.touches, split.covered, strict=True):
        region = slowly_covered(truth.numpy(), touches[:2].numpy())
        assert region.mean() == shares[1]
        clouds += [truth.numpy(), truth.numpy() + off]
        rest = torch.from_numpy(truth.numpy() + off * ~region[:, None])
        expected.append(METRICS["cd"](rest[None], truth[None]))
    given = iter(clouds)
    made = evaluate(recipe, registry, [Method("ours", 5, lambda points, touches: next(given))], split, jobs=1)
    assert made.touch.touched == [0.0] * 3
    assert made.touch.replaced == pytest.approx(expected, rel=1e-4)
    assert made.touch.plain == pytest.approx([2e-8] * 3, rel=1e-2)
    touched = [touches[:2].flatten(0, 1) for touches in split.touches]
    near = [torch.cdist(truth, t).amin(1) < 0.1 for truth, t in zip(split.truth, touched, strict=True)]
    assert sum(made.touch.counts[:3]) == sum(int(of_object.sum()) for of_object in near)


def test_the_second_method_stays_midpoint_and_the_floor_is_on_the_surface(recipe, registry, split):
    network = build(recipe, registry).eval()
    compared = methods(recipe, network, registry)
    assert [method.name for method in compared] == ["smoke", "midpoint", "floor"]
    made = evaluate(recipe, registry, compared, split, jobs=1)
    last = made.methods[-1]
    assert made.dense[-1].shape == (3, 256, 3)
    assert max(last.values["p2f"]) < 1e-6
    assert min(last.values["cd"]) > 1e-3, "it is another sampling than the truth"
    assert all(a < b for a, b in zip(last.values["cd"], made.methods[0].values["cd"], strict=True))
    again = evaluate(recipe, registry, compared[2:], split, jobs=1)
    np.testing.assert_array_equal(again.dense[0], made.dense[-1])
    assert list(results_of(recipe, split, made, {}).touch.errors) == [
        "smoke",
        "smoke without touch",
        "midpoint",
        "floor",
    ]


def test_the_network_is_measured_by_the_protocol_of_its_recipe(registry, split):
    settings = [*SETTINGS, "evaluate.baselines=[midpoint]", "evaluate.metrics=[cd]"]
    (recipe,) = load(ROOT / "pcsr/recipes/frames.yaml", registry, settings)
    network = build(recipe, registry).eval()
    compared = methods(recipe, network, registry)
    assert (compared[0].threads, compared[1].threads) == (1, 1)
    made = evaluate(recipe, registry, compared, split, jobs=1)
    for dense, points in zip(made.dense[0], split.points, strict=True):
        np.testing.assert_array_equal(dense[:64], points.numpy(), "the old points are kept")
    assert results_of(recipe, split, made, {}).protocol == "as pcsr upsample"


def test_weights_are_measured_with_the_patches_of_their_training(registry, tmp_path):
    (trained,) = load(ROOT / "pcsr/recipes/frames.yaml", registry, [*SETTINGS, "data.points=32"])
    weights = tmp_path / "frames.safetensors"
    save_weights(weights, build(trained, registry), {"recipe": trained.resolved()})
    settings = [*SETTINGS[:2], "data.points=200", "data.rate=4", f"weights={weights}", "evaluate.metrics=[cd]"]
    (recipe,) = load(ROOT / "pcsr/recipes/frames.yaml", registry, settings)
    model = pcsr.load(weights)
    points = np.random.default_rng(0).normal(size=(200, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    own, _ = methods(recipe, model.network, registry)
    np.testing.assert_array_equal(own.upsample(points, []), model.upsample(points, rate=4))


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


def test_a_metric_that_is_not_finite_is_named(recipe, registry, split, monkeypatch):
    monkeypatch.setattr(registry.get("metric", "cd"), "measure", lambda *_: torch.nan)
    with pytest.raises(
        UserError, match=r"method 'ours': values\.cd\.0: .*finite.*nan; mend the metric, or leave it out"
    ):
        evaluate(recipe, registry, [Method("ours", 5, Asked())], split, jobs=1)
