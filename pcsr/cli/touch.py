"""`pcsr touch`: where to touch next, and simulated touches."""

import click

from pcsr.cli.touch_explore import explore
from pcsr.cli.touch_next import next_
from pcsr.cli.touch_simulate import simulate


class _Simulating(click.Group):
    """Group whose command may be left out before a mesh: `pcsr touch part.stl` is `pcsr touch simulate part.stl`."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Insert `simulate` if the arguments begin with no command, and ask for more than the help."""
        if args and args[0] not in self.commands and not {"-h", "--help"} & set(args[:1]):
            args = ["simulate", *args]
        return super().parse_args(ctx, args)


@click.group(cls=_Simulating)
def touch() -> None:
    """Find where to touch next, and simulate touches on a mesh.

    The command simulate may be left out.

    \b
    pcsr touch next scan.ply --touch touches/ -o next.json
    pcsr touch part.stl -o touches/
    """  # noqa: D301 (click's mark is the letter itself)


touch.add_command(next_)
touch.add_command(explore)
touch.add_command(simulate)
