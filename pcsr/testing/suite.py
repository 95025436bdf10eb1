"""Which checks there are for which kind."""

from collections.abc import Callable
from typing import Any

from pcsr.contracts import ShapeItem, Upsampler
from pcsr.testing import (
    behaviour,
    construction,
    fusions,
    judging,
    keeping,
    learning,
    objectives,
    objects,
    touching,
    upsamplers,
)
from pcsr.testing.check import Check, Outcome
from pcsr.testing.subject import NETWORK, Subject, kind_of

Checks = dict[str, Callable[[Subject], None]]

CONSTRUCTION: Checks = {
    "builds": construction.builds,
    "options": construction.options,
    "unknown-options": construction.unknown_options,
}
LEARNED: Checks = {
    "deterministic": keeping.deterministic,
    "weights": keeping.weights,
}
IN_NETWORK: Checks = {
    "shapes": behaviour.shapes,
    "coinciding-points": behaviour.coinciding_points,
    "independent-rows": behaviour.independent_rows,
    "gradients": learning.gradients,
    "gradcheck": learning.gradcheck,
    **LEARNED,
    "export": keeping.export,
}
OF_KIND: dict[str, Checks] = {
    "encoder": {},
    "fusion": {
        "zero-touches": fusions.zero_touches,
        "missing-touches": fusions.missing_touches,
        "ragged-join": fusions.ragged_join,
        "hears": fusions.hears,
    },
    "backbone": {},
    "upsampler": {"stages": upsamplers.stages},
    "objective": {
        "losses": objectives.losses,
        "coinciding-points": objectives.coinciding_points,
        "gradients": objectives.gradients,
        "gradcheck": objectives.gradcheck,
        **LEARNED,
    },
    "touch": {
        "touches": touching.touches,
        "repeatable": touching.repeatable,
        "prefix": touching.prefix,
        "leaves-inputs": touching.leaves_inputs,
    },
    "shapes": {
        "names": objects.names,
        "items": objects.items,
        "picklable": objects.picklable,
        "digests": objects.digests,
    },
    "metric": {
        "describes": judging.describes,
        "errors": judging.errors,
        "order-free": judging.order_free,
        "worse-is-more": judging.worse_is_more,
        "leaves-clouds": judging.leaves_clouds,
    },
    "baseline": {"dense": judging.dense},
}


def checks_for(
    part: type[Any], *, item: ShapeItem | None = None, upsampler: type[Upsampler] | None = None, **options: Any
) -> list[Check]:
    """The checks of a part, whatever its kind. Nothing of the part runs before a check is called.

    Args:
        part: a class derived from a kind of part.
        item: the object that a touch source is to touch; by default an egg 60 mm long.
        upsampler: the upsampler of the network that an objective is to judge, where it is made for one.
        options: of the part, where it cannot be built without, or is to be checked with others than its defaults.

    Returns:
        One record for each check: it is called, has a `name`, and as text is that name.

    Raises:
        UserError: `part` is of no kind.

    Examples:
        >>> class Scaled(pcsr.Encoder):
        ...     def __init__(self, widths: pcsr.Widths, *, scale: float = 2.0) -> None:
        ...         super().__init__()
        ...         self.channels, self.scale = 3, scale
        ...
        ...     def forward(self, points):
        ...         return self.scale * points
        >>> checks = pcsr.testing.checks_for(Scaled)
        >>> checks[0].name
        'builds'
        >>> checks[0]()
    """
    kind = kind_of(part)
    subject = Subject(part, kind, options, item, upsampler)
    checks = {
        **CONSTRUCTION,
        **(IN_NETWORK if kind in NETWORK else {}),
        **OF_KIND[kind],
        **(behaviour.trait_checks(kind) if kind in NETWORK else {}),
    }
    return [subject.check(name, run) for name, run in checks.items()]


def check_part(part: type[Any], **options: Any) -> list[Outcome]:
    """Run all checks of a part, with the arguments of `checks_for`, and tell what came of each.

    Examples:
        >>> class Scaled(pcsr.Encoder):
        ...     def __init__(self, widths: pcsr.Widths, *, scale: float = 2.0) -> None:
        ...         super().__init__()
        ...         self.channels, self.scale = 3, scale
        ...
        ...     def forward(self, points):
        ...         return self.scale * points
        >>> {outcome.result for outcome in pcsr.testing.check_part(Scaled)} <= {"passed", "skipped"}
        True
    """
    return [check.outcome() for check in checks_for(part, **options)]
