"""Pickles are read as plain data: what they would run is refused."""

import collections
import os
import pickle  # noqa: TID251
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr import UserError
from pcsr.recorded.pickles.rebuild import Inert
from pcsr.recorded.pickles.unpickle import load_numpy, load_pickle
from tests.clouds.pickles import ARRAYS, PROTOCOLS, Hostile, load, same


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("array", ARRAYS, ids=str)
def test_arrays_of_every_protocol_come_back_as_they_were(tmp_path, array, protocol):
    same(load(pickle.dumps(array, protocol), folder=tmp_path), array)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_containers_and_scalars_of_every_protocol_come_back(tmp_path, protocol):
    data = {
        "list": [1, -(2**70), 2.5, float("inf"), None, True, "ü"],
        "tuple": (1, (2, (3,))),
        "set": {1, 2},
        "frozenset": frozenset({3}),
        "bytes": b"\x00\xff",
        "empty": b"",
        "bytearray": bytearray(b"ab"),
        "complex": 1 + 2j,
        "ordered": collections.OrderedDict([("b", 1), ("a", np.ones(2))]),
        "scalars": [np.float32(1.5), np.int64(-3), np.bool_(True), np.str_("x")],
        "kept": {np.float64(2): "key"},
    }
    same(load(pickle.dumps(data, protocol), folder=tmp_path), data)


PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.binary(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner) | st.tuples(inner, inner),
    max_leaves=10,
)


@pytest.mark.slow
@given(data=PLAIN, protocol=st.sampled_from(list(PROTOCOLS)))
def test_any_plain_data_comes_back(tmp_path_factory, data, protocol):
    same(load(pickle.dumps(data, protocol), folder=tmp_path_factory.getbasetemp()), data)


def test_what_is_shared_stays_shared(tmp_path):
    array = np.ones(3)
    first, second = load([array, array], folder=tmp_path)
    assert first is second
    nested = [1]
    for _ in range(50):
        nested = [nested, nested]  # 2^50 paths to one list
    assert load(nested, folder=tmp_path)[0] is not None


def test_arrays_can_be_written_to(tmp_path):
    array = load(np.zeros(3), folder=tmp_path)
    array[0] = 1
    assert array.tolist() == [1, 0, 0]


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_hostile_pickle_is_refused_and_not_run(tmp_path, protocol):
    with pytest.raises(UserError, match=rf"data.pkl asks to run `{os.name}.system`, .* it was not run"):
        load(pickle.dumps({"x": [Hostile(tmp_path / "bad")]}, protocol), folder=tmp_path)
    assert not (tmp_path / "bad").exists()
    assert pickle.loads(pickle.dumps(Hostile(tmp_path / "bad"))) == 0  # it would have worked
    assert (tmp_path / "bad").exists()


@pytest.mark.parametrize(
    "raw",
    [
        b"cos\nsystem\n(S'true'\ntR.",
        b"(S'true'\nios\nsystem\n.",
        b"(cos\nsystem\nS'true'\no.",
        b"\x80\x04\x8c\x02os\x8c\x06system\x93\x8c\x04true\x85R.",
        b"\x80\x02cos\nsystem\n)\x81.",
    ],
)
def test_every_opcode_that_names_something_is_refused(tmp_path, raw):
    with pytest.raises(UserError, match=r"asks to run `os\.system`"):
        load(raw, folder=tmp_path)


@pytest.mark.parametrize(
    "name",
    [
        "builtins eval",
        "builtins getattr",
        "builtins object",
        "numpy ndarray.tofile",
        "numpy load",
        "numpy.core.multiarray fromfile",
        "numpy.core.multiarray _reconstruct.__globals__",
        "_codecs decode",
        "codecs encode",
        "copyreg _reconstructor",
        "typing Any",
    ],
)
def test_neighbours_of_what_is_allowed_are_refused(tmp_path, name):
    module, attribute = name.split()
    with pytest.raises(UserError, match="asks to run"):
        load(f"c{module}\n{attribute}\n.".encode(), folder=tmp_path)


def test_inert_classes_become_placeholders(tmp_path):
    config = (
        b"\x80\x02}q\x00(X\x01\x00\x00\x00nc"
        b"omegaconf.dictconfig\nDictConfig\n)\x81}X\x01\x00\x00\x00acomegaconf.nodes\nAnyNode\nsb"
        b"X\x01\x00\x00\x00tctyping\nAny\nX\x01\x00\x00\x00xK\x07u."
    )
    data = load(config, ("omegaconf", "typing.Any"), tmp_path)
    assert data["x"] == 7
    assert isinstance(data["n"], Inert)
    assert repr(data["n"]) == "Inert('omegaconf.dictconfig.DictConfig')"
    assert data["t"].name == "typing.Any"
    with pytest.raises(UserError, match=r"asks to run `omegaconf\.dictconfig\.DictConfig`"):
        load(config, ("omegaconf.dictconf", "typing.Any"), tmp_path)


@pytest.mark.parametrize(
    "use",
    [
        b"cx\nY\n(S'a'\ntR(S'k'\nS'v'\nu.",  # filled like a dict
        b"cx\nY\n)R(K\x01K\x02e.",  # extended like a list
        b"cx\nY\n)RK\x01a.",  # appended to
        b"\x80\x04cx\nY\n)}\x8c\x01aK\x01s\x92.",  # made with keywords
        b"(ix\nY\n(dS'k'\nS'v'\nsb.",  # given a state
    ],
)
def test_placeholders_take_whatever_is_done_to_them(tmp_path, use):
    assert load(use, ["x.Y"], tmp_path).name == "x.Y"


def test_what_python_2_wrote_is_read(tmp_path):
    raw = np.arange(3.0).tobytes()
    text = (
        b"\x80\x02}U\x03poscnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85U\x01b\x87R"
        b"(K\x01K\x03\x85cnumpy\ndtype\nU\x02f8K\x00K\x01\x87R(K\x03U\x01<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb"
        b"\x89U\x18" + raw + b"tbs."
    )
    same(load(text, folder=tmp_path), {"pos": np.arange(3.0)})
    same(load(b"c__builtin__\nset\n((lp0\nI1\natR.", folder=tmp_path), {1})


@pytest.mark.parametrize("read", [load_numpy, load_pickle])
def test_a_file_that_is_not_there_is_named(tmp_path, read):
    with pytest.raises(UserError, match=r"none\.npy cannot be read: No such file"):
        read(tmp_path / "none.npy")
    with pytest.raises(UserError, match="cannot be read"):
        read(Path(tmp_path))
