"""The table, the sentences and the document of a registration say what it holds, in millimetres and degrees."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pcsr import PoseError
from pcsr.registration.report import (
    HEADS,
    NUMBERS,
    displacement,
    document,
    expected_error,
    remaining_error,
    sentences,
    table,
    turn,
)
from tests.registration.by_hand import NAMES, motion, registration, scan, touches

UNITS = pytest.mark.parametrize("unit", [1.0, 1000.0, 25.4])


@UNITS
def test_a_row_says_what_became_of_a_touch_in_any_unit(unit):
    given = touches(unit)
    rows = table(NAMES, given, registration(given))
    assert rows == [
        ("front", "kept", "0.00", "0.00", "40", "0.05", "as reported"),
        ("left", "moved", "0.40", "0.00", "30", "0.05", "by its surface"),
        ("[red]below", "refused", "–", "–", "2", "–", "it fits nowhere"),
    ]
    assert {len(row) for row in rows} == {len(HEADS)}
    assert set(HEADS) > NUMBERS


def test_a_touch_that_is_used_in_part_says_how_much():
    given = touches()
    found = registration(given)
    half = replace(found.touches[1].touch, points=given[1].points[:20], finger=given[1].finger[:20])
    part = replace(found.touches[1], touch=half, verdict="partly", errors=np.full(20, 0.3))
    rows = table(NAMES, given, replace(found, touches=[found.touches[0], part, found.touches[2]]))
    assert rows[1][:6] == ("left", "partly, 20 of 60 points", "0.40", "0.00", "30", "0.30")


def test_far_from_the_origin_a_turn_is_no_displacement():
    matrix, far = motion(30, [0, 0, 0]), np.array([500_000.0, 0, 300])
    about = np.eye(4)
    about[:3, 3] = far
    matrix = about @ matrix @ np.linalg.inv(about)
    assert np.linalg.norm(displacement(matrix, far)) < 1e-6
    np.testing.assert_allclose(turn(matrix), [0, 0, 30], atol=1e-9)


@UNITS
def test_the_shared_offset_is_said_in_millimetres(unit):
    given, cloud = touches(unit), scan() / unit
    offset, errors = sentences(registration(given), cloud, unit)
    x, y, z = displacement(motion(0.5, [0.8, 0, 0.1]), scan().mean(0))
    assert offset.startswith(
        f"all touches share an offset of {x:.3f} {y:.3f} {z:.3f} mm and 0.000 0.000 0.500 degrees: correct the arm"
    )
    assert "they are known to 0.087 mm and 0.17 degrees" in offset  # roots of three equal variances
    assert errors == (
        "position error of the reported poses: 0.6 mm that all touches share, 0.2 mm of each touch by itself"
    )


def test_an_offset_that_is_rounded_to_0_has_no_sign():
    found = replace(registration(touches()), offset=motion(0, [-1e-5, 0.3, -1e-5]))
    assert "an offset of 0.000 0.300 0.000 mm and 0.000 0.000 0.000 degrees" in sentences(found, scan(), 1.0)[0]


@pytest.mark.parametrize(("millimetres", "said"), [(0.17, "no offset"), (0.18, "an offset of 0.180 0.000 0.000 mm")])
@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_an_offset_within_its_error_is_none(millimetres, said, unit):
    found = replace(registration(touches(unit)), offset=motion(0, [millimetres, 0, 0], unit))
    assert said in sentences(found, scan() / unit, unit)[0], "its deviation is 0.05 mm: 3.55 of them are the limit"


def test_no_offset_is_said_too():
    found = replace(registration(touches()), offset=np.eye(4))
    assert sentences(found, scan(), 1.0)[0] == "the touches share no offset that differs from 0"


def test_the_document_is_json_without_infinities_and_has_all_numbers():
    given = touches(1000.0)
    found = registration(given)
    plain = json.loads(json.dumps(document(NAMES, given, found), allow_nan=False))
    assert [one["name"] for one in plain["touches"]] == NAMES
    assert [one["verdict"] for one in plain["touches"]] == ["kept", "moved", "refused"]
    _, second, third = plain["touches"]
    np.testing.assert_array_equal(second["motion"], found.touches[1].motion)
    np.testing.assert_array_equal(second["covariance"], found.touches[1].covariance)
    np.testing.assert_allclose(second["moved"], [0, 0, 0.4], atol=1e-9)
    assert second["expected_error"] == pytest.approx(0.05)
    assert (second["support"], second["points_used"], second["points"]) == (30, 60, 60)
    assert (third["points_used"], third["points"], third["expected_error"]) == (0, 60, None)
    assert third["covariance"] == [[None] * 6] * 6
    np.testing.assert_array_equal(plain["offset"], found.offset)
    assert np.shape(plain["offset_covariance"]) == (6, 6)
    assert (plain["shared_error"], plain["private_error"]) == (0.6, 0.2)
    assert plain["units"]["cloud"] == "1000 mm"
    numbers = {"motion", "covariance", "moved", "turned", "expected_error"}
    assert plain["units"].keys() >= numbers | {"offset", "offset_covariance", "shared_error", "private_error"}


@UNITS
def test_the_error_that_is_left_is_that_of_the_touches_that_are_used(unit):
    left = remaining_error(registration(touches(unit)))
    assert isinstance(left, PoseError)
    assert (left.position, left.rotation) == (pytest.approx(0.05), pytest.approx(0.1))


def test_an_error_that_is_not_known_is_none():
    found = registration(touches())
    assert remaining_error(replace(found, touches=found.touches[2:])) is None
    unknown = replace(found.touches[0], covariance=np.full((6, 6), np.inf))
    assert remaining_error(replace(found, touches=[unknown])) is None
    assert np.isnan(expected_error(found.touches[2]))
