"""Reading of pickles without running the code that they name.

A pickle is a program: it names callables, and calls them. This interpreter replaces each callable by a stand-in that
only records its calls. Afterwards plain containers and numeric arrays are built from the recorded calls. A pickle that
names anything else is refused.
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
from pcsr.recorded.pickles.rebuild import MAKERS, Builder, Inert, NotPlainError, StandIn, array_of

__all__ = ["Inert", "load_numpy", "load_pickle"]

DEEPEST = 32
"""Greatest depth of nested tuples. Hashing deeper ones could overflow Python's stack."""
LARGEST_PICKLE = 1 << 28
"""Greatest size of a pickle in bytes: 256 MiB."""
MOST_STEPS = 10**6
"""Greatest number of steps of a pickle. Each may create an object; an array is one step, whatever its size."""
LARGEST_TUPLE = 10**7
"""Greatest number of items of a tuple, including those of nested tuples at each occurrence, as hashing visits them."""


class _Counted(dict[int, Callable[..., None]]):
    """Handlers of a pickle's opcodes, which refuse a pickle of more than `MOST_STEPS` steps."""

    left = MOST_STEPS

    def __getitem__(self, code: int) -> Callable[..., None]:
        self.left -= 1
        if self.left < 0:
            raise NotPlainError(f"it has more than {MOST_STEPS} steps, which no data file needs")
        return super().__getitem__(code)


class _Reader(pickle._Unpickler):
    """Restricted unpickler, based on Python's own; the one in C can overflow the stack and allocate any memory."""

    dispatch: ClassVar[dict[int, Callable[..., None]]] = {
        code: load
        for code, load in pickle._Unpickler.dispatch.items()
        if code not in (pickle.EXT1[0], pickle.EXT2[0], pickle.EXT4[0])  # cached extensions bypass `find_class`
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
                f"ask the author of the file for plain arrays"
            )
        if full not in self.names:
            self.names[full] = type("_Named", (StandIn,), {"name": full, "inert": inert})
        return self.names[full]

    def persistent_load(self, pid: Any) -> Any:
        raise NotPlainError("it refers to a persistent object, which is not in the file")

    def check_tuple(self, value: Any) -> None:
        """Check that a tuple is neither too deep nor too large to be hashed.

        Raises:
            UserError: it is nested deeper than `DEEPEST`, or has more than `LARGEST_TUPLE` items.
        """
        inner = [self.nested.get(id(one), (1, len(one), one)) for one in value if isinstance(one, tuple)]
        depth = 1 + max((inner_depth for inner_depth, _, _ in inner), default=0)
        size = len(value) + sum(inner_size for _, inner_size, _ in inner)
        if depth > DEEPEST or size > LARGEST_TUPLE:
            raise UserError(
                f"{self.path} nests tuples {depth} deep with {size} items in all: no data file needs more than "
                f"{DEEPEST} and {LARGEST_TUPLE}"
            )
        if depth > 1:
            self.nested[id(value)] = (depth, size, value)  # the reference keeps the id from being reused


def _checked(load: Callable[..., None]) -> Callable[[_Reader], None]:
    def load_and_check(reader: _Reader) -> None:
        load(reader)
        reader.check_tuple(reader.stack[-1])  # type: ignore[attr-defined]

    return load_and_check


for _code in (pickle.TUPLE, pickle.TUPLE1, pickle.TUPLE2, pickle.TUPLE3):
    _Reader.dispatch[_code[0]] = _checked(_Reader.dispatch[_code[0]])


def _unpickled(data: bytes, path: Path, inert: Collection[str]) -> Any:
    try:
        return Builder().build(_Reader(data, path, inert).load())
    except UserError:
        raise
    except Exception as error:  # a malformed pickle may raise any error, MemoryError and RecursionError included
        raise UserError(
            f"{path} cannot be read as a pickle of plain data: {_fault(data, error)}; get the file again, or as plain "
            f"arrays"
        ) from error


def _fault(data: bytes, error: Exception) -> str:
    """Return what is wrong with a pickle that raised an error."""
    if isinstance(error, NotPlainError):
        return textwrap.shorten(str(error), 200)
    if isinstance(error, EOFError):
        return "it ends too early"
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    if data[:1] == pickle.PROTO and data[1:2] > bytes([pickle.HIGHEST_PROTOCOL]):
        return f"its protocol is {data[1]}, and those up to {pickle.HIGHEST_PROTOCOL} are known"
    return "it is damaged, or no pickle"


def load_pickle(path: Path, inert: Collection[str] = ()) -> Any:
    """Read the plain data of a pickle, of any Python version: containers, numbers, text and numeric arrays.

    Args:
        path: file of the pickle.
        inert: full names of classes, or of modules for all their classes, whose objects become an empty `Inert`.

    Raises:
        UserError: the file does not exist, is damaged, or contains anything but plain data.
    """
    return _unpickled(read_bytes(path, most=LARGEST_PICKLE), path, inert)


def load_numpy(path: Path, inert: Collection[str] = ()) -> Any:
    """Read the array of an .npy file, which may have the dtype object.

    Args:
        path: file of the array.
        inert: full names of classes, or of modules for all their classes, whose objects become an empty `Inert`.

    Returns:
        The array, or the object itself if the file holds an object array without dimensions.

    Raises:
        UserError: the file does not exist, is damaged, holds records, or contains anything but plain data.
    """
    file = BytesIO(read_bytes(path))
    try:
        shape, fortran, dtype = read_header(file)
    except UserError as error:
        raise UserError(f"{path} cannot be read as an .npy file: {error}") from error
    if not dtype.hasobject and dtype.kind in "biufcSU" and dtype.itemsize > 0:
        try:
            return array_of(dtype, shape, file.read(), "F" if fortran else "C")
        except NotPlainError as error:
            raise UserError(f"{path} is cut off or damaged: it holds {error}; get the file again") from error
        except MemoryError as error:
            raise UserError(f"{path} cannot be read: it needs more memory than is free") from error
    if dtype != np.dtype(object):
        raise UserError(f"{path} holds items of dtype {dtype}: only arrays of numbers, text or objects are read")
    data = file.read(LARGEST_PICKLE + 1)
    if len(data) > LARGEST_PICKLE:
        raise UserError(f"{path} holds objects in more than {LARGEST_PICKLE} bytes: ask its author for plain arrays")
    array = _unpickled(data, path, inert)
    if not isinstance(array, np.ndarray) or array.dtype != dtype or array.size != math.prod(shape):
        raise UserError(f"{path} is damaged: it does not hold objects of shape {shape}, as its header says")
    return array.reshape(shape).item() if shape == () else array.reshape(shape)
