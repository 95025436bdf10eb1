"""The command line: `pcsr COMMAND`. A command's module is imported when the command is called, not before."""

# isort: off
from pcsr.cli import interrupt  # before all that takes its time

# isort: on
import errno
import importlib
import os
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import distributions
from typing import Any, NamedTuple, TextIO

import click

from pcsr import __version__
from pcsr.cli import streams
from pcsr.errors import PcsrError, PcsrWarning, RunError, UserError, did_you_mean

GROUP = "pcsr.commands"
"""The entry-point group in which plugins announce commands: `name = "module:click_command"`."""


class BuiltIn(NamedTuple):
    """A command of ours: where it is, and the line that stands for it in `pcsr --help`."""

    target: str
    summary: str


COMMANDS = {
    "upsample": BuiltIn("pcsr.cli.upsample:upsample", "Make a cloud dense and write it."),
    "evaluate": BuiltIn("pcsr.cli.evaluate:evaluate", "Measure a cloud beside the true one."),
    "view": BuiltIn("pcsr.cli.view:view", "Open a window with clouds side by side."),
    "export": BuiltIn("pcsr.cli.export:export", "Write a network as ONNX, or its weights."),
    "run": BuiltIn("pcsr.cli.run:run", "Train and evaluate a recipe, or compare several."),
    "compare": BuiltIn("pcsr.cli.compare:compare", "Train and measure recipes, or one with several parts, alike."),
    "figures": BuiltIn("pcsr.cli.figures:figures", "Draw the pictures of runs as PNG files."),
    "data": BuiltIn("pcsr.cli.data:data", "Build data sets of clouds and touches, and say what they hold."),
    "touch": BuiltIn("pcsr.cli.touch:touch", "Simulate touches on a mesh and write them as a recording."),
    "recipe": BuiltIn("pcsr.cli.recipe:recipe", "Check, show and describe recipes."),
    "plugins": BuiltIn("pcsr.cli.plugins:plugins", "List the parts that recipes may name, and who brings them."),
}


class Foreign(NamedTuple):
    """A command that an installed distribution announces. Reading this much of it imports nothing."""

    owner: str
    point: Any
    """An `importlib.metadata.EntryPoint`, or the like of the backport."""


def foreign_commands() -> dict[str, list[Foreign]]:
    """Announced commands by name. More than one of a name is settled when it is called."""
    # The names of those alone that announce something: reading all of them takes longer than all else in a help page.
    announced = [
        Foreign(str(distribution.metadata["Name"]), point)
        for distribution in distributions()
        for point in distribution.entry_points
        if point.group == GROUP
    ]
    found: dict[str, list[Foreign]] = {}
    for one in sorted(announced, key=lambda one: one.owner):
        found.setdefault(one.point.name, []).append(one)
    return found


