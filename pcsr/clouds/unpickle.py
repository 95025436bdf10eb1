"""Reading the pickles that others store data in, without running what they ask for.

A pickle is a program: it names callables and says what to call them with. Here no name stands for the real
thing. Each becomes a stand-in that only writes down how it was called, and once the program has ended, plain
containers and numeric arrays are built from those notes. Whatever else it names is refused before anything
is called.
"""

import math
import pickle  # noqa: TID251  (the one place: a subclass that never looks a name up; recorded touches are pickles)
import re
import warnings
from collections import OrderedDict
from collections.abc import Callable, Collection
from io import BytesIO
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pcsr.errors import UserError

DEEPEST = 32
"""Tuples may be nested so far. Hashing a deeper one could overflow the stack of the interpreter itself."""
LARGEST = 10**7
"""So many items may a tuple hold with all that is nested in it, each as often as it is there: hashing visits all."""
DTYPE = re.compile(r"(b1|[iufc]\d{1,2}|[SU]\d{1,9}|O8?|\?)")
"""The types of arrays that are built. No records and no dates: nobody records touches in them."""
ENCODINGS = ("latin1", "latin-1", "iso-8859-1")


class Inert:
    """Stands where a pickle held an object of a class that was named harmless; it holds nothing."""

    def __init__(self, name: str) -> None:
        """Remember what it stands for.

        Args:
            name: of the class.
        """
        self.name = name

    def __repr__(self) -> str:
        return f"Inert({self.name!r})"


class _StandIn:
    """What a pickle gets for a name. Calling it makes a note of the call, and nothing else."""

    name: ClassVar[str]
    inert: ClassVar[bool]
    args: tuple[Any, ...]
    state: Any
    entries: list[tuple[Any, Any]]

    def __new__(cls, *args: Any, **kwargs: Any) -> "_StandIn":
        if kwargs and not cls.inert:
            raise ValueError(f"{cls.name} is called with keywords")
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
        self.entries.append((None, value))


class _Reader(pickle._Unpickler):
    """The pure Python unpickler, as the other one overflows the stack and reserves memory that no file fills."""

    dispatch: ClassVar[dict[int, Callable[..., None]]] = {
        code: load
        for code, load in pickle._Unpickler.dispatch.items()
        if code not in (pickle.EXT1[0], pickle.EXT2[0], pickle.EXT4[0])  # their cache bypasses find_class
    }

    def __init__(self, data: bytes, path: Path, inert: Collection[str]) -> None:
        super().__init__(BytesIO(data), encoding="latin1")
        self.path, self.harmless = path, tuple(inert)
        self.names: dict[str, type[_StandIn]] = {}
        self.nested: dict[int, tuple[int, int, Any]] = {}

    def find_class(self, module: str, name: str) -> type[_StandIn]:
        full = f"{module}.{name}".replace("__builtin__.", "builtins.").replace("numpy._core.", "numpy.core.")
        inert = any(full == one or full.startswith(f"{one}.") for one in self.harmless)
        if not inert and full not in MAKERS:
            raise UserError(
                f"{self.path} asks to run `{module}.{name}`, which a data file has no need for: it was not run; "
                f"ask whoever made the file for plain arrays"
            )
        if full not in self.names:
            self.names[full] = type("_Named", (_StandIn,), {"name": full, "inert": inert})
        return self.names[full]

    def weigh(self, made: Any) -> None:
        """Refuse tuples that nest too deeply or are too large, as they could not be hashed."""
        inner = [self.nested.get(id(one), (1, len(one), one)) for one in made if isinstance(one, tuple)]
        depth = 1 + max((deep for deep, _, _ in inner), default=0)
        size = len(made) + sum(large for _, large, _ in inner)
        if depth > DEEPEST or size > LARGEST:
            raise UserError(
                f"{self.path} nests tuples {depth} deep with {size} items in all: no data file needs more than "
                f"{DEEPEST} and {LARGEST}"
            )
        if depth > 1:
            self.nested[id(made)] = (depth, size, made)  # kept alive, so that its id stays its own


def _weighed(load: Callable[..., None]) -> Callable[[_Reader], None]:
    def weighed(reader: _Reader) -> None:
        load(reader)
        reader.weigh(reader.stack[-1])  # type: ignore[attr-defined]

    return weighed


for _code in (pickle.TUPLE, pickle.TUPLE1, pickle.TUPLE2, pickle.TUPLE3):
    _Reader.dispatch[_code[0]] = _weighed(_Reader.dispatch[_code[0]])


