"""Damaged and tampered pickles are refused, whatever is in them."""

import collections
import contextlib
import pickle  # noqa: TID251
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr import UserError
from pcsr.recorded.pickles.unpickle import DEEPEST
from tests.clouds.pickles import load, same


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
        (
            b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\ntR(S'k'\nS'v'\nu.",
            "adds items to .*, which is no container",
        ),
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
