"""The command line: `pcsr COMMAND`. A command's module is imported when the command is called, not before."""

# isort: off
from pcsr.cli import interrupt  # first: Ctrl-C is handled while the slower imports run

# isort: on
import errno
import importlib
import os
import shlex
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import distributions
from typing import Any, NamedTuple

import click

from pcsr import __version__
from pcsr.cli import streams
from pcsr.cli.warnings_shown import own_warnings_by
from pcsr.errors import PcsrError, RunError, UserError, did_you_mean

GROUP = "pcsr.commands"
"""The entry-point group in which plugins announce commands: `name = "module:click_command"`."""
WORDS = "pcsr.words"
"""Key of click's context at which the words after `pcsr` are."""


class BuiltIn(NamedTuple):
    """Built-in command: its import path, and its line in `pcsr --help`."""

    target: str
    """`module:attribute` of the click command."""
    summary: str


COMMANDS = {
    "upsample": BuiltIn("pcsr.cli.upsample:upsample", "Make a cloud dense and write it."),
    "evaluate": BuiltIn("pcsr.cli.evaluate:evaluate", "Measure a cloud against the true one."),
    "view": BuiltIn("pcsr.cli.view:view", "Show clouds side by side in the browser."),
    "export": BuiltIn("pcsr.cli.export:export", "Export a network to ONNX, or its weights to a file."),
    "run": BuiltIn("pcsr.cli.run:run", "Train and evaluate a recipe, or compare several."),
    "compare": BuiltIn("pcsr.cli.compare:compare", "Compare recipes, parts or finished runs under equal conditions."),
    "runs": BuiltIn("pcsr.cli.runs:runs", "List, show and remove run folders."),
    "report": BuiltIn("pcsr.cli.report:report", "Write the reports of finished runs again."),
    "figures": BuiltIn("pcsr.cli.figures:figures", "Draw the figures of finished runs as PNG files."),
    "data": BuiltIn("pcsr.cli.data:data", "Build and inspect data sets of clouds and touches."),
    "register": BuiltIn("pcsr.cli.register:register", "Register touches to a cloud and report the error of the arm."),
    "touch": BuiltIn("pcsr.cli.touch:touch", "Simulate touches on a mesh and write them as a recording."),
    "recorded": BuiltIn("pcsr.cli.recorded:recorded", "Check recordings of touches, and import them from ROS bags."),
    "sensor": BuiltIn("pcsr.cli.sensor:sensor", "Calibrate camera-based tactile sensors and read their images."),
    "recipe": BuiltIn("pcsr.cli.recipe:recipe", "Check, show and describe recipes."),
    "plugins": BuiltIn("pcsr.cli.plugins:plugins", "List, check and write plugins and their parts."),
}


class Foreign(NamedTuple):
    """Command that an installed distribution announces; it is not imported yet."""

    owner: str
    """Name of the distribution."""
    point: Any
    """`importlib.metadata.EntryPoint`, or its equal in the backport `importlib_metadata`."""


def foreign_commands() -> dict[str, list[Foreign]]:
    """Return the commands that installed distributions announce, by name.

    Several distributions may announce the same name; that is an error only when the command is called.
    """
    # Metadata is read only for distributions that announce a command: reading all would double the time of --help.
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
    """Group of all commands, which turns every error into one line and an exit code."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the built-in commands in the order of `COMMANDS`, then those of plugins by name."""
        return [*COMMANDS, *sorted(foreign_commands().keys() - COMMANDS.keys())]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import one command.

        Raises:
            UserError: two plugins announce the command, or the plugin that announces it is broken.
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
        """Find the command, and suggest a name for a misspelt one."""
        if args and not args[0].startswith("-") and args[0] not in COMMANDS and args[0] not in foreign_commands():
            ctx.fail(f"no such command '{args[0]}': {did_you_mean(args[0], self.list_commands(ctx))}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the names and summaries of the commands without importing any of them."""
        foreign = foreign_commands()
        rows = [
            (name, COMMANDS[name].summary if name in COMMANDS else f"From {foreign[name][0].owner}.")
            for name in self.list_commands(ctx)
        ]
        with formatter.section("Commands"):
            formatter.write_dl(rows)

    def make_context(self, info_name: str | None, args: list[str], *others: Any, **kwargs: Any) -> click.Context:
        """Parse the options before the command's name; `--help` prints its page here."""
        words = list(args)  # parsing empties it
        with _reported_errors():
            context = super().make_context(info_name, args, *others, **kwargs)
        context.meta[WORDS] = words
        return context

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command and report its errors."""
        verbose = ctx.params["traceback"]
        with _reported_errors(verbose), _own_warnings(show_all=verbose):
            _check_current_folder()
            result = super().invoke(ctx)
            streams.flush()
            return result


@contextmanager
def _reported_errors(trace: bool = False) -> Iterator[None]:
    """Turn any exception into one line on standard error and an exit code; `trace` prints the traceback first."""
    try:
        yield
    except (click.ClickException, click.exceptions.Exit, click.Abort):
        raise
    except (Exception, KeyboardInterrupt, SystemExit) as error:  # SystemExit: code of a plugin ends the process
        if isinstance(error, OSError) and error.errno == errno.EPIPE:
            raise  # the reader of the pipe ended early, as `head` does: click exits quietly
        message, code = explain(error)
        if isinstance(error, KeyboardInterrupt):
            # An interrupt that passes through code in a text, as dataclasses and named tuples run it, makes Python end
            # by the signal, though it is caught. Running another text takes this back.
            exec("")
        with suppress(OSError):  # the exit code holds even where the message cannot be written
            if trace:
                traceback.print_exc()
            click.echo(message, err=True)
        streams.give_up()
        raise click.exceptions.Exit(code) from error


@contextmanager
def _own_warnings(*, show_all: bool) -> Iterator[None]:
    """Show pcsr's own warnings, one line each, and hide those of other libraries unless `show_all`."""
    with warnings.catch_warnings():
        if not show_all:
            warnings.showwarning = own_warnings_by(lambda text: click.echo(f"pcsr: warning: {text}", err=True))
        yield


def _check_current_folder() -> None:
    """Check that the current folder exists; without it torch's libraries end the process without a message.

    Raises:
        UserError: the current folder was removed or cannot be read.
    """
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
    """Return the message for an exception and the exit code."""
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
@click.option("--traceback", is_flag=True, help="Show Python's traceback of an error, and all warnings.")
def pcsr(traceback: bool) -> None:
    """Point-cloud super-resolution with touch."""


def command_line() -> str | None:
    """Return the command line of the command that runs, as a shell takes it; None outside of a command."""
    context = click.get_current_context(silent=True)
    words = None if context is None else context.meta.get(WORDS)
    return None if words is None else shlex.join(["pcsr", *words])


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit.

    Exit codes: 0, success; 1, failure; 2, a mistake in the arguments, options or input files; 130, interrupted.

    Args:
        arguments: the words after `pcsr`; those of the process by default.
    """
    from pcsr.threads import wait_passively

    streams.prepare()
    os.environ.setdefault("PYTHONWARNINGS", "ignore")  # worker processes show no warnings of their own
    wait_passively()  # must come before a command imports torch
    pcsr.main(args=arguments, prog_name="pcsr")