class _Builder:
    """Turns the notes into data. Each object is built once, however often it is referred to."""

    def __init__(self) -> None:
        self.built: dict[int, Any] = {}
        self.under_way: set[int] = set()

    def build(self, node: Any) -> Any:
        if node is None or isinstance(node, bool | int | float | complex | str | bytes | bytearray):
            return node
        if id(node) in self.built:
            return self.built[id(node)]
        if id(node) in self.under_way:
            raise ValueError("a container holds itself")
        self.under_way.add(id(node))
        self.built[id(node)] = made = self._make(node)
        self.under_way.discard(id(node))
        return made

    def _make(self, node: Any) -> Any:
        if isinstance(node, dict):
            return {self.build(key): self.build(value) for key, value in node.items()}
        if isinstance(node, list | tuple | set | frozenset):
            return type(node)(self.build(one) for one in node)
        named = node if isinstance(node, type) else type(node)
        if not issubclass(named, _StandIn):
            raise ValueError(f"it holds a {named.__name__}")
        if named.inert:
            return Inert(named.name)
        maker = MAKERS[named.name]
        if isinstance(node, type) or maker is None:
            raise ValueError(f"it holds {named.name} itself, not data")
        if node.entries and named.name != "collections.OrderedDict":
            raise ValueError(f"{named.name} is filled like a container")
        return maker(self, node)


def _encoded(builder: _Builder, call: _StandIn) -> bytes:
    """How protocols before 3 write bytes."""
    text, *rest = builder.build(call.args)
    if not isinstance(text, str) or not rest or rest[0] not in ENCODINGS:
        raise ValueError(f"text in another encoding than latin1: {rest}")
    return text.encode("latin1")


def _container(kind: Callable[..., Any]) -> Callable[[_Builder, _StandIn], Any]:
    def make(builder: _Builder, call: _StandIn) -> Any:
        args = builder.build(call.args)
        if len(args) > 1 or not all(isinstance(one, list | tuple | dict | set | frozenset) for one in args):
            raise ValueError(f"{call.name} of something that is no container")
        made = kind(*args)
        for key, value in call.entries:
            made[builder.build(key)] = builder.build(value)
        return made

    return make


def _plain(kind: Callable[..., Any]) -> Callable[[_Builder, _StandIn], Any]:
    def make(builder: _Builder, call: _StandIn) -> Any:
        args = builder.build(call.args)
        # A whole number would be a size to bytes, and the text of a container may be endless.
        allowed = (str, bytes) if kind in (bytes, bytearray) else (int, float, str, bytes)
        if not all(isinstance(one, allowed) for one in args):
            raise ValueError(f"{call.name} of something that is no plain value")
        return kind(*args)

    return make


def _dtype(note: Any) -> np.dtype[Any]:
    """The type of an array's items; made of its name and byte order alone."""
    if not isinstance(note, _StandIn) or note.name != "numpy.dtype" or not note.args:
        raise ValueError("an array without a dtype")
    name, state = note.args[0], note.state
    if not isinstance(name, str) or not DTYPE.fullmatch(name):
        raise ValueError(f"an array of dtype {name!r}")
    dtype = np.dtype(name)
    if state is not None:
        known = isinstance(state, tuple) and len(state) >= 8 and state[0] in (3, 4) and state[1] in ("<", ">", "|", "=")
        if not known or any(part is not None for part in state[2:5]):
            raise ValueError(f"a dtype {name!r} of an unknown form")
        dtype = dtype.newbyteorder(state[1])
    if dtype.itemsize == 0:
        raise ValueError(f"an array of dtype {name!r}, whose items have no size")
    return dtype


def _array(dtype: np.dtype[Any], shape: Any, data: Any, order: Any) -> np.ndarray:
    """An array of `data`, which must be exactly as much as `shape` takes."""
    if not isinstance(shape, tuple) or not all(isinstance(n, int) and n >= 0 for n in shape):
        raise ValueError(f"an array of shape {shape!r}")
    count = math.prod(shape)
    if dtype.kind == "O":
        if not isinstance(data, list) or len(data) != count:
            raise ValueError(f"an array of shape {shape} without its {count} objects")
        objects = np.full(count, None, object)
        for index, one in enumerate(data):
            objects[index] = one
        return objects.reshape(shape, order=order)
    if isinstance(data, str):  # Python 2 had no bytes
        data = data.encode("latin1")
    if not isinstance(data, bytes | bytearray) or len(data) != count * dtype.itemsize:
        raise ValueError(f"an array of shape {shape} and dtype {dtype.str} without its {count * dtype.itemsize} bytes")
    if count == 0:
        return np.zeros(shape, dtype)
    if dtype.kind == "b":
        return np.not_equal(np.frombuffer(data, np.uint8), 0).reshape(shape, order=order)
    flat = np.frombuffer(data, dtype).copy()
    if dtype.kind == "U" and flat.view(np.dtype("u4").newbyteorder(dtype.byteorder)).max() > 0x10FFFF:
        raise ValueError("an array of text that is none")
    return flat.reshape(shape, order=order)


