"""Pickles, and one that would do harm."""

import os
import pickle  # noqa: TID251

import numpy as np

from pcsr.recorded.pickles.unpickle import load_pickle

PROTOCOLS = range(pickle.HIGHEST_PROTOCOL + 1)
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
