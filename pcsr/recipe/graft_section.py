"""The section `graft` of a recipe's model."""

from typing import Annotated, Any, Literal

from pydantic import Field

from pcsr.recipe.part_keys import NETWORK
from pcsr.recipe.section import AS_TUPLE, PartSpec, Section
from pcsr.recipe.train_section import Weights

Layout = Literal["bnc", "bcn", "bcn1"]
"""Layout of a layer's output: batch, points and channels, in this order; the last has an axis of length 1."""
PointsLayout = Literal["bnc", "bcn"]
"""Layout of a batch of points."""


class Graft(Section):
    """Touch on a foreign network: its class, its layer and the tactile parts."""

    network: Annotated[str, Field(pattern=f"^{NETWORK.pattern}$")]
    """File and class of the network, or an annotated function that returns it: `network.py:Net`. In a recipe the file
    is a path, relative to the recipe's folder; in a resolved recipe its name alone."""
    options: dict[str, Any] = Field(default_factory=dict)
    """Keyword arguments of the class or function."""
    weights: Weights | None = None
    """Weights of the network that training starts from: a safetensors file with its `state_dict`. None: those that it
    is built with."""
    frozen: bool | None = None
    """Whether the network itself is not trained, but the tactile parts alone. None: if `weights` are given."""
    at: Annotated[str, Field(min_length=1, max_length=1000)]
    """Layer that the touches are fused at: a dotted name of the network's modules."""
    fusion: PartSpec
    touch_encoder: PartSpec | None
    layout: Layout | None = None
    """Layout of the layer's output. None: test runs show it."""
    points: Annotated[int, Field(ge=0)] | str = 0
    """The network's argument for the points: a position or a name."""
    points_layout: PointsLayout | None = None
    """Layout of the points. None: that which the network can be run on."""
    arguments: Annotated[tuple[Any, ...], AS_TUPLE, Field(max_length=64)] = ()
    """Other arguments of the network, by position."""
    keywords: dict[str, Any] = Field(default_factory=dict)
    """Other arguments of the network, by name."""

    @property
    def is_frozen(self) -> bool:
        """Whether the tactile parts alone are trained."""
        return self.weights is not None if self.frozen is None else self.frozen
