"""The checks of each kind of part."""

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
    loggers,
    objectives,
    objects,
    policies,
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
        "uses-touches": fusions.uses_touches,
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
    "logger": {
        "logs": loggers.logs,
        "resumes": loggers.resumes,
        "interrupted": loggers.interrupted,
        "leaves-values": loggers.leaves_values,
        "leaves-random-numbers": loggers.leaves_random_numbers,
    },
    "policy": {
        "scores": policies.scores,
        "repeatable": policies.repeatable,
        "few-points": policies.few_points,
        "expects-gains": policies.expects_gains,
        "leaves-clouds": policies.leaves_clouds,
    },
}


def checks_for(
    part: type[Any], *, item: ShapeItem | None = None, upsampler: type[Upsampler] | None = None, **options: Any
) -> list[Check]:
    """Create the checks of a part of any kind. No code of the part runs before a check is called.

    Args:
        part: a class derived from a kind of part.
        item: object for a touch source; by default an egg 60 mm long.
        upsampler: upsampler of the network for an objective, if it needs a certain one.
        options: options of the part, where they differ from its defaults.

    Returns:
        Checks: callables with a `name`, which is also their `str`.

    Raises:
        UserError: `part` is not a part.

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
    """Run all checks of a part and return their outcomes. The arguments are those of `checks_for`.

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
