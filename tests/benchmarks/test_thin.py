"""benchmarks/thin.py: each measure beside its loop, the scenes on their own surfaces, and the table."""

import importlib
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    script, scenes = map(importlib.import_module, ("thin", "thin_scenes"))

SEEDS = range(3)


def rng(seed=0):
    return np.random.default_rng(seed)


def around(scene, seed, count=400, far=0.7):
    """New points near the old ones, some of them off."""
    old = scene.cloud.points
    chosen = old[rng(seed).integers(0, len(old), count)]
    return chosen + scene.spacing * rng(seed + 1).normal(0, far, (count, 3))


def owner(scene, point):
    """The nearest old point, by looking at each."""
    away = [math.dist(point, old) for old in scene.cloud.points.tolist()]
    return away.index(min(away))


def to_rectangle(point, x, y, z):
    beside = [max(low - value, 0, value - high) for value, (low, high) in zip(point, (x, y), strict=False)]
    return math.hypot(*beside, point[2] - z)


def to_wire(point, axis, radius):
    return max(0.0, min(math.dist(point, on) for on in axis) - radius)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("thickness", [1.0, 2.0])
def test_points_between_sheets_are_counted_as_by_a_loop(seed, thickness):
    scene = scenes.plate(thickness, rng(seed), even=False, normals=False, side=10)
    new = around(scene, seed)
    count = 0
    for point in new.tolist():
        away = min(to_rectangle(point, (0, 10), (0, 10), z) for z in (0, thickness))
        count += 0 < point[2] < thickness and away > 0.2 * thickness
    assert 0 < count < len(new)
    assert script.between(thickness, scene, new) == pytest.approx(count / len(new))


@pytest.mark.parametrize("seed", SEEDS)
def test_points_off_a_wire_are_counted_as_by_a_loop(seed):
    scene = scenes.wire_by_step(0.5, 1.5, rng(seed), even=False, length=8, width=6)
    new = around(scene, seed, 200)
    axis = [(2.0, 8 * k / 2000, 2.0) for k in range(2001)]
    wires = off = 0
    for point in new.tolist():
        if scene.marked[owner(scene, point)]:
            away = min(
                to_wire(point, axis, 0.5),
                to_rectangle(point, (0, 6), (0, 8), 0),
                to_rectangle(point, (-6, 0), (0, 8), 2),
            )
            wires += 1
            off += away > 0.25
    assert 0 < off < wires < len(new)
    assert script.off_wire(scene, new) == pytest.approx(off / wires)


@pytest.mark.parametrize("seed", SEEDS)
def test_new_points_of_strays_are_counted_as_by_a_loop(seed):
    scene = scenes.strays(rng(seed), share=0.1, side=12)
    new = around(scene, seed)
    count = sum(bool(scene.marked[owner(scene, point)]) for point in new.tolist())
    assert 0 < count < len(new)
    assert script.each(scene, new) == pytest.approx(count / sum(scene.marked.tolist()))


@pytest.mark.parametrize("seed", SEEDS)
def test_errors_are_those_of_a_loop(seed):
    ball, flat, step = scenes.sphere(rng(seed)), scenes.floor(rng(seed), side=60), scenes.camera_step(rng(seed))
    for scene, distance in (
        (ball, lambda point: abs(math.hypot(*point) - 100)),
        (flat, lambda point: abs(point[2])),
        (
            step,
            lambda point: min(to_rectangle(point, (-48, 0), (0, 62), 0), to_rectangle(point, (0, 48), (0, 62), 10)),
        ),
    ):
        new = around(scene, seed)
        away = [distance(point) for point in new.tolist()]
        assert script.error(scene, new) == pytest.approx(sum(away) / len(away))
        assert script.worst(scene, new) == pytest.approx(max(away))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("number", [2, 6])
def test_the_rate_of_dense_stripes_is_that_of_a_loop(seed, number):
    scene = scenes.stripes(number, rng(seed), even=False)
    new = around(scene, seed)

    def dense(point):
        for stripe in range(number - 1, 0, -1):
            if point[0] >= 14 * stripe / number:
                return stripe % 2 == 0
        return True

    old = [dense(point) for point in scene.cloud.points.tolist()]
    made = [dense(point) for point in new.tolist()]
    rate = [made.count(kind) / old.count(kind) for kind in (True, False)]
    assert script.contrast(number, scene, new) == pytest.approx(rate[0] / rate[1])


def test_what_is_kept_and_what_is_levelled():
    scene = scenes.stripes(6, rng(), even=True)
    same = np.repeat(scene.cloud.points, 3, axis=0)
    level = rng().uniform(0, 14, (30_000, 3))
    assert script.contrast(6, scene, same) == 1
    assert script.contrast(6, scene, level) == pytest.approx(0.25, abs=0.01)


def test_noiseless_points_are_on_their_surface_and_one_spacing_apart():
    for row in script.rows(0):
        scene = row.scene
        away = scene.distance(scene.cloud.points)
        if row.measure.startswith(("plate", "wire", "density")):
            assert away.max() < 1e-3, scene.name  # axes of wires are sampled
        elif scene.marked is not None:
            assert away[~scene.marked].max() < 1e-9
            assert away[scene.marked].mean() > 0.5 * scene.spacing
            assert 0.01 < scene.marked.mean() < 0.03
    flat = scenes.floor(rng())
    assert flat.cloud.points[:, 2].std() == pytest.approx(3, rel=0.05)
    assert len(flat.cloud) == 400 * 400 / 10**2


def test_old_points_alone_score_as_perfect():
    plates = scenes.plate(1.4, rng(), even=True, normals=True)
    assert script.between(1.4, plates, plates.cloud.points) == 0
    wire = scenes.helix(0.2, rng(), even=False)
    assert script.off_wire(wire, wire.cloud.points) == 0
    stray = scenes.strays(rng())
    assert script.each(stray, np.repeat(stray.cloud.points, 3, axis=0)) == 3


@pytest.mark.slow
def test_the_command_prints_a_column_for_each_model():
    done = CliRunner().invoke(script.main, ["midpoint", "frames", "--only", "helix, radius 0.5"])
    assert done.exit_code == 0, done.output
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in done.stdout.splitlines() if "|" in line]
    assert lines[0] == ["measure", "scene", "`midpoint`", "`frames`"]
    assert [line[:2] for line in lines[2:]] == [
        ["wire, off", f"helix, radius 0.5, {sampled}"] for sampled in ("random", "even")
    ]
    assert all(cell.endswith("%") for line in lines[2:] for cell in line[2:])


@pytest.mark.parametrize(
    ("words", "said"), [(["--only", "moon"], "--only moon: no line has this text"), (["no-model"], "no-model")]
)
def test_a_mistake_is_one_line(words, said):
    done = CliRunner().invoke(script.main, words)
    assert done.exit_code == 1
    assert said in done.output
    assert "Traceback" not in done.output
