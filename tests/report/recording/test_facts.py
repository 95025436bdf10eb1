import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pcsr import Touch
from pcsr.recorded import Recording
from pcsr.report.recording.facts import in_sensors, table, touch_facts

LOCAL = np.array([[-2.0, 1.0, 0.25], [3.0, -1.0, 0.75], [0.0, 0.0, -0.5]])


def posed(unit=1.0, place=(10.0, 20.0, 30.0), seed=0, **fields):
    """A touch of known points in the sensor's frame; the object's unit is `unit` mm."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=seed).as_matrix() / unit
    pose[:3, 3] = np.divide(place, unit)
    return Touch.single(LOCAL @ pose[:3, :3].T + pose[:3, 3], pose, unit, "digit", **fields)


@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_depth_and_position_are_those_of_the_sensor(unit):
    touch = posed(unit, contact_area=4.5)
    np.testing.assert_allclose(in_sensors(touch)[0], LOCAL, atol=1e-9)
    (facts,) = touch_facts(Recording([touch], ["front"], {}))
    assert (facts.name, facts.sensor, facts.points, facts.area, facts.distance) == ("front", "digit", 3, 4.5, None)
    assert facts.depth == pytest.approx(0.75)
    np.testing.assert_allclose(facts.positions, [np.divide([10, 20, 30], unit)])


def test_the_distance_from_the_cloud_is_the_median_in_mm():
    touch = Touch.single(np.array([[0.0, 0, 0], [0, 0, 1], [0, 0, 5]]), None, 10.0, "pad")
    cloud = np.array([[0.0, 0, -1], [100, 0, 0]])
    (facts,) = touch_facts(Recording([touch], ["front"], {}), cloud)
    assert facts.distance == pytest.approx(20)
    assert facts.depth is None
    assert facts.positions.shape == (0, 3)
    many = Touch.single(np.repeat(touch.points[:2], 5000, axis=0), None, 10.0, "pad")
    assert touch_facts(Recording([many], ["front"], {}), cloud)[0].distance == pytest.approx(15, abs=5)


def test_a_grasp_is_one_row_with_the_positions_of_its_fingers():
    grasp = Touch.grasp([posed(), posed(place=(1.0, 2.0, 3.5), seed=1)])
    facts = touch_facts(Recording([grasp], ["grasp"], {}))
    heads, rows = table(facts, 1.0)
    assert heads == ["touch", "sensor", "points", "depth mm", "area mm²", "position mm"]
    assert rows == [["grasp", "digit", "6", "0.75", "–", "10 20 30; 1 2 3.5"]]


def test_unknown_numbers_are_dashes_and_the_unit_is_named():
    plain = Touch.single(LOCAL, None, 500.0, "pad", 2.0)
    heads, rows = table(touch_facts(Recording([plain], ["a"], {}), LOCAL), 500.0)
    assert heads[-2:] == ["position 500 mm", "cloud mm"]
    assert rows == [["a", "pad", "3", "–", "2.0", "–", "0.00"]]
    assert table([], 1000.0)[0][-1] == "position m"
