"""Construction of plain containers and numeric arrays from the calls that a pickle's stand-ins recorded."""

import math
import re
from collections import OrderedDict
from collections.abc import Callable
from reprlib import repr as short
from typing import Any, ClassVar

import numpy as np

DTYPE = re.compile(r"(b1|[iufc]\d{1,2}|[SU]\d{1,9}|O8?|\?)")
"""Pattern of the dtypes of arrays that are built. Records and dates are refused: recordings do not contain them."""
ENCODINGS = ("latin1", "latin-1", "iso-8859-1")
"""Names of the encoding in which old pickles write bytes."""


class NotPlainError(ValueError):
    """Error for a pickle that holds anything but plain data. The message says what it holds."""


class Inert:
    """Empty placeholder for an object of a class that the caller declared harmless."""

    def __init__(self, name: str) -> None:
        """Create a placeholder.

        Args:
            name: full name of the class.
        """
        self.name = name

    def __repr__(self) -> str:
        return f"Inert({self.name!r})"


class StandIn:
    """Replacement for a class or function that a pickle names. Calling it only records the call."""

    name: ClassVar[str]
    inert: ClassVar[bool]
    args: tuple[Any, ...]
    state: Any
    entries: list[tuple[Any, Any]]

    def __new__(cls, *args: Any, **kwargs: Any) -> "StandIn":
        """Record a call.

        Raises:
            NotPlainError: the call has keyword arguments, which no allowed class or function takes.
        """
        if kwargs and not cls.inert:
            raise NotPlainError(f"it calls {cls.name} with keyword arguments")
        self = object.__new__(cls)
        self.args, self.state, self.entries = args, None, []
        return self

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        pass

    def __setstate__(self, state: Any) -> None:
        self.state = state

    def __setitem__(self, key: Any, value: Any) -> None:
        self.entries.append((key, value))

    def append(self, value: Any) -> None:
        """Record an item."""
        self.entries.append((None, value))


class Builder:
    """Builder of data from stand-ins. Each object is built once, however often it is referenced."""

    def __init__(self) -> None:
        self.built: dict[int, Any] = {}
        self.in_progress: set[int] = set()

    def build(self, node: Any) -> Any:
        """Build the data of a node of the pickle.

        Raises:
            NotPlainError: the node is not plain data.
        """
        if node is None or isinstance(node, bool | int | float | complex | str | bytes | bytearray):
            return node
        if id(node) in self.built:
            return self.built[id(node)]
        if id(node) in self.in_progress:
            raise NotPlainError("a container holds itself")
        self.in_progress.add(id(node))
        self.built[id(node)] = data = self._make(node)
        self.in_progress.discard(id(node))
        return data

    def _make(self, node: Any) -> Any:
        if isinstance(node, dict):
            return {self.build(key): self.build(value) for key, value in node.items()}
        if isinstance(node, list | tuple | set | frozenset):
            return type(node)(self.build(one) for one in node)
        named = node if isinstance(node, type) else type(node)
        if not issubclass(named, StandIn):
            raise NotPlainError(f"it holds a {named.__name__}")
        if named.inert:
            return Inert(named.name)
        maker = MAKERS[named.name]
        if isinstance(node, type) or maker is None:
            raise NotPlainError(f"it holds {named.name} itself, not data")
        if node.entries and named.name != "collections.OrderedDict":
            raise NotPlainError(f"it adds items to {named.name}, which is no container")
        return maker(self, node)


def _encoded(builder: Builder, call: StandIn) -> bytes:
    """Build bytes from their form in pickle protocols before 3: text, encoded as latin1."""
    text, *rest = builder.build(call.args)
    if not isinstance(text, str) or not rest or rest[0] not in ENCODINGS:
        raise NotPlainError(f"text in another encoding than latin1: {short(rest)}")
    return text.encode("latin1")


def _container(kind: Callable[..., Any]) -> Callable[[Builder, StandIn], Any]:
    def make(builder: Builder, call: StandIn) -> Any:
        args = builder.build(call.args)
        if len(args) > 1 or not all(isinstance(one, list | tuple | dict | set | frozenset) for one in args):
            raise NotPlainError(f"it calls {call.name} with an argument that is no container")
        container = kind(*args)
        for key, value in call.entries:
            container[builder.build(key)] = builder.build(value)
        return container

    return make


def _plain(kind: Callable[..., Any]) -> Callable[[Builder, StandIn], Any]:
    def make(builder: Builder, call: StandIn) -> Any:
        args = builder.build(call.args)
        # `bytes` of an integer would allocate that many, and `str` of a container may be of any length.
        allowed = (str, bytes) if kind in (bytes, bytearray) else (int, float, str, bytes)
        if not all(isinstance(one, allowed) for one in args):
            raise NotPlainError(f"it calls {call.name} with an argument that is no plain value")
        return kind(*args)

    return make


