import collections
import contextlib
import io
import os
import pickle  # noqa: TID251
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr import UserError
from pcsr.recorded.pickles.unpickle import DEEPEST, Inert, load_numpy, load_pickle

PROTOCOLS = range(pickle.HIGHEST_PROTOCOL + 1)


class Hostile:
    """Unpickled the usual way, it writes a file."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.system, (f"touch {self.path}",)


def load(data, inert=(), folder=None):
    """Load what `data` pickles to, from a file."""
    raw = data if isinstance(data, bytes) else pickle.dumps(data)
    path = folder / "data.pkl"
    path.write_bytes(raw)
    return load_pickle(path, inert)


def same(a, b):
    """Equal in value and in type, all the way down."""
    assert type(a) is type(b)
    if isinstance(a, np.ndarray):
        assert (a.dtype, a.shape) == (b.dtype, b.shape)
        if a.dtype == object:
            for one, other in zip(a.ravel(), b.ravel(), strict=True):
                same(one, other)
        else:
            assert a.tobytes() == b.tobytes()
    elif isinstance(a, dict):
        assert list(a) == list(b)
        for key in a:
            same(a[key], b[key])
    elif isinstance(a, list | tuple):
        assert len(a) == len(b)
        for one, other in zip(a, b, strict=True):
            same(one, other)
    else:
        assert a == b


ARRAYS = [
    np.arange(6.0).reshape(2, 3),
    np.arange(6, dtype=">i4").reshape(3, 2),
    np.asfortranarray(np.arange(12, dtype=np.float32).reshape(3, 4)),
    np.arange(24).reshape(2, 3, 4).transpose(1, 0, 2),
    np.array([True, False]),
    np.array(["touch", "é"]),
    np.array([b"ab", b"c"]),
    np.array([1 + 2j]),
    np.zeros((0, 3)),
    np.array(3.5),
    np.array([{"a": [1]}, None, np.ones(2)], dtype=object),
    np.array({"pos": np.ones(3)}, dtype=object),
]


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


def tampered(old, new, array=None):
    raw = pickle.dumps(np.arange(3.0) if array is None else array, 2)
    assert raw.count(old) == 1
    return raw.replace(old, new)


@pytest.mark.parametrize(
    ("raw", "reason"),
    [
        (tampered(b"X\x02\x00\x00\x00f8", b"X\x02\x00\x00\x00O8"), "without its 3 objects"),
        (tampered(b"X\x02\x00\x00\x00f8", b"X\x02\x00\x00\x00V8"), "dtype 'V8'"),
        (tampered(b"X\x02\x00\x00\x00f8", b"X\x02\x00\x00\x00f4"), "without its 12 bytes"),
        (tampered(b"X\x02\x00\x00\x00f8", b"X\x02\x00\x00\x00M8"), "dtype 'M8'"),
        (tampered(b"X\x02\x00\x00\x00f8", b"X\x02\x00\x00\x00U0"), "no size"),
        (tampered(b"X\x02\x00\x00\x00f8", b"X\x05\x00\x00\x00O,f,f"), "dtype 'O,f,f'"),
        (tampered(b"NNN", b"NN}"), "unknown form"),
        (tampered(b"K\x01K\x03\x85", b"K\x01K\x04\x85"), "without its 32 bytes"),
        (tampered(b"K\x01K\x03\x85", b"K\x01J\xff\xff\xff\xff\x85"), "shape"),
        (tampered(b"K\x01K\x03\x85", b"K\x01\x8a\x06\x00\x00\x00\x00\x00\x7f\x85"), "without its"),
        (pickle.dumps(np.zeros(2, [("a", "f8")])), "dtype"),
        (pickle.dumps(np.dtype("f8")), "itself, not data"),
        (pickle.dumps(np.ndarray), "itself, not data"),
        (pickle.dumps([dict]), "itself, not data"),
        (b"cbuiltins\nbytes\n(J\x00\x00\x00\x7ftR.", "no plain value"),
        (b"cbuiltins\nbytearray\n(J\x00\x00\x00\x7ftR.", "no plain value"),
        (b"cbuiltins\nstr\n((ltR.", "no plain value"),
        (b"cbuiltins\nlist\n(S'ab'\ntR.", "no container"),
        (b"c_codecs\nencode\n(S'ab'\nS'rot13'\ntR.", "another encoding"),
        (b"cnumpy.core.multiarray\n_reconstruct\n(cbuiltins\nlist\n(I0\ntS'b'\ntR.", "unknown class"),
        (b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(I0\ntS'b'\ntR.", "without data"),
        (b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\ntR(S'k'\nS'v'\nu.", "which is no container"),
        (b"\x80\x02(lq\x00h\x00a.", "holds itself"),
        (b"\x80\x02}q\x00K\x01h\x00s.", "holds itself"),
        (b"\x80\x04\x8e\x00\x00\x00\x00\x00\x01\x00\x00x.", "ends too early"),
        (b"\x80\x04\x96\x00\x00\x00\x00\x00\x00\x00\x7f.", "cannot be read"),
        (b"\x82\x01.", "cannot be read"),
        (b"Pname\n.", "persistent"),
        (b"", "ends too early"),
        (b"not a pickle", "cannot be read"),
        (b"\x80\x09.", "protocol"),
    ],
)
def test_tampered_and_damaged_files_are_refused(tmp_path, raw, reason):
    with pytest.raises(UserError, match=reason) as caught:
        load(raw, folder=tmp_path)
    assert str(tmp_path / "data.pkl") in str(caught.value)
    assert "\n" not in str(caught.value)


def test_objects_are_never_made_of_raw_bytes(tmp_path):
    # An array of one object whose data are the bytes of a pointer.
    raw = tampered(b"X\x02\x00\x00\x00f8", b"X\x01\x00\x00\x00O", np.array([struct.unpack("d", b"A" * 8)[0]]))
    with pytest.raises(UserError, match="without its 1 objects"):
        load(raw, folder=tmp_path)
    # A dtype that says f8 and whose flags say that it holds objects: its flags are not looked at.
    raw = pickle.dumps(np.arange(3.0), 2).replace(b"K\x00tq", b"K\x3ftq", 1)
    assert raw != pickle.dumps(np.arange(3.0), 2)
    same(load(raw, folder=tmp_path), np.arange(3.0))


def test_text_and_truth_that_are_none_do_no_harm(tmp_path):
    text = pickle.dumps(np.array(["ab"]), 4).replace("ab".encode("utf-32-le"), b"\xff" * 8)
    with pytest.raises(UserError, match="text with invalid characters"):
        load(text, folder=tmp_path)
    truth = pickle.dumps(np.array([True, False, True]), 4).replace(b"C\x03\x01\x00\x01", b"C\x03\x07\x00\x01")
    assert load(truth, folder=tmp_path).tobytes() == b"\x01\x00\x01"


def test_every_truncation_is_refused(tmp_path):
    raw = pickle.dumps({"points": np.ones((4, 3)), "ok": [True, "x"]})
    for length in range(len(raw)):
        with pytest.raises(UserError):
            load(raw[:length], folder=tmp_path)


def test_deep_nesting_is_an_error_and_no_crash(tmp_path):
    lists = b"\x80\x02" + b"]" * 100_000 + b"a" * 99_999 + b"."
    with pytest.raises(UserError, match="nested too deeply"):
        load(lists, folder=tmp_path)
    # As a key, a tuple nested this deeply would overflow the interpreter's stack when hashed.
    key = b"\x80\x02})" + b"\x85" * 1_000_000 + b"K\x01s."
    with pytest.raises(UserError, match=f"nests tuples {DEEPEST + 1} deep"):
        load(key, folder=tmp_path)
    # Not deep, but 2^30 items to hash, as each level holds the one below twice.
    bomb = b"\x80\x02})q\x00" + b"h\x00h\x00\x86q\x00" * 30 + b"K\x01s."
    with pytest.raises(UserError, match=r"nests tuples \d+ deep with \d{8} items"):
        load(bomb, folder=tmp_path)
    fine = ()
    for _ in range(DEEPEST - 1):
        fine = (fine, 1)
    same(load({fine: 1}, folder=tmp_path), {fine: 1})


@given(noise=st.binary(max_size=60), at=st.integers(0, 200))
def test_noise_gives_data_or_an_error_of_ours(tmp_path_factory, noise, at):
    raw = pickle.dumps({"points": np.ones((2, 3)), "kind": collections.OrderedDict(a={1})})
    with contextlib.suppress(UserError):
        load(raw[:at] + noise + raw[at + len(noise) :], folder=tmp_path_factory.getbasetemp())


def test_numbers_and_objects_are_read_from_npy(tmp_path):
    path = tmp_path / "a.npy"
    for array in ARRAYS:
        np.save(path, array)
        loaded = load_numpy(path)
        if array.shape == () and array.dtype == object:
            same(loaded, array.item())
        else:
            same(loaded, array)


def test_an_npy_file_of_python_2_is_read_without_a_warning(tmp_path):
    file = io.BytesIO()
    np.save(file, np.arange(3.0))
    (tmp_path / "a.npy").write_bytes(file.getvalue().replace(b"(3,), } ", b"(3L,), }"))
    same(load_numpy(tmp_path / "a.npy"), np.arange(3.0))


def test_a_hostile_npy_file_is_refused_and_not_run(tmp_path):
    np.save(tmp_path / "a.npy", np.array({"pos": Hostile(tmp_path / "bad")}, dtype=object))
    with pytest.raises(UserError, match="asks to run"):
        load_numpy(tmp_path / "a.npy")
    assert not (tmp_path / "bad").exists()


def npy(array, cut=None, swap=(b"", b"")):
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()[:cut].replace(*swap, 1)


@pytest.mark.parametrize(
    ("raw", "reason"),
    [
        (b"", "cannot be read as an .npy file"),
        (b"\x93NUMPY\x01\x00", "cannot be read as an .npy file"),
        (b"\x93NUMPY\x03\x00", "version"),
        (npy(np.ones(4), -1), "cut off or damaged"),
        (npy(np.ones(4)) + b"x", "cut off or damaged"),
        (npy(np.ones(4), swap=(b"(4,)", b"(9999999999999,)")), "cannot be read|cut off"),
        (npy(np.zeros(2, [("a", "f8")])), "dtype"),
        (npy(np.zeros(2, "M8[s]")), "dtype"),
        (npy(np.zeros(2, [("a", "O")])), "dtype"),
        (npy(np.array([None, 1]), swap=(b"(2,)", b"(3,)")), "is damaged"),
        (npy(np.array([None, 1]), -3), "cannot be read"),
        (npy(np.array([None]))[:128] + pickle.dumps([None]), "is damaged"),
    ],
)
def test_damaged_npy_files_are_refused(tmp_path, raw, reason):
    path = tmp_path / "a.npy"
    path.write_bytes(raw)
    with pytest.raises(UserError, match=reason) as caught:
        load_numpy(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("read", [load_numpy, load_pickle])
def test_a_file_that_is_not_there_is_named(tmp_path, read):
    with pytest.raises(UserError, match=r"none\.npy cannot be read: No such file"):
        read(tmp_path / "none.npy")
    with pytest.raises(UserError, match="cannot be read"):
        read(Path(tmp_path))
