"""A split: some of its objects, several splits as one, and what is refused."""

import dataclasses

import pytest
import torch

from pcsr import UserError
from pcsr.data.dataset import Split
from tests.data.splits import split


def named(count, head, **changes):
    made = split(count)
    return dataclasses.replace(made, names=[f"{head}{i}" for i in range(count)], about={"rejected": {}}, **changes)


def test_chosen_objects_keep_all_that_belongs_to_them():
    whole = split(5)
    some = whole.chosen([3, 0])
    assert len(some) == 2
    for field in dataclasses.fields(Split):
        if field.name != "about":
            one, other = getattr(some, field.name), getattr(whole, field.name)
            assert all(a is b for a, b in zip(one, (other[3], other[0]), strict=True)), field.name
    assert some.about is whole.about


@pytest.mark.parametrize(("count", "names"), [(1, [0]), (3, [0, 2, 4]), (7, [*range(7)]), (20, [*range(7)])])
def test_objects_are_spread_over_the_whole_split(count, names):
    assert split(7).spread(count).names == [f"object {i}" for i in names]


def test_coverage_is_the_mean_share_of_the_first_touches():
    made = dataclasses.replace(split(2), covered=[(0.1, 0.2, 0.4), (0.3, 0.4, 0.5)])
    assert [made.coverage(touches) for touches in range(4)] == pytest.approx([0, 0.2, 0.3, 0.45])


def test_splits_are_joined_in_their_order_with_as_many_touches_as_all_have():
    one = dataclasses.replace(named(2, "a"), about={"rejected": {"a9": "it is flat"}})
    few = [touches[:1] for touches in split(3).touches]
    made = Split.joined([one, named(3, "b", touches=few, covered=[(0.1,)] * 3)])
    assert made.names == ["a0", "a1", "b0", "b1", "b2"]
    assert {touches.shape for touches in made.touches} == {(1, 8, 3)}
    assert {len(shares) for shares in made.covered} == {1}
    assert torch.equal(made.points[3], split(3).points[1])
    assert made.about == {"rejected": {"1: a9": "it is flat"}}
    assert Split.joined([one]) is one


def test_without_touches_in_one_of_them_nobody_has_any():
    none = [touches[:0] for touches in split(2).touches]
    made = Split.joined([named(2, "a"), named(2, "b", touches=none, covered=[()] * 2)])
    assert {touches.shape for touches in made.touches} == {(0, 0, 3)}


def test_an_object_with_fewer_touches_takes_none_from_the_others():
    fewer = [touches[:k] for k, touches in enumerate(split(3).touches)]
    made = Split.joined([named(2, "a"), named(3, "b", touches=fewer)])
    assert [len(touches) for touches in made.touches] == [3, 3, 0, 1, 2]
    assert {touches.shape[1:] for touches in made.touches} == {(8, 3)}


@pytest.mark.parametrize("clouds", ["truth", "points", "touches"])
def test_clouds_of_two_sizes_are_not_joined(clouds):
    fewer = [cloud[..., :5, :] for cloud in getattr(split(2), clouds)]
    with pytest.raises(
        UserError, match=rf"data cannot be joined: {clouds} of 5 and \d+ points; build all with the same number"
    ):
        Split.joined([named(2, "a"), named(2, "b", **{clouds: fewer})])
