"""Reading the pickles that others store data in, without running what they ask for.

A pickle is a program: it names callables and says what to call them with. Here no name stands for the real
thing. Each becomes a stand-in that only writes down how it was called, and once the program has ended, plain
containers and numeric arrays are built from those notes. Whatever else it names is refused before anything
is called.
"""

import math
import pickle  # noqa: TID251  (the one place: a subclass that never looks a name up; recorded touches are pickles)
import textwrap
from collections.abc import Callable, Collection
from io import BytesIO
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pcsr.clouds.npy import read_header
from pcsr.errors import UserError
from pcsr.inputs import read_bytes
from pcsr.recorded.pickles.rebuild import MAKERS, Builder, Inert, StandIn, array_of

__all__ = ["Inert", "load_numpy", "load_pickle"]

DEEPEST = 32
"""Tuples may be nested so far. Hashing a deeper one could overflow the stack of the interpreter itself."""
LARGEST_PICKLE = 1 << 28
"""Bytes of the largest pickle: 256 MiB."""
STEPS = 10**6
"""Steps of the longest pickle, each of which may make an object; arrays are one step, whatever their size."""
LARGEST = 10**7
"""So many items may a tuple hold with all that is nested in it, each as often as it is there: hashing visits all."""


class _Counted(dict[int, Callable[..., None]]):
    """What each code of a pickle does, as long as there are not too many of them."""

    left = STEPS

    def __getitem__(self, code: int) -> Callable[..., None]:
        self.left -= 1
        if self.left < 0:
            raise ValueError(f"it has more than {STEPS} steps, and no data file needs as many")
        return super().__getitem__(code)


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
        self.dispatch = _Counted(_Reader.dispatch)  # type: ignore[misc]
        self.names: dict[str, type[StandIn]] = {}
        self.nested: dict[int, tuple[int, int, Any]] = {}

    def find_class(self, module: str, name: str) -> type[StandIn]:
        full = f"{module}.{name}".replace("__builtin__.", "builtins.").replace("numpy._core.", "numpy.core.")
        inert = any(full == one or full.startswith(f"{one}.") for one in self.harmless)
        if not inert and full not in MAKERS:
            raise UserError(
                f"{self.path} asks to run `{module}.{name}`, which a data file has no need for: it was not run; "
                f"ask whoever made the file for plain arrays"
            )
        if full not in self.names:
            self.names[full] = type("_Named", (StandIn,), {"name": full, "inert": inert})
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


def _unpickled(data: bytes, path: Path, inert: Collection[str]) -> Any:
    try:
        return Builder().build(_Reader(data, path, inert).load())
    except UserError:
        raise
    except Exception as error:  # a malformed program trips over anything, memory and recursion included
        reason = "it ends too early" if isinstance(error, EOFError) else str(error) or type(error).__name__
        reason = "it is nested too deeply" if isinstance(error, RecursionError) else textwrap.shorten(reason, 200)
        raise UserError(
            f"{path} cannot be read as a pickle of plain data: {reason}; get the file again, or as plain arrays"
        ) from error


def load_pickle(path: Path, inert: Collection[str] = ()) -> Any:
    """The plain data of a pickle: containers, numbers, text, and numeric arrays, whatever Python wrote it.

    Args:
        path: the file.
        inert: classes, or modules with all that is in them, whose objects become an empty `Inert`.

    Raises:
        UserError: the file is not there, is damaged, or asks for anything but data.
    """
    return _unpickled(read_bytes(path, most=LARGEST_PICKLE), path, inert)


def load_numpy(path: Path, inert: Collection[str] = ()) -> Any:
    """The array of an .npy file, of objects too; an array of no dimension that holds an object gives the object.

    Args:
        path: the file.
        inert: as for `load_pickle`.

    Raises:
        UserError: the file is not there, is damaged, holds records, or asks for anything but data.
    """
    file = BytesIO(read_bytes(path))
    try:
        shape, fortran, dtype = read_header(file)
    except UserError as error:
        raise UserError(f"{path} cannot be read as an .npy file: {error}") from error
    if not dtype.hasobject and dtype.kind in "biufcSU" and dtype.itemsize > 0:
        try:
            return array_of(dtype, shape, file.read(), "F" if fortran else "C")
        except (ValueError, MemoryError) as error:
            raise UserError(f"{path} is cut off or damaged: it holds {error}; get the file again") from error
    if dtype != np.dtype(object):
        raise UserError(f"{path} holds items of dtype {dtype}: arrays of numbers, text or objects are read")
    data = file.read(LARGEST_PICKLE + 1)
    if len(data) > LARGEST_PICKLE:
        raise UserError(f"{path} holds objects in more than {LARGEST_PICKLE} bytes: ask for plain arrays")
    array = _unpickled(data, path, inert)
    if not isinstance(array, np.ndarray) or array.dtype != dtype or array.size != math.prod(shape):
        raise UserError(f"{path} is damaged: it says that it holds objects of shape {shape}, and does not")
    return array.reshape(shape).item() if shape == () else array.reshape(shape)
