"""What every part has, whatever its kind."""

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar


class Trait(StrEnum):
    """A property that a part claims to have. The conformance suite (`pcsr.testing`) tests each claim.

    Examples:
        >>> pcsr.Trait.PERMUTATION_EQUIVARIANT.value
        'permutation-equivariant'
        >>> frozenset({pcsr.Trait.ANY_RATE}) <= frozenset(pcsr.Trait)
        True
    """

    PERMUTATION_EQUIVARIANT = "permutation-equivariant"
    """Permuting the input points permutes the output rows alike. The output of an upsampler stays the same set."""
    TOUCH_PERMUTATION_INVARIANT = "touch-permutation-invariant"
    """Permuting the touches does not change the output."""
    ANY_RATE = "any-rate"
    """One instance serves every rate, not only the rate that it was built for."""
    LOCAL = "local"
    """The result at a point depends on the points around it alone, and in the unit of their spacing. A network of local
    parts computes the same on a patch of any size, and `pcsr upsample` gives it larger patches than in training."""


@dataclass(frozen=True)
class Widths:
    """Channel counts that the host passes to the constructor of a network part.

    The parts are built in the order of the network. A count that is not known yet is 0.

    Examples:
        >>> pcsr.Widths(visual=128, touch=32).visual
        128
        >>> pcsr.Widths().refined
        0
    """

    visual: int = 0
    """Channels of the visual features: the encoder's output, the fusion's input and output, the backbone's input."""
    touch: int = 0
    """Channels of the touch features; 3 without a touch encoder."""
    refined: int = 0
    """Channels of the backbone's output, which is the upsampler's input."""
    rate: int = 1
    """Output points for each input point."""


class Part:
    """Base class of all kinds of part.

    The parameters of a part's constructor are the options of the part in a recipe: keyword-only, typed, and with
    defaults. A network part takes the host's `Widths` before them, by position.

    Examples:
        >>> issubclass(pcsr.Encoder, pcsr.contracts.Part)
        True
        >>> pcsr.Encoder.version
        1
    """

    traits: frozenset[Trait] = frozenset()
    """Properties that the part claims to have, none by default. An instance may claim less than its class."""
    version: ClassVar[int] = 1
    """Version of the part's behaviour. Increase it when the same options give another result: data and weights of
    the older version then count as stale."""
    path_options: ClassVar[frozenset[str]] = frozenset()
    """Names of options that are paths of files. Data sets are identified by the contents of these files, not by where
    they lie."""
    needs: ClassVar[frozenset[str]] = frozenset()
    """Import names of optional packages that the part imports only when it is used. The host looks for them before a
    run begins."""
