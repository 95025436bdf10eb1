"""Warnings of pcsr as lines of their own, without those of other libraries."""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

from pcsr.errors import PcsrWarning

if TYPE_CHECKING:
    from rich.console import Console


@contextmanager
def yellow_warnings(console: "Console") -> Iterator[None]:
    """Print pcsr's warnings as yellow lines after the block, and before an error that ends it."""
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always", PcsrWarning)
        try:
            yield
        finally:
            for one in warned:
                if issubclass(one.category, PcsrWarning):
                    console.print(str(one.message), style="yellow", markup=False, soft_wrap=True)


@contextmanager
def yellow_warnings_at_once(console: "Console") -> Iterator[None]:
    """Print pcsr's warnings as yellow lines when they arise, since the block may take hours."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", PcsrWarning)
        warnings.showwarning = own_warnings_by(
            lambda text: console.print(text, style="yellow", markup=False, soft_wrap=True)
        )
        yield


def own_warnings_by(put: Callable[[str], None]) -> Callable[..., None]:
    """Return a function in place of `warnings.showwarning` that gives the texts of pcsr's warnings alone to `put`."""

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,  # noqa: ARG001 the signature of `warnings.showwarning`
        lineno: int,  # noqa: ARG001
        file: TextIO | None = None,  # noqa: ARG001
        line: str | None = None,  # noqa: ARG001
    ) -> None:
        if issubclass(category, PcsrWarning):
            put(str(message))

    return show
