"""Parts whose constructor breaks the contract, by the check that must fail."""

from torch import nn

from pcsr import Trait, UserError
from tests.testing.parts import Copy, Lift, Squares


class NeedsAnOption(Lift):
    def __init__(self, widths, *, channels: int) -> None:
        super().__init__(widths, channels=channels)


class RefusesNamelessly(Copy):
    def __init__(self, widths) -> None:
        if widths.refined % 2:
            raise UserError("an odd number")
        super().__init__(widths)


class RefusesEverything(Lift):
    def __init__(self, widths) -> None:
        raise UserError("encoder 'refuses' likes no widths")


class Trips(Lift):
    def __init__(self, widths) -> None:
        raise ZeroDivisionError("1 / 0")


class NoModuleYet(Lift):
    def __init__(self, widths) -> None:
        self.channels = 3


class ClaimsMore(Lift):
    traits = frozenset()

    def __init__(self, widths) -> None:
        super().__init__(widths)
        self.traits = Lift.traits


class Untyped(Lift):
    def __init__(self, widths, *, channels=6) -> None:
        super().__init__(widths)


class Unsayable(Lift):
    def __init__(self, widths, *, layer: nn.Module | None = None) -> None:
        super().__init__(widths)


class Positional(Lift):
    def __init__(self, widths, channels: int = 6) -> None:
        super().__init__(widths)


class Widthless(Lift):
    def __init__(self, *, channels: int = 6) -> None:
        super().__init__(None)


class WrongDefault(Lift):
    def __init__(self, widths, *, channels: int = 6.5) -> None:
        super().__init__(widths)


class StrangePlaces(Lift):
    path_options = frozenset({"folder"})


class VersionZero(Lift):
    version = 0


class TouchesOfAnEncoder(Lift):
    traits = frozenset({Trait.TOUCH_PERMUTATION_INVARIANT})


class TupleOfTraits(Lift):
    traits = (Trait.PERMUTATION_EQUIVARIANT,)


class StandsStill(Squares):
    lr_multiplier = 0.0


class Swallows(Lift):
    def __init__(self, widths, **options) -> None:
        super().__init__(widths)


class MeetsItLater(Lift):
    def __init__(self, widths, **options) -> None:
        super().__init__(widths)
        if options:
            raise KeyError(*options)


BROKEN = [
    ("builds", NeedsAnOption, r"building it for Widths.* raised TypeError: .*'channels'.*checks_for\(Part, option"),
    ("builds", RefusesNamelessly, r"refuses with 'an odd number'.*begin the message with \"upsampler 'NAME'"),
    ("builds", RefusesEverything, "refuses to be built: encoder 'refuses' likes no widths"),
    ("builds", Trips, r"ZeroDivisionError: 1 / 0 \(at .*broken_construction.py:\d+\)"),
    ("builds", NoModuleYet, r"super\(\).__init__"),
    ("builds", ClaimsMore, "an instance claims permutation-equivariant, which its class does not"),
    ("options", Untyped, "option 'channels' of Untyped has no type"),
    ("options", Unsayable, "options cannot be read"),
    ("options", Positional, r"takes \['widths', 'channels'\] by position"),
    ("options", Widthless, r"takes nothing by position"),
    ("options", WrongDefault, "defaults are {'channels': 6.5}, which fail"),
    ("options", StrangePlaces, r"`path_options` names \['folder'\]"),
    ("options", VersionZero, "`version` is 0"),
    ("options", TouchesOfAnEncoder, "its class claims .*expected is a frozenset of local, permutation-equivariant"),
    ("options", TupleOfTraits, "its class claims"),
    ("options", StandsStill, "`lr_multiplier` is 0.0"),
    ("unknown-options", Swallows, r"accepts an unknown option.*\*\*kwargs"),
    ("unknown-options", MeetsItLater, "for an unknown option it raises KeyError"),
]
