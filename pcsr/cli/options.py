"""Options that several commands share."""

import functools
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from pcsr.errors import UserError

Result = TypeVar("Result")


class _File(click.Path):
    """A path that a file can have.

    An empty one, such as an unset variable of a shell gives, is a mistake and not the folder we are in.
    """

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse a path that no file can have: to look for it would be an error of many kinds."""
        text = os.fspath(value)
        if text == "":
            self.fail("it is empty: name a file or folder", param, ctx)
        if "\0" in text:
            self.fail(f"{text[:40]!r}: names of files hold no NUL", param, ctx)
        longest = max(len(os.fsencode(part)) for part in Path(text).parts or [text])
        if longest > LONGEST_NAME or len(text) > LONGEST_PATH:
            self.fail(f"'{text[:40]}…' is longer than any name of a file: shorten it", param, ctx)
        return super().convert(value, param, ctx)


LONGEST_NAME = 255
"""Bytes of the name of a file or folder, on all common file systems."""
LONGEST_PATH = 4096
"""Characters of a path; Linux takes no more."""
FILE = _File(path_type=Path)
"""The type of every path that a command takes."""


class _Plugin(_File):
    """A Python file that is there."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse a plugin that isn't there, whether the command comes to need it or not."""
        path = super().convert(value, param, ctx)
        if not os.path.isfile(path):
            raise UserError(
                f"--plugin {path}: {'that is a folder' if os.path.isdir(path) else 'there is no such file'}"
            )
        return path


PLUGIN = _Plugin(path_type=Path)
"""The type of `--plugin`."""


def plugin_option(command: Callable[..., Result]) -> Callable[..., Result]:
    """Give a command `--plugin FILE` and hand it the parts as `registry`, a `pcsr.plugins.registry.Registry`.

    A warning names each file that fails to load: whoever gives one wants its parts.
    """
    return _with_plugins(command, files_win=False, warn=True)


def listed_plugin_option(command: Callable[..., Result]) -> Callable[..., Result]:
    """As `plugin_option`, for a command that shows which plugins fail to load."""
    return _with_plugins(command, files_win=False, warn=False)


def winning_plugin_option(command: Callable[..., Result]) -> Callable[..., Result]:
    """As `listed_plugin_option`; a part of a file takes the place of an installed one of the same name."""
    return _with_plugins(command, files_win=True, warn=False)


def _with_plugins(command: Callable[..., Result], *, files_win: bool, warn: bool) -> Callable[..., Result]:

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
        from pcsr.plugins.loading import load_plugins, warn_of_failures

        registry = load_plugins(plugin_files, files_win=files_win)
        if warn:
            warn_of_failures(registry)
        return command(*args, registry=registry, **kwargs)

    return with_registry


def _jobs(_ctx: click.Context, _param: click.Parameter, value: int | None) -> int | None:
    from pcsr.workers import check_jobs

    check_jobs(value)
    return value


def jobs_option(text: str) -> Callable[[Callable[..., Result]], Callable[..., Result]]:
    """Give a command `--jobs N`, a number of processes that a pool can have; `text` is its help."""
    return click.option("--jobs", type=int, default=None, metavar="N", callback=_jobs, help=text)


class _Seconds(click.FloatRange):
    """A number of seconds; `nan` is in no range, and click does not see it."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse what is no number."""
        seconds = super().convert(value, param, ctx)
        if math.isnan(seconds):
            self.fail(f"{value} is no number of seconds", param, ctx)
        return seconds


SECONDS = _Seconds(0.1, 86_400)
"""The type of a limit of time: up to a day."""

set_option = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Change a recipe's value: --set train.epochs=5. The value is YAML. May be repeated.",
)
"""Gives a command `overrides`, as `pcsr.recipe.load` takes them."""
