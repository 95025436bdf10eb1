"""Options that several commands share."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

Result = TypeVar("Result")


def plugin_option(command: Callable[..., Result]) -> Callable[..., Result]:
    """Give a command `--plugin FILE` and hand it the parts as `registry`, a `pcsr.registry.Registry`."""
    return _with_plugins(command, files_win=False)


def winning_plugin_option(command: Callable[..., Result]) -> Callable[..., Result]:
    """As `plugin_option`; a part of a file takes the place of an installed one of the same name."""
    return _with_plugins(command, files_win=True)


def _with_plugins(command: Callable[..., Result], *, files_win: bool) -> Callable[..., Result]:

    @click.option(
        "--plugin",
        "plugin_files",
        multiple=True,
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="Load parts from this Python file too. May be repeated.",
    )
    @functools.wraps(command)
    def with_registry(*args: object, plugin_files: tuple[Path, ...], **kwargs: object) -> Result:
        from pcsr.plugins import load_plugins

        return command(*args, registry=load_plugins(plugin_files, files_win=files_win), **kwargs)

    return with_registry


class _File(click.Path):
    """A path; an empty one, such as an unset variable of a shell gives, is a mistake and not the folder we are in."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse an empty path."""
        if str(value) == "":
            self.fail("it is empty: name a file or folder", param, ctx)
        return super().convert(value, param, ctx)


FILE = _File(path_type=Path)
"""The type of every path that a command takes."""

set_option = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Change a recipe's value: --set train.epochs=5. The value is YAML. May be repeated.",
)
"""Gives a command `overrides`, as `pcsr.recipe.load` takes them."""
