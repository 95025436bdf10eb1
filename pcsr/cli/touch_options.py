"""Options of commands that use recorded touches: the recording, the error of its poses, and the report."""

import functools
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from pcsr.cli.options import FILE
from pcsr.cli.reasons import echo_skipped
from pcsr.errors import UserError

if TYPE_CHECKING:
    from pcsr.clouds.pose_error import PoseError
    from pcsr.recorded import Recording

Result = TypeVar("Result")


class _PoseError(click.ParamType["PoseError"]):
    """Click type of the error of a pose: millimetres and degrees."""

    name = "mm,deg"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> "PoseError":
        """Return the error."""
        from pcsr.clouds.pose_error import PoseError

        if isinstance(value, PoseError):
            return value
        try:
            position, rotation = map(float, str(value).split(","))
        except ValueError:
            from pcsr.validation_messages import shown

            raise UserError(
                f"--pose-error {shown(str(value))}: it must be two numbers, millimetres and degrees, as in "
                f"--pose-error 0.3,0.2"
            ) from None
        try:
            return PoseError(position, rotation)
        except UserError as error:
            raise UserError(f"--pose-error {str(value)[:40]}: {error}") from None


TOUCH = click.option("--touch", "folder", type=FILE, default=None, metavar="DIR", help="Folder of recorded touches.")


def pose_error_option(default: str) -> Callable[[Callable[..., Result]], Callable[..., Result]]:
    """Return the option `--pose-error`; `default` is the end of its help."""
    return click.option(
        "--pose-error",
        type=_PoseError(),
        default=None,
        metavar="MM,DEG",
        help="Error of the poses of the touches, as standard deviations along and about each axis: 0.3,0.2; 0,0 if "
        f"they are exact.  [default: {default}]",
    )


POSE_ERROR = pose_error_option("the recording's, else 1,2")
AS_IS = click.option(
    "--touch-as-is", "as_is", is_flag=True, help="Use the touches where they were reported, without registration."
)
REPORT = click.option(
    "--touch-report",
    "report",
    type=FILE,
    default=None,
    metavar="FILE",
    help="Write the registration of the touches to this JSON file.",
)


@dataclass(frozen=True)
class TouchOptions:
    """Values of the options."""

    folder: Path | None
    """Folder of the recording; None without touches."""
    pose_error: "PoseError | None"
    """Error of the poses; None if it was not given."""
    as_is: bool
    """Whether the touches are not registered."""
    report: Path | None
    """File of the report."""

    def check(self, files: Sequence[Path], recordings: Sequence[Path] = ()) -> None:
        """Check that the options fit together, and that the report can be written.

        Args:
            files: other files that the command reads or writes.
            recordings: folders of recordings that it writes.

        Raises:
            UserError: they do not, or it cannot.
        """
        given = {
            "--pose-error": self.pose_error is not None,
            "--touch-as-is": self.as_is,
            "--touch-report": self.report is not None,
        }
        for name, is_given in given.items():
            if is_given and self.folder is None:
                raise UserError(f"{name}: it is about the touches of --touch, which is not given")
            if is_given and self.as_is and name != "--touch-as-is":
                raise UserError(f"{name}: with --touch-as-is no touch is registered: leave one of the two out")
        if self.report is not None:
            folders = [*recordings, *([] if self.folder is None else [self.folder])]
            check_report(self.report, [*files, *folders], folders)

    def read(self) -> "Recording":
        """Read the recording, with the error of `--pose-error` if it was given, and name the touches that are skipped.

        Without a folder it has no touches.
        """
        from dataclasses import replace

        from pcsr.recorded import Recording, read

        if self.folder is None:
            return Recording([], [], {})
        recording = read(self.folder)
        echo_skipped(recording)
        return recording if self.pose_error is None else replace(recording, pose_error=self.pose_error)


def check_report(path: Path, files: Sequence[Path], recordings: Sequence[Path]) -> None:
    """Check that a report can be written, before the work.

    Args:
        path: file of the report.
        files: other files of the command.
        recordings: folders of recordings, in which a report may replace no file of theirs.

    Raises:
        UserError: the path is that of a folder, a device or a pipe, or of a file that the command reads or writes, or
            its folder cannot be written to.
    """
    from pcsr.files import check_target
    from pcsr.recorded import MANIFEST

    check_target(path)
    if str(path) == "-":
        raise UserError("--touch-report -: a report cannot be written to a pipe: name a file")
    whole = path.resolve()
    if any(whole == file.resolve() for file in files):
        raise UserError(f"--touch-report {path}: this command reads or writes that file: name another one")
    folders = [one.parent if one.name == MANIFEST else one for one in recordings]
    if (whole.suffix != ".json" or whole.name == MANIFEST) and any(
        whole.is_relative_to(folder.resolve()) for folder in folders
    ):
        raise UserError(f"--touch-report {path}: it may be a file of the recording: name one outside of its folder")
    folder = next(one for one in path.absolute().parents if os.path.lexists(one))
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        what = "cannot be written to" if folder.is_dir() else "is a file"
        raise UserError(f"--touch-report {path}: {folder} {what}: name a file in another folder")


def touch_options(command: Callable[..., Result]) -> Callable[..., Result]:
    """Add `--touch`, `--pose-error`, `--touch-as-is` and `--touch-report`; pass `TouchOptions` as `touch`."""

    @functools.wraps(command)
    def with_touches(
        *args: object,
        folder: Path | None,
        pose_error: "PoseError | None",
        as_is: bool,
        report: Path | None,
        **kwargs: object,
    ) -> Result:
        touch = TouchOptions(folder, pose_error, as_is, report)
        touch.check([value for value in kwargs.values() if isinstance(value, Path)])
        return command(*args, touch=touch, **kwargs)

    return TOUCH(POSE_ERROR(AS_IS(REPORT(with_touches))))
