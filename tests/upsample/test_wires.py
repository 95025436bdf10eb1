"""Wires are distinguished from surfaces, and the candidates on them from those beside."""

import numpy as np

from pcsr.upsample.wires import chords, on_wires


def coil(count, seed=0):
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 12, count))
    return np.column_stack([5 * np.cos(angle), 5 * np.sin(angle), angle]) + rng.normal(0, 0.1, (count, 3))


def test_a_wire_is_one_and_a_surface_is_none():
    rng = np.random.default_rng(0)
    sheet = np.column_stack([rng.uniform(0, 20, (400, 2)), np.zeros(400)])
    ball = rng.normal(size=(400, 3))
    assert on_wires(coil(80)).mean() > 0.9
    assert not on_wires(sheet).any()
    assert not on_wires(10 * ball / np.linalg.norm(ball, axis=1, keepdims=True)).any()


def test_copies_of_a_point_are_no_wire():
    assert not on_wires(np.ones((20, 3))).any()


def test_candidates_are_on_chords_between_points_of_the_wire():
    wire = coil(40)
    away = np.array([100.0, 0, 0])
    cloud = np.concatenate([wire, wire + away])
    mask = np.arange(80) < 40
    candidates = chords(cloud, mask)
    assert candidates.shape == (40 * 4 * 4, 3)
    assert candidates[:, 0].max() < 50
    ends = wire[:, None], wire[None]
    for candidate in candidates[:: len(candidates) // 20]:
        along = np.linalg.norm(candidate - ends[0], axis=2) + np.linalg.norm(candidate - ends[1], axis=2)
        chord = np.linalg.norm(ends[0] - ends[1], axis=2)
        assert (along - chord).min() < 1e-9


def test_one_point_or_none_has_no_chord():
    cloud = coil(20)
    assert chords(cloud, np.zeros(20, bool)).shape == (0, 3)
    assert chords(cloud, np.arange(20) == 3).shape == (0, 3)
