import numpy as np
import pytest
import trimesh

from pcsr import ShapeItem, Touch, UserError
from pcsr.recipe.schema import options_model
from pcsr.recorded import write
from pcsr_plugins.touch.recorded import Recorded

BOX = trimesh.creation.box()
CLOUD = np.zeros((1, 3))


def patches(count, points=40):
    """Touches that differ: the x of all points of one is its number."""
    return [
        Touch.single(np.insert(np.random.default_rng(n).random((points, 2)), 0, n, axis=1), None, 2.0, "x")
        for n in range(count)
    ]


def touched(folder, count, seed=0, name="part", points=16):
    return Recorded(folder=str(folder), points=points).touches(ShapeItem(name, "g", BOX), CLOUD, count, seed)


def numbers(touches):
    return [int(touch.points[0, 0]) for touch in touches]


def test_touches_come_in_an_order_of_the_seed(tmp_path):
    write(tmp_path, patches(8))
    orders = {tuple(numbers(touched(tmp_path, 8, seed))) for seed in range(6)}
    assert len(orders) == 6
    assert {tuple(sorted(order)) for order in orders} == {tuple(range(8))}
    assert numbers(touched(tmp_path, 8, 3)) == numbers(touched(tmp_path, 8, 3))


def test_fewer_touches_are_a_prefix_of_more(tmp_path):
    write(tmp_path, patches(8))
    many = touched(tmp_path, 8, seed=5)
    for count in range(9):
        for a, b in zip(touched(tmp_path, count, seed=5), many[:count], strict=True):
            np.testing.assert_array_equal(a.points, b.points)


def test_each_touch_is_thinned_by_its_own_stream(tmp_path):
    write(tmp_path, patches(3))
    for number, touch in enumerate(touched(tmp_path, 3, seed=4)):
        whole = patches(3)[int(touch.points[0, 0])]
        expected = whole.resampled(16, np.random.default_rng((4, number)))
        np.testing.assert_array_equal(touch.points, expected.points)
        assert (touch.unit, touch.sensor) == (2.0, "x")
    assert len(touched(tmp_path, 1, points=100)[0].points) == 100  # more than there are: some twice


@pytest.mark.parametrize("name", ["deep/box.stl", "box.stl", "box"])
@pytest.mark.parametrize("suffix", [True, False])
def test_each_object_has_a_folder_of_its_name(tmp_path, name, suffix):
    write(tmp_path / (name if suffix else name.removesuffix(".stl")), patches(1))
    write(tmp_path / "other", patches(3)[2:])
    assert numbers(touched(tmp_path, 1, name=name)) == [0]
    assert numbers(touched(tmp_path, 1, name="other.stl")) == [2]


def test_a_recording_at_the_top_is_of_every_object(tmp_path):
    write(tmp_path, patches(1))
    write(tmp_path / "box", patches(3)[2:])
    assert numbers(touched(tmp_path, 1, name="box.stl")) == [0]


def test_no_touches_need_no_recording(tmp_path):
    assert touched(tmp_path, 0) == []


def test_an_object_without_a_recording_is_named(tmp_path):
    with pytest.raises(UserError) as caught:
        touched(tmp_path, 1, name="deep/box.stl")
    message = str(caught.value)
    assert message.startswith("deep/box.stl: touch 'recorded' finds no recording of it")
    for place in ("touches.json", "deep/box/touches.json", "deep/box.stl/touches.json"):
        assert str(tmp_path / place) in message


@pytest.mark.parametrize("name", ["../box.stl", "/box.stl", "deep/../../box"])
def test_names_that_lead_out_of_the_folder_are_refused(tmp_path, name):
    (tmp_path / "in").mkdir()
    write(tmp_path / "box", patches(1))
    with pytest.raises(UserError, match="leads out of"):
        touched(tmp_path / "in", 1, name=name)


def test_too_few_touches_are_counted_with_what_was_left_out(tmp_path):
    write(tmp_path, patches(3), ["a", "b", "c"])
    (tmp_path / "1.ply").write_text("noise")
    with pytest.raises(UserError) as caught:
        touched(tmp_path, 3)
    message = str(caught.value)
    assert message.startswith(f"part: 3 touches are asked for, and {tmp_path} holds 2 of use; left out were b: ")
    assert "1.ply cannot be read as a .ply file" in message
    assert len(touched(tmp_path, 2)) == 2


def test_too_few_touches_are_counted_where_nothing_was_left_out(tmp_path):
    write(tmp_path, patches(2))
    with pytest.raises(UserError, match=r"part: 5 touches are asked for, and .* holds 2 of use$"):
        touched(tmp_path, 5)


def test_a_folder_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"touch 'recorded': folder '.*none' is not there"):
        Recorded(folder=str(tmp_path / "none"))


def test_its_options_are_what_yaml_can_write():
    options = options_model(Recorded)
    assert options.model_validate_json('{"folder": "x", "points": 3}').points == 3
    assert options.model_validate_json('{"folder": "x"}').points == 512
    with pytest.raises(ValueError, match="points"):
        options.model_validate_json('{"folder": "x", "points": 0}')


def test_another_recording_is_another_digest_wherever_it_lies(tmp_path):
    for place in ("here", "there"):
        write(tmp_path / place / "part", patches(2), ["a", "b"])
    here, there = (Recorded(folder=str(tmp_path / place)) for place in ("here", "there"))
    assert here.digest("part") == there.digest("part") != "missing"
    assert here.digest("other") == "missing"
    manifest = tmp_path / "there" / "part" / "touches.json"
    manifest.write_text(manifest.read_text().replace('"a"', '"c"'))
    assert here.digest("part") != there.digest("part")
