import copy
import json
import shutil

import numpy as np
import pytest
from safetensors.numpy import save_file

from pcsr.errors import UserError
from pcsr.report.run_set import run_set
from pcsr.run_files import read_run


def put(folder, results, clouds, names, history=None):
    """A run folder."""
    folder.mkdir()
    (folder / "results.json").write_text(json.dumps(results), encoding="utf-8")
    save_file(clouds, folder / "examples.safetensors", {"names": json.dumps(names)})
    if history is not None:
        lines = "".join(json.dumps(line) + "\n" for line in history)
        (folder / "metrics.jsonl").write_text(lines, encoding="utf-8")
    return folder


@pytest.fixture
def other(results, clouds):
    """Results and clouds of a run without touch on the same objects; its own prediction is another."""
    made = copy.deepcopy(results) | {"name": "plain", "fingerprint": "99887766aabb", "touch": None}
    made["data"]["touches"] = 0
    made["methods"] = [made["methods"][0] | {"name": "plain"}, made["methods"][1]]
    rng = np.random.default_rng(5)
    kept = {key: cloud for key, cloud in clouds.items() if key.partition("/")[2] in ("input", "truth", "midpoint")}
    own = {f"{k}/plain": rng.uniform(-1, 1, (256, 3)).astype(np.float32) for k in range(2)}
    return made, kept | own


def gather(folders):
    return run_set([read_run(folder) for folder in folders])


def names(results):
    return results["objects"][:2]


def test_one_run_is_read_as_it_is(run, results, clouds):
    read = gather([run])
    assert read.networks == ["tapsr"]
    assert [shared.example.name for shared in read.examples] == names(results)
    shared = read.examples[1]
    assert list(shared.example.predictions) == ["tapsr", "midpoint", "a <b>&"]
    np.testing.assert_array_equal(shared.example.predictions["tapsr"], clouds["1/tapsr"])
    assert [len(touch) for touch in shared.touches] == [15, 15]
    np.testing.assert_array_equal(np.concatenate(shared.touches), clouds["1/touches"])
    assert len(read.histories[0]) == 31


def test_networks_come_first_in_the_order_of_the_runs_and_each_baseline_once(tmp_path, run, other, results, clouds):
    plain = put(tmp_path / "plain", *other, names(results))
    read = gather([plain, run])
    assert read.networks == ["plain", "tapsr"]
    assert read.histories[0] is None
    for k, shared in enumerate(read.examples):
        assert list(shared.example.predictions) == ["plain", "tapsr", "midpoint", "a <b>&"]
        np.testing.assert_array_equal(shared.example.predictions["plain"], other[1][f"{k}/plain"])
        np.testing.assert_array_equal(shared.example.predictions["tapsr"], clouds[f"{k}/tapsr"])
        assert len(shared.touches) == 2, "the touches of the run that has some"


def test_runs_of_different_numbers_of_touches_show_the_most(tmp_path, run, results, clouds):
    one = copy.deepcopy(results) | {"name": "one"}
    one["data"]["touches"] = 1
    one["methods"][0]["name"] = "one"
    fewer = {key.replace("tapsr", "one"): cloud for key, cloud in clouds.items()}
    fewer |= {f"{k}/touches": clouds[f"{k}/touches"][:15] for k in range(2)}
    folder = put(tmp_path / "one", one, fewer, names(results))
    for order in ([folder, run], [run, folder]):
        assert [len(shared.touches) for shared in gather(order).examples] == [2, 2]


def test_an_object_with_fewer_touches_than_the_run_shows_its_own(tmp_path, results, clouds):
    clouds["0/touches"] = clouds["0/touches"][:15]
    del clouds["1/touches"]
    folder = put(tmp_path / "run", results, clouds, names(results))
    about = {"names": json.dumps(names(results)), "touches": json.dumps([1, 0])}
    save_file(clouds, folder / "examples.safetensors", about)
    one, none = gather([folder]).examples
    assert [len(touch) for touch in one.touches] == [15]
    assert (none.touches, none.example.touches) == ([], None)


def test_only_objects_that_all_runs_show_are_shown(tmp_path, run, other, results):
    made, clouds = other
    second = {key.replace("1/", "0/"): cloud for key, cloud in clouds.items() if key.startswith("1/")}
    plain = put(tmp_path / "plain", made, second, names(results)[1:])
    (shared,) = gather([run, plain]).examples
    assert shared.example.name == names(results)[1]
    np.testing.assert_array_equal(shared.example.predictions["plain"], clouds["1/plain"])


def test_runs_of_one_name_are_told_apart(tmp_path, run, results, clouds):
    again = put(tmp_path / "again", results | {"fingerprint": "0123456789ab"}, clouds, names(results))
    assert gather([run, again]).networks == ["tapsr-ab12cd34", "tapsr-01234567"]


def test_a_network_called_like_a_baseline_does_not_hide_it(tmp_path, run, other, results):
    made, clouds = other
    made["name"] = "a <b>&"
    made["methods"][0]["name"] = "a <b>&"
    named = {key.replace("plain", "a <b>&"): cloud for key, cloud in clouds.items()}
    folder = put(tmp_path / "named", made, named, names(results))
    read = gather([run, folder])
    assert read.networks == ["tapsr", "a <b>&-99887766"]
    assert list(read.examples[0].example.predictions) == ["tapsr", "a <b>&-99887766", "midpoint", "a <b>&"]


@pytest.mark.parametrize("cloud", ["input", "truth"])
def test_runs_of_other_clouds_are_refused(tmp_path, run, other, results, cloud):
    made, clouds = other
    clouds[f"1/{cloud}"] = clouds[f"1/{cloud}"] + np.float32(0.1)
    plain = put(tmp_path / "plain", made, clouds, names(results))
    with pytest.raises(UserError, match=rf"{plain}: the {cloud} of 'test/gear/0001' is not that of {run}"):
        gather([run, plain])


def test_runs_without_an_object_in_common_are_refused(tmp_path, run, other):
    plain = put(tmp_path / "plain", *other, ["x", "y"])
    with pytest.raises(UserError, match=r"no object is an example of all of .*evaluate\.examples"):
        gather([run, plain])


def test_touches_that_their_number_does_not_divide_are_refused(tmp_path, results, clouds):
    results["data"]["touches"] = 4
    with pytest.raises(UserError, match="30 touched points are not those of 4 touches"):
        gather([put(tmp_path / "bad", results, clouds, names(results))])


def test_no_run_and_one_run_twice_are_refused(run):
    with pytest.raises(UserError, match="no run is named"):
        gather([])
    with pytest.raises(UserError, match="named twice"):
        gather([run, run.parent / run.name / "." / ".." / run.name])


@pytest.mark.parametrize("file", ["results.json", "examples.safetensors"])
@pytest.mark.parametrize("text", [None, "", "{}"])
def test_a_missing_or_empty_file_is_named(tmp_path, run, file, text):
    broken = tmp_path / "broken"
    broken.mkdir()
    for path in run.iterdir():
        if path.is_file():
            shutil.copy(path, broken)
    (broken / file).unlink()
    if text is not None:
        (broken / file).write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=str(broken / file)):
        gather([broken])
