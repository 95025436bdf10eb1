"""Types of the options that network parts share: a recipe beyond their bounds is refused before anything is built.

The bounds are far above every published network, and low enough that one layer of that size fits into a few hundred
megabytes.
"""

from typing import Annotated

from pydantic import Field

Channels = Annotated[int, Field(ge=1, le=2048)]
"""Features of a point, or the width of a layer."""
HalvedChannels = Annotated[int, Field(ge=2, le=2048)]
"""Channels of a layer that splits them into two halves."""
QuarteredChannels = Annotated[int, Field(ge=4, le=512)]
"""Channels of a layer with copies for each new point, of which self-attention compares a quarter."""
Cascade = Annotated[tuple[Channels, ...], Field(min_length=1, max_length=16)]
"""Channels of one layer after the other."""
HalvedCascade = Annotated[tuple[HalvedChannels, ...], Field(min_length=1, max_length=16)]
"""Channels of one layer after the other, each of which splits them into two halves."""
NeighbourCount = Annotated[int, Field(ge=1, le=256)]
"""Nearest points that a point looks at."""
Count = Annotated[int, Field(ge=1, le=4096)]
"""Points that are drawn, of a ball or of a touch."""
Layers = Annotated[int, Field(ge=1, le=32)]
"""Layers or blocks in a row."""
Positive = Annotated[float, Field(gt=0, le=1e6)]
"""A length or a factor that is not zero; where it has a unit, the radius of the cloud."""
Weight = Annotated[float, Field(ge=0, le=1e9)]
"""Factor of one loss among others; 0 leaves it out."""
