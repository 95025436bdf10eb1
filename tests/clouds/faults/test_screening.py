"""Treatment of faults: refused, dropped, or kept unused; by the library as by the command."""

import warnings

import numpy as np
import pytest
import torch

from pcsr import PcsrWarning, UserError, evaluate, load
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.faults import screen, warn_of_faults


def bowl(count=100, seed=0, at=(0, 0, 2)):
    xy = np.random.default_rng(seed).uniform(-1, 1, (count, 2))
    return np.column_stack([xy, 0.3 * xy[:, 0] ** 2 + 0.1 * xy[:, 1]]) + at


HEALTHY = bowl()
BAD = np.concatenate([[[np.nan] * 3], np.zeros((20, 3)), [[1e7, 0, 0]]])
SICK = np.concatenate([HEALTHY[:50], BAD, HEALTHY[50:], HEALTHY[:10]])
"""22 bad points in the middle, ten copies at the end."""
ROWS = np.r_[0:50, 72:122]


def cloud():
    return Cloud(SICK, {"label": np.arange(len(SICK))})


def test_faults_are_refused_in_one_sentence_with_remedies():
    with pytest.raises(UserError) as caught:
        screen(cloud(), name="a.ply")
    assert str(caught.value) == (
        "a.ply: 1 of 132 points has a coordinate that is not finite, such as point 50, counted from 0, at "
        "(nan, nan, nan); 20 of 132 points have the coordinates (0, 0, 0), which mark an invalid pixel, such as point "
        "51, counted from 0; 1 of 132 points is far away from all others, such as point 71, counted from 0, at "
        "(1e+07, 0, 0): drop such points with --bad drop, or keep them unused with --bad keep "
        "(from Python: bad='drop', bad='keep')"
    )


@pytest.mark.parametrize(("bad", "done"), [("drop", ": dropped"), ("keep", ": kept, but not used")])
def test_what_is_done_is_said_once_for_each_fault(bad, done):
    with pytest.warns(PcsrWarning) as said:
        screened = screen(cloud(), bad, "a.ply")
    *harmful, copies = [str(one.message) for one in said]
    assert len(harmful) == 3
    assert all(one.startswith("a.ply: ") and one.endswith(done) for one in harmful)
    assert "a.ply: 10 of 132 points are exact copies of others, such as point 122 of point 0, counted from 0" in copies
    np.testing.assert_array_equal(screened.points, HEALTHY)
    if bad == "drop":
        assert screened.used.all()
        np.testing.assert_array_equal(screened.cloud.columns["label"], ROWS)
    else:
        np.testing.assert_array_equal(screened.cloud.points, SICK)
        np.testing.assert_array_equal(np.flatnonzero(screened.used), ROWS)


def test_a_healthy_cloud_is_left_as_it_is():
    given = Cloud(HEALTHY)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for bad in ("refuse", "drop", "keep"):
            screened = screen(given, bad)
            assert screened.cloud is given
            assert screened.used.all()


@pytest.mark.parametrize(
    ("points", "bad", "said"),
    [
        (np.zeros((0, 3)), "keep", "it holds no points"),
        (np.full((4, 3), np.inf), "drop", "it: none of its 4 points has coordinates that are all finite"),
        (np.full((4, 3), np.inf), "refuse", "4 of 4 points have a coordinate that is not finite"),
        (np.ones((4, 3)), "refuse", "all 4 points of it lie on one spot"),
    ],
)
def test_what_nothing_is_left_of_is_said(points, bad, said):
    with pytest.raises(UserError, match=said):
        screen(Cloud(points), bad, "it")


def test_a_treatment_that_is_none_is_said():
    unchecked = getattr(screen, "__wrapped__", screen)  # by types, as all functions are while tests run
    with pytest.raises(UserError, match="bad is 'ignore': it must be refuse, drop or keep"):
        unchecked(Cloud(HEALTHY), "ignore")


MODEL = load("midpoint")


@pytest.mark.filterwarnings("ignore:the cloud")
def test_new_points_are_those_of_the_healthy_cloud():
    expected = MODEL.upsample(HEALTHY, rate=3)
    np.testing.assert_array_equal(MODEL.upsample(SICK, rate=3, bad="drop"), expected)
    kept = MODEL.upsample(SICK, rate=3, bad="keep")
    np.testing.assert_array_equal(kept[:132], SICK)
    np.testing.assert_array_equal(kept[132:], expected[100:])
    replaced = MODEL.upsample(SICK, rate=3, bad="keep", keep=False)
    np.testing.assert_array_equal(replaced, MODEL.upsample(HEALTHY, rate=3, keep=False))
    with pytest.raises(UserError, match="bad='drop'"):
        MODEL.upsample(SICK)