def _dtype(call: Any) -> np.dtype[Any]:
    """Build a dtype from its name and byte order; anything else in its state is refused."""
    if not isinstance(call, StandIn) or call.name != "numpy.dtype" or not call.args:
        raise NotPlainError("an array without a dtype")
    name, state = call.args[0], call.state
    if not isinstance(name, str) or not DTYPE.fullmatch(name):
        raise NotPlainError(f"an array of dtype {short(name)}")
    dtype = np.dtype(name)
    if state is not None:
        known = isinstance(state, tuple) and len(state) >= 8 and state[0] in (3, 4) and state[1] in ("<", ">", "|", "=")
        if not known or any(part is not None for part in state[2:5]):
            raise NotPlainError(f"a dtype {short(name)} of an unknown form")
        dtype = dtype.newbyteorder(state[1])
    if dtype.itemsize == 0:
        raise NotPlainError(f"an array of dtype {short(name)}, whose items have no size")
    return dtype


def array_of(dtype: np.dtype[Any], shape: Any, data: Any, order: Any) -> np.ndarray:
    """Build an array from its data.

    Args:
        dtype: type of the items.
        shape: shape of the array.
        data: bytes of the items, or, for the dtype object, a list of them.
        order: "C" or "F".

    Raises:
        NotPlainError: the shape is invalid, or the data does not have exactly the array's size.
    """
    if not isinstance(shape, tuple) or not all(isinstance(n, int) and n >= 0 for n in shape):
        raise NotPlainError(f"an array of shape {short(shape)}")
    count = math.prod(shape)
    if dtype.kind == "O":
        if not isinstance(data, list) or len(data) != count:
            raise NotPlainError(f"an array of shape {shape} without its {count} objects")
        objects = np.full(count, None, object)
        for index, one in enumerate(data):
            objects[index] = one
        return objects.reshape(shape, order=order)
    if isinstance(data, str):  # a pickle of Python 2
        data = data.encode("latin1")
    if not isinstance(data, bytes | bytearray) or len(data) != count * dtype.itemsize:
        raise NotPlainError(
            f"an array of shape {shape} and dtype {dtype.str} without its {count * dtype.itemsize} bytes"
        )
    if count == 0:
        return np.zeros(shape, dtype)
    if dtype.kind == "b":
        return np.not_equal(np.frombuffer(data, np.uint8), 0).reshape(shape, order=order)
    flat = np.frombuffer(data, dtype).copy()
    if dtype.kind == "U" and flat.view(np.dtype("u4").newbyteorder(dtype.byteorder)).max() > 0x10FFFF:
        raise NotPlainError("an array of text with invalid characters")
    return flat.reshape(shape, order=order)


def _reconstructed(builder: Builder, call: StandIn) -> np.ndarray:
    of = call.args[0] if call.args else None
    if not (isinstance(of, type) and issubclass(of, StandIn) and of.name == "numpy.ndarray"):
        raise NotPlainError("an array of an unknown class")
    if not isinstance(call.state, tuple) or len(call.state) not in (4, 5):
        raise NotPlainError("an array without data")
    shape, dtype, fortran, data = call.state[-4:]
    return array_of(_dtype(dtype), builder.build(shape), builder.build(data), "F" if fortran else "C")


def _from_buffer(builder: Builder, call: StandIn) -> np.ndarray:
    data, dtype, shape, order, *axes = call.args
    if order not in ("C", "F", "K"):
        raise NotPlainError(f"an array in order {short(order)}")
    array = array_of(_dtype(dtype), builder.build(shape), builder.build(data), "F" if order == "F" else "C")
    if order == "K" and axes and axes[0] is not None:
        array = array.transpose(builder.build(axes[0]))
    return array


def _scalar(builder: Builder, call: StandIn) -> Any:
    dtype, data = call.args
    if _dtype(dtype).kind == "O":
        raise NotPlainError("a number that is an object")
    return array_of(_dtype(dtype), (), builder.build(data), "C")[()]


_KINDS: tuple[type, ...] = (dict, list, tuple, set, frozenset)
MAKERS: dict[str, Callable[[Builder, StandIn], Any] | None] = {
    "numpy.core.multiarray._reconstruct": _reconstructed,
    "numpy.core.multiarray.scalar": _scalar,
    "numpy.core.numeric._frombuffer": _from_buffer,
    "numpy.ndarray": None,
    "numpy.dtype": None,
    "_codecs.encode": _encoded,
    "collections.OrderedDict": _container(OrderedDict),
    **{f"builtins.{kind.__name__}": _container(kind) for kind in _KINDS},
    **{f"builtins.{kind.__name__}": _plain(kind) for kind in (bytes, bytearray, str, int, float, complex, bool)},
}
"""Names that a pickle may contain, each with the function that builds its data. None: the name alone is no data."""
