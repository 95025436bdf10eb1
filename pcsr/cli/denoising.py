"""`--denoise [SIGMA]` of `pcsr upsample`: the option, and the line that says what was done."""

import itertools
import re
from typing import TYPE_CHECKING, Any

import click

from pcsr.errors import UserError

if TYPE_CHECKING:
    from rich.console import Console

    from pcsr.clouds.faults import ScreenedCloud

ESTIMATE = "estimate"
"""Value of the option without a number."""

RANGE = (
    "it must be more than 0: give the standard deviation of the noise in the cloud's unit, or none to have it estimated"
)


class _Level(click.ParamType[bool | float]):
    """Click type of a standard deviation: a positive number, or True to estimate it."""

    name = "sigma"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> bool | float:
        """Return True or the number. The name of a file is refused with the order of arguments that works."""
        if isinstance(value, float) or value is True:
            return value
        if value == ESTIMATE:
            return True
        try:
            level = float(value)
        except ValueError:
            from pcsr.validation_messages import shown

            raise UserError(
                f"--denoise {shown(str(value))}: that is no number: give the standard deviation of the noise, as in "
                f"--denoise 0.003, or none to have it estimated; if it is the cloud, put it before --denoise"
            ) from None
        if not 0 < level < float("inf"):
            raise UserError(f"--denoise {level:g}: {RANGE}")
        return level


class DenoisingCommand(click.Command):
    """Command with the option, for which click takes a negative number for the name of another option."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Refuse a negative number."""
        for arg, following in itertools.pairwise([*args, ""]):
            name, _, value = arg.partition("=")
            value = value or following
            if name == "--denoise" and re.fullmatch(r"-\.?\d.*|-inf", value):
                raise UserError(f"--denoise {value[:40]}: {RANGE}")
        return super().parse_args(ctx, args)


DENOISE = click.option(
    "--denoise",
    type=_Level(),
    is_flag=False,
    flag_value=ESTIMATE,
    default=None,
    metavar="[SIGMA]",
    help="Move the input points onto the surface before new ones are made. SIGMA is the standard deviation of the "
    "noise in the cloud's unit.  [default: estimated]",
)


def denoised(
    given: "ScreenedCloud", level: bool | float, *, jobs: int, scheduler: str | None, console: "Console", quiet: bool
) -> "ScreenedCloud":
    """Move the used points of a cloud onto its surface, with a progress bar, and say by how much.

    Args:
        given: the cloud.
        level: standard deviation of the noise in the unit of the cloud; True estimates it.
        jobs: number of processes.
        scheduler: address of a Dask scheduler whose workers are used instead.
        console: console of stderr.
        quiet: show no progress.

    Raises:
        UserError: the level is larger than the cloud.
    """
    from pcsr.progress import progress_bars
    from pcsr.upsample.denoised_cloud import denoise_cloud
    from pcsr.workers import worker_pool

    with progress_bars(console, hidden=quiet) as progress, worker_pool(jobs, scheduler) as pool:
        task = progress.add_task("denoising", total=None)
        moved, result = denoise_cloud(
            given, level, pool=pool, advance=lambda done, total: progress.update(task, completed=done, total=total)
        )
    if result.level == 0:
        said = "no noise is found that differs from details: no point is moved; --denoise SIGMA sets its level"
    else:
        source = "estimated" if level is True else "given"
        said = f"noise of {result.level:.4g} {source}; {result.moved} points moved by {result.mean:.4g} on average"
    console.print(said, markup=False, soft_wrap=True)
    return moved
