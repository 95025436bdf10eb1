"""Progress of work in stages, as one number of steps."""

from collections.abc import Callable


class TwoStages:
    """Progress of work in two stages, as of one.

    Args:
        advance: called with the steps that are done, and with all.
        rest: number of steps of the second stage.

    Examples:
        >>> from pcsr.stages import TwoStages
        >>> stages = TwoStages(lambda done, total: print(done, total), 10)
        >>> stages.first(5, 20)
        5 30
        >>> stages.second(1, 2)
        25 30
    """

    def __init__(self, advance: Callable[[int, int], None], rest: int) -> None:
        self.advance, self.rest, self.before = advance, rest, 0

    def first(self, done: int, total: int) -> None:
        """Report the steps of the first stage."""
        self.before = total
        self.advance(done, total + self.rest)

    def second(self, done: int, total: int) -> None:
        """Report the steps of the second stage, as a part of `rest`."""
        self.advance(self.before + done * self.rest // total, self.before + self.rest)