@pytest.mark.filterwarnings("ignore:the cloud")
def test_a_count_is_that_of_the_output_whatever_is_unused():
    for bad, count in (("drop", 200), ("keep", 200), ("keep", 132)):
        assert len(MODEL.upsample(SICK, count=count, bad=bad)) == count
    assert len(MODEL.upsample(SICK, count=90, bad="keep", keep=False)) == 90
    with pytest.raises(UserError, match="131 points are fewer than the 132 of the cloud"):
        MODEL.upsample(SICK, count=131, bad="keep")


@pytest.mark.parametrize("each", [2, 8])
def test_copies_give_the_new_points_of_the_cloud_without_them(each):
    order = np.random.default_rng(0).permutation(100 * each)
    copied = np.repeat(HEALTHY, each, axis=0)[order]
    with pytest.warns(PcsrWarning, match=f"{100 * each - 100} of {100 * each} points are exact copies of .* used once"):
        dense = MODEL.upsample(copied, rate=4)
    np.testing.assert_array_equal(dense[: 100 * each], copied)
    new = dense[100 * each :]
    alone = MODEL.upsample(copied[np.sort(np.unique(copied, axis=0, return_index=True)[1])], rate=4)[100:]
    np.testing.assert_array_equal(new, alone)
    assert not {tuple(point) for point in new} & {tuple(point) for point in HEALTHY}


def test_columns_of_new_points_come_from_used_points_alone():
    columns = {"red": np.where(np.isin(np.arange(132), ROWS), 200, 0).astype(np.uint8)}
    columns["red"][122:] = 0  # the copies
    with pytest.warns(PcsrWarning):
        dense = MODEL.upsample(Cloud(SICK, columns), bad="keep")
    assert dense.columns["red"].dtype == np.uint8
    np.testing.assert_array_equal(dense.columns["red"][:132], columns["red"])
    assert (dense.columns["red"][132:] == 200).all()


def test_a_screened_cloud_is_upsampled_as_it_is():
    with pytest.warns(PcsrWarning):
        screened = screen(cloud(), "keep")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dense = MODEL.upsample(screened, rate=2)
    np.testing.assert_array_equal(screened.without_kept(dense).points[:100], HEALTHY)
    assert len(screened.without_kept(dense)) == 200


def test_tensors_come_back_with_what_was_kept():
    given = torch.from_numpy(SICK).float()
    with pytest.warns(PcsrWarning):
        dense = MODEL.upsample(given, bad="keep")
    assert torch.equal(dense[:132].nan_to_num(-7), given.nan_to_num(-7))
    assert dense[132:].isfinite().all()


def test_clouds_that_are_measured_are_used_and_their_faults_are_said():
    sick = SICK[1:][np.isfinite(SICK[1:]).all(axis=1)]
    with pytest.warns(PcsrWarning) as said:
        values = evaluate(sick, HEALTHY, metrics="cd")
    assert values["cd"] > 1e9
    messages = [str(one.message) for one in said]
    assert [message.rpartition(": ")[2] for message in messages] == ["they are used like all others"] * 2
    assert all(message.startswith("the prediction: ") for message in messages)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_faults(np.repeat(HEALTHY, 2, axis=0), "it")


@pytest.mark.parametrize("factor", [1000.0, 25.4, 1 / 3.28])
def test_clouds_in_different_units_are_told(factor):
    larger, ratio = ("prediction", factor) if factor > 1 else ("truth", 1 / factor)
    shown = "1,000" if ratio > 999 else f"{ratio:.3g}"
    with pytest.warns(PcsrWarning, match=rf"the {larger} is {shown} times as large as the .*--frame each"):
        evaluate(HEALTHY * factor, HEALTHY)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        evaluate(HEALTHY * factor, HEALTHY, frame="each")
        evaluate(HEALTHY * 2, HEALTHY)
        evaluate(HEALTHY, np.concatenate([HEALTHY, bowl(5) * 2]), metrics="cd")
