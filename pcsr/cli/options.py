"""Click types, options and shell completions that several commands share."""

import functools
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click
from click.shell_completion import CompletionItem

from pcsr.errors import UserError

Result = TypeVar("Result")


class _File(click.Path):
    """Click type of the path of a file or folder.

    An empty path, such as an unset variable of the shell gives, is refused; it does not mean the current folder.
    """

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse an empty path, and one that no file can have."""
        text = os.fspath(value)
        if text == "":
            self.fail("it is empty: name a file or folder", param, ctx)
        if "\0" in text:
            self.fail(f"{text[:40]!r}: a path must not contain a NUL character", param, ctx)
        longest = max(len(os.fsencode(part)) for part in Path(text).parts or [text])
        if longest > LONGEST_NAME or len(text) > LONGEST_PATH:
            self.fail(f"'{text[:40]}…' is longer than a path can be: shorten it", param, ctx)
        return super().convert(value, param, ctx)


LONGEST_NAME = 255
"""Greatest length of a file's or folder's name in bytes, on all common file systems."""
LONGEST_PATH = 4096
"""Greatest length of a path in characters, on Linux."""
FILE = _File(path_type=Path)
"""Click type of every path that a command takes."""


class _OutputFolder(_File):
    """Click type of a folder to write to, which need not exist yet."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse a path at which, or above which, there is a file."""
        path: Path = super().convert(value, param, ctx)
        there = next((one for one in (path, *path.parents) if os.path.lexists(one)), Path())
        if not os.path.isdir(there):
            self.fail(f"'{there}' is a file: name a folder", param, ctx)
        return path


OUTPUT_FOLDER = _OutputFolder(path_type=Path)
"""Click type of every folder that a command writes to."""


class _Plugin(_File):
    """Click type of an existing Python file."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse a path at which there is no file."""
        path = super().convert(value, param, ctx)
        if not os.path.isfile(path):
            raise UserError(
                f"--plugin {path}: {'that is a folder' if os.path.isdir(path) else 'there is no such file'}"
            )
        return path


PLUGIN = _Plugin(path_type=Path)
"""Click type of `--plugin`."""


def plugin_option(command: Callable[..., Result]) -> Callable[..., Result]:
    """Add `--plugin FILE` to a command, and pass it a `pcsr.plugins.registry.Registry` as `registry`.

    A file that fails to load ends the command.
    """
    return _with_plugins(command, files_win=False, check=True)


def listed_plugin_option(command: Callable[..., Result]) -> Callable[..., Result]:
    """Do as `plugin_option`, without an error: for commands that list the plugins that fail to load themselves."""
    return _with_plugins(command, files_win=False, check=False)


def winning_plugin_option(command: Callable[..., Result]) -> Callable[..., Result]:
    """Do as `listed_plugin_option`, and let a file's part replace an installed part of the same name."""
    return _with_plugins(command, files_win=True, check=False)


def _with_plugins(command: Callable[..., Result], *, files_win: bool, check: bool) -> Callable[..., Result]:

    @click.option(
        "--plugin",
        "plugin_files",
        multiple=True,
        type=PLUGIN,
        metavar="FILE",
        help="Load parts from this Python file too. May be repeated.",
    )
    @functools.wraps(command)
    def with_registry(*args: object, plugin_files: tuple[Path, ...], **kwargs: object) -> Result:
        from pcsr.plugins.loading import check_loaded, load_plugins

        registry = load_plugins(plugin_files, files_win=files_win)
        if check:
            check_loaded(registry)
        return command(*args, registry=registry, **kwargs)

    return with_registry


def _jobs(_ctx: click.Context, _param: click.Parameter, value: int | None) -> int | None:
    from pcsr.workers import check_jobs

    check_jobs(value)
    return value


def jobs_option(text: str) -> Callable[[Callable[..., Result]], Callable[..., Result]]:
    """Return a decorator that adds `--jobs N`, a number of processes; `text` is its help."""
    return click.option("--jobs", type=int, default=None, metavar="N", callback=_jobs, help=text)


class Number(click.FloatRange):
    """Click type of a number within a range. It refuses `nan`, which `click.FloatRange` accepts."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number, within the range."""
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value} is not a number", param, ctx)
        return number


SECONDS = Number(0.1, 86_400)
"""Click type of a time limit: 0.1 s to one day."""
MILLIMETRES = Number(0, 1000, min_open=True)
"""Click type of a length on a sensor."""

set_option = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Set a value of the recipe, such as train.epochs=5. The value is YAML. May be repeated.",
)
"""Option `--set`, which passes `overrides` to a command, as `pcsr.recipe.load` takes them."""


columns_option = click.option(
    "--columns",
    default=None,
    metavar="NAMES",
    help="Names of the columns of text files: x,y,z,red,green,blue. A column that is called - is left out.",
)
"""Option `--columns`, which passes `columns` to a command, as `pcsr.clouds.formats.read_cloud` takes them."""


def complete_part(kind: str) -> Callable[[click.Context, click.Parameter, str], list[str]]:
    """Return a shell completion for the names of the parts of one kind."""

    def complete(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[str]:
        from pcsr.plugins.loading import load_plugins

        return [name for name in load_plugins().names(kind) if name.startswith(incomplete)]

    return complete


def complete_weights(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Complete the names of the weights that come with pcsr, or else paths."""
    from pcsr import weights

    names = [CompletionItem(name) for name in weights.names() if name.startswith(incomplete)]
    return names or [CompletionItem(incomplete, type="file")]


def complete_metric(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[str]:
    """Complete the names of metrics."""
    from pcsr.metrics import METRICS

    return [name for name in METRICS if name.startswith(incomplete)]