class Commands(click.Group):
    """The group of all commands; the shell around them that turns errors into one line and an exit code."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Ours in the order of their table, then everyone else's."""
        return [*COMMANDS, *sorted(foreign_commands().keys() - COMMANDS.keys())]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import one command.

        Raises:
            UserError: two plugins announce it, or the plugin that does is broken.
        """
        if cmd_name in COMMANDS:
            module, _, attribute = COMMANDS[cmd_name].target.partition(":")
            command: click.Command = getattr(importlib.import_module(module), attribute)
            return command
        announced = foreign_commands().get(cmd_name, [])
        if len(announced) > 1:
            owners = " and by ".join(owner for owner, _ in announced)
            raise UserError(f"command '{cmd_name}' is announced twice, by {owners}: uninstall one of them")
        return _load(*announced[0]) if announced else None

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does, with a suggestion for a misspelt command."""
        if args and not args[0].startswith("-") and args[0] not in COMMANDS and args[0] not in foreign_commands():
            ctx.fail(f"no such command '{args[0]}': {did_you_mean(args[0], self.list_commands(ctx))}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Names and summaries, from tables and metadata alone."""
        foreign = foreign_commands()
        rows = [
            (name, COMMANDS[name].summary if name in COMMANDS else f"From {foreign[name][0].owner}.")
            for name in self.list_commands(ctx)
        ]
        with formatter.section("Commands"):
            formatter.write_dl(rows)

    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        """Read the options in front of a command; `--help` prints its page here."""
        with _told():
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; what goes wrong ends here."""
        with _told(ctx.params["traceback"]), _own_warnings(all_of_them=ctx.params["traceback"]):
            _check_folder()
            result = super().invoke(ctx)
            streams.flush()
            return result


@contextmanager
def _told(trace: bool = False) -> Iterator[None]:
    """Turn whatever goes wrong into one line and an exit code; `trace` shows where it arose, too."""
    try:
        yield
    except (click.ClickException, click.exceptions.Exit, click.Abort):
        raise
    except (Exception, KeyboardInterrupt) as error:
        if isinstance(error, OSError) and error.errno == errno.EPIPE:
            raise  # the reader of our output left, as `head` does: click knows what to do
        message, code = explain(error)
        with suppress(OSError):  # a full disk behind the messages changes no exit code
            if trace:
                traceback.print_exc()
            click.echo(message, err=True)
        streams.give_up()
        raise click.exceptions.Exit(code) from error


@contextmanager
def _own_warnings(*, all_of_them: bool) -> Iterator[None]:
    """Show pcsr's own warnings, a line each. Those of numpy and torch mean something to programmers alone."""
    with warnings.catch_warnings():
        if not all_of_them:
            warnings.showwarning = _show_warning
        yield


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,  # noqa: ARG001 the signature is that of the standard library
    lineno: int,  # noqa: ARG001
    file: TextIO | None = None,  # noqa: ARG001
    line: str | None = None,  # noqa: ARG001
) -> None:
    if issubclass(category, PcsrWarning):
        click.echo(f"pcsr: warning: {message}", err=True)


def _check_folder() -> None:
    """Raises UserError where the current folder is gone: torch's libraries would end the process without a word."""
    try:
        os.getcwd()
    except OSError as error:
        raise UserError(f"the current folder cannot be used ({error.strerror}): change to another one") from error


def _load(owner: str, point: Any) -> click.Command:
    try:
        command = point.load()
    except Exception as error:
        raise UserError(
            f"command '{point.name}' of {owner} cannot be loaded from '{point.value}': {type(error).__name__}: {error}"
        ) from error
    if not isinstance(command, click.Command):
        raise UserError(f"command '{point.name}' of {owner} is {command!r}, which is not a click command")
    return command


def explain(error: BaseException) -> tuple[str, int]:
    """What a person reads of an error, and the code to exit with."""
    match error:
        case PcsrError():
            return str(error) if error.placed else f"pcsr: error: {error}", error.exit_code
        case KeyboardInterrupt():
            return interrupt.MESSAGE, interrupt.CODE
        case OSError(errno=errno.ENOSPC):
            where = f" (writing {error.filename})" if error.filename else ""
            return f"pcsr: error: the disk is full{where}: free some space and run again", RunError.exit_code
        case OSError(strerror=str(reason)):
            return f"pcsr: error: {f'{error.filename}: ' if error.filename else ''}{reason}", RunError.exit_code
    described = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return f"pcsr: error: {described} (run again with --traceback: pcsr --traceback …)", 1


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="pcsr")
@click.option("--traceback", is_flag=True, help="Show where in the program an error arose.")
def pcsr(traceback: bool) -> None:
    """Point-cloud super-resolution with touch."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit.

    0: done; 1: a failure; 2: a mistake in what was given; 130: interrupted.
    """
    from pcsr.threads import wait_passively

    streams.prepare()
    os.environ.setdefault("PYTHONWARNINGS", "ignore")  # of worker processes, whose warnings nobody else holds back
    wait_passively()  # before a command imports torch
    pcsr.main(args=arguments, prog_name="pcsr")
