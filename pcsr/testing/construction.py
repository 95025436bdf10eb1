"""Checks of a part's constructor and of its class attributes."""

import inspect
import json
from typing import Any

from pydantic import PydanticUserError, ValidationError
from torch import nn

from pcsr.contracts import Objective, Trait
from pcsr.errors import UserError
from pcsr.options import Options
from pcsr.recipe.schema import options_model
from pcsr.testing.check import describe
from pcsr.testing.subject import GIVE, NETWORK, WIDTHS, Subject

STRAY = "an_option_that_no_part_has"


def options(subject: Subject) -> None:
    """Options are keyword-only, typed and expressible in YAML; the class attributes are valid."""
    part = subject.part
    positional = [
        name
        for name, parameter in list(inspect.signature(part.__init__).parameters.items())[1:]
        if parameter.kind in (parameter.POSITIONAL_ONLY, parameter.POSITIONAL_OR_KEYWORD)
    ]
    host = ["widths"] if subject.kind in NETWORK else []
    if len(positional) != len(host):
        raise subject.failure(
            f"its constructor takes {positional or 'nothing'} by position",
            f"that the host hands in {host or 'nothing'}",
            f"write def __init__(self, {'widths: Widths, ' if host else ''}*, option: int = 1)",
        )
    try:
        model = options_model(part)
    except (TypeError, NameError, PydanticUserError) as error:
        raise subject.failure(
            f"its options cannot be read: {' '.join(str(error).split())}",
            "that each has a type which YAML can write",
            "annotate them in the constructor",
        ) from error
    defaults = {name: field.default for name, field in model.model_fields.items() if not field.is_required()}
    required = {name: subject.options[name] for name in model.model_fields.keys() - defaults if name in subject.options}
    try:
        model.model_validate_json(json.dumps({**defaults, **required}, default=_plain))
    except (TypeError, ValidationError) as error:
        wrong = error.errors() if isinstance(error, ValidationError) else []
        missing = [one for one in wrong if one["type"] == "missing"]
        if not wrong or len(missing) < len(wrong):
            raise subject.failure(
                f"its defaults are {defaults}, which fail: {' '.join(str(error).split())}",
                "that a recipe can say each of them",
                "take types that YAML has, and defaults that keep to them",
            ) from error
    strange = sorted(subject.part.path_options - model.model_fields.keys())
    if strange:
        raise subject.failure(f"`path_options` names {strange}", "options of the constructor", "correct the names")
    if not isinstance(part.version, int) or part.version < 1:
        raise subject.failure(f"`version` is {part.version!r}", "a whole number from 1 on", "count up from 1")
    _traits(subject, "its class", part.traits)
    if issubclass(part, Objective) and not part.lr_multiplier > 0:
        raise subject.failure(f"`lr_multiplier` is {part.lr_multiplier!r}", "a factor above 0", "leave it at 1.0")


def _plain(value: object) -> object:
    """A group of options as JSON has it."""
    if isinstance(value, Options):
        return value.model_dump()
    raise TypeError(f"{type(value).__name__} is nothing that JSON has")


def unknown_options(subject: Subject) -> None:
    """An unknown option is an error."""
    widths = subject.widths
    host = (widths,) if subject.kind in NETWORK else ()
    try:
        subject.part(*host, **{**subject.options, STRAY: 1})
    except (TypeError, UserError):
        return
    except Exception as error:
        found = f"for an unknown option it raises {describe(error)}"
    else:
        found = "it accepts an unknown option"
    raise subject.failure(found, "a TypeError", "name each option in the constructor instead of taking **kwargs")


def builds(subject: Subject) -> None:
    """It builds from its defaults, at several widths; it may refuse some, if it says who it is."""
    hosts = WIDTHS if subject.kind in NETWORK else WIDTHS[:1]
    instances: list[Any] = []
    refused = []
    for widths in hosts:
        try:
            instances.append(subject.make(widths))
        except UserError as error:
            subject.must_name_itself(error)
            refused.append(str(error))
        except Exception as error:
            at = f" for {widths}" if subject.kind in NETWORK else ""
            raise subject.failure(
                f"building it{at} raised {describe(error)}",
                "that it builds from its defaults, or refuses with a UserError",
                f"give each option a default; one that has to be given, give to the suite: {GIVE}",
            ) from error
    if not instances:
        raise subject.failure(
            f"it refuses to be built: {'; '.join(dict.fromkeys(refused))}",
            "that it builds from its defaults, for some widths at least",
            f"change the defaults, or give the suite the options that it needs: {GIVE}",
        )
    for one in instances:
        if subject.kind in (*NETWORK, "objective") and not (isinstance(one, nn.Module) and hasattr(one, "_modules")):
            raise subject.failure(
                "it is no module of torch yet", "nn.Module's constructor", "call super().__init__() first"
            )
        if not one.traits <= subject.part.traits:
            raise subject.failure(
                f"an instance claims {_names(one.traits - subject.part.traits)}, which its class does not",
                "that an instance claims less than its class, if anything else",
                "claim it in the class, and take it back in the constructor where it does not hold",
            )
        _traits(subject, "an instance", one.traits)


def _traits(subject: Subject, whose: str, claimed: Any) -> None:
    meaningful = TRAITS[subject.kind]
    strange = [trait for trait in claimed if trait not in meaningful]
    if not isinstance(claimed, frozenset) or strange:
        raise subject.failure(
            f"{whose} claims {claimed!r}",
            f"a frozenset of {_names(meaningful) or 'nothing: no trait says anything of this kind'}",
            "correct `traits`",
        )


def _names(traits: Any) -> str:
    return ", ".join(sorted(str(trait) for trait in traits))


TRAITS: dict[str, frozenset[Trait]] = {
    "encoder": frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.LOCAL}),
    "fusion": frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.TOUCH_PERMUTATION_INVARIANT}),
    "backbone": frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.LOCAL}),
    "upsampler": frozenset({Trait.PERMUTATION_EQUIVARIANT, Trait.ANY_RATE, Trait.LOCAL}),
    "objective": frozenset(),
    "touch": frozenset(),
    "shapes": frozenset(),
    "metric": frozenset(),
    "baseline": frozenset(),
    "logger": frozenset(),
    "policy": frozenset(),
}
"""Traits that parts of each kind can claim."""