def _reconstructed(builder: _Builder, call: _StandIn) -> np.ndarray:
    of = call.args[0] if call.args else None
    if not (isinstance(of, type) and issubclass(of, _StandIn) and of.name == "numpy.ndarray"):
        raise ValueError("an array of an unknown class")
    if not isinstance(call.state, tuple) or len(call.state) not in (4, 5):
        raise ValueError("an array without data")
    shape, dtype, fortran, data = call.state[-4:]
    return _array(_dtype(dtype), builder.build(shape), builder.build(data), "F" if fortran else "C")


def _from_buffer(builder: _Builder, call: _StandIn) -> np.ndarray:
    data, dtype, shape, order, *axes = call.args
    if order not in ("C", "F", "K"):
        raise ValueError(f"an array in order {order!r}")
    array = _array(_dtype(dtype), builder.build(shape), builder.build(data), "F" if order == "F" else "C")
    if order == "K" and axes and axes[0] is not None:
        array = array.transpose(builder.build(axes[0]))
    return array


def _scalar(builder: _Builder, call: _StandIn) -> Any:
    dtype, data = call.args
    if _dtype(dtype).kind == "O":
        raise ValueError("a number that is an object")
    return _array(_dtype(dtype), (), builder.build(data), "C")[()]


_KINDS: tuple[type, ...] = (dict, list, tuple, set, frozenset)
MAKERS: dict[str, Callable[[_Builder, _StandIn], Any] | None] = {
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
"""All that a pickle may name, and what makes data of its notes; None: a name that is data of nothing by itself."""


def _unpickled(data: bytes, path: Path, inert: Collection[str]) -> Any:
    try:
        return _Builder().build(_Reader(data, path, inert).load())
    except UserError:
        raise
    except Exception as error:  # a malformed program trips over anything, memory and recursion included
        reason = "it ends too early" if isinstance(error, EOFError) else str(error) or type(error).__name__
        raise UserError(
            f"{path} cannot be read as a pickle of plain data: {reason}; get the file again, or as plain arrays"
        ) from error


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror or error}") from error


def load_pickle(path: Path, inert: Collection[str] = ()) -> Any:
    """The plain data of a pickle: containers, numbers, text, and numeric arrays, whatever Python wrote it.

    Args:
        path: the file.
        inert: classes, or modules with all that is in them, whose objects become an empty `Inert`.

    Raises:
        UserError: the file is not there, is damaged, or asks for anything but data.
    """
    return _unpickled(_bytes(path), path, inert)


def load_numpy(path: Path, inert: Collection[str] = ()) -> Any:
    """The array of an .npy file, of objects too; an array of no dimension that holds an object gives the object.

    Args:
        path: the file.
        inert: as for `load_pickle`.

    Raises:
        UserError: the file is not there, is damaged, holds records, or asks for anything but data.
    """
    file = BytesIO(_bytes(path))
    try:
        shape, fortran, dtype = _header(file)
    except Exception as error:  # the header is a Python literal: a malformed one trips over anything
        raise UserError(f"{path} cannot be read as an .npy file: {error}; get the file again") from error
    if not dtype.hasobject and dtype.kind in "biufcSU" and dtype.itemsize > 0:
        try:
            return _array(dtype, shape, file.read(), "F" if fortran else "C")
        except (ValueError, MemoryError) as error:
            raise UserError(f"{path} is cut off or damaged: it holds {error}; get the file again") from error
    if dtype != np.dtype(object):
        raise UserError(f"{path} holds items of dtype {dtype}: arrays of numbers, text or objects are read")
    array = _unpickled(file.read(), path, inert)
    if not isinstance(array, np.ndarray) or array.dtype != dtype or array.size != math.prod(shape):
        raise UserError(f"{path} is damaged: it says that it holds objects of shape {shape}, and does not")
    return array.reshape(shape).item() if shape == () else array.reshape(shape)


def _header(file: BytesIO) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that Python 2 wrote it
        version = np.lib.format.read_magic(file)
        readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        if version not in readers:
            raise ValueError(f"its version {version} is not known")
        header: tuple[tuple[int, ...], bool, np.dtype[Any]] = readers[version](file)
        return header
