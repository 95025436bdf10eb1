"""The bounds of options: what is beyond them is refused, all published networks are within."""

import pytest
from pydantic import TypeAdapter, ValidationError

from pcsr_plugins.layers import options


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [
        ("Channels", 1, 2048),
        ("HalvedChannels", 2, 2048),
        ("QuarteredChannels", 4, 512),
        ("NeighbourCount", 1, 256),
        ("Count", 1, 4096),
        ("Layers", 1, 32),
    ],
)
def test_numbers_end_at_their_bounds(name, least, most):
    option = TypeAdapter(getattr(options, name))
    assert [option.validate_python(value) for value in (least, most)] == [least, most]
    for value in (least - 1, most + 1):
        with pytest.raises(ValidationError, match="Input should be"):
            option.validate_python(value)


@pytest.mark.parametrize("name", ["Cascade", "HalvedCascade"])
def test_a_cascade_has_a_layer_and_at_most_sixteen_each_within_its_bounds(name):
    cascade = TypeAdapter(getattr(options, name))
    assert cascade.validate_python((8,) * 16) == (8,) * 16
    for value in ((), (8,) * 17, (8, 0), (8, 2049)):
        with pytest.raises(ValidationError):
            cascade.validate_python(value)


def test_a_length_is_more_than_nothing_and_a_weight_may_be_nothing():
    with pytest.raises(ValidationError, match="greater than 0"):
        TypeAdapter(options.Positive).validate_python(0.0)
    assert TypeAdapter(options.Weight).validate_python(0.0) == 0
    for option in (options.Positive, options.Weight):
        for value in (-1.0, float("inf"), float("nan")):
            with pytest.raises(ValidationError):
                TypeAdapter(option).validate_python(value)
