"""Groups of options: checked, frozen, and by a bare name where they are a choice."""

import json

import pytest
from pydantic import ValidationError

from pcsr import Choice, Options, TouchSource
from pcsr.recipe.schema import options_model


class Noise(Options):
    blur: float = 0.0


class Tip(Choice):
    use: str = "round"
    sides: tuple[float, float] | None = None


class Finger(TouchSource):
    def __init__(self, *, tip: Tip = Tip(), noise: Noise = Noise()) -> None:  # noqa: B008 they are frozen
        self.tip, self.noise = tip, noise


def read(**written):
    return options_model(Finger).model_validate_json(json.dumps(written))


def test_a_bare_name_is_short_for_a_choice_without_options():
    assert read(tip="flat").tip == Tip(use="flat")
    assert read(tip={"use": "flat", "sides": [1, 2]}).tip == Tip(use="flat", sides=(1.0, 2.0))
    assert read(tip={"sides": [1, 2]}).tip.use == "round"
    assert read().noise == Noise()


@pytest.mark.parametrize(
    "wrong", [{"noise": "much"}, {"noise": {"blurr": 1}}, {"tip": {"sides": ["a", 2]}}, {"tip": 3}]
)
def test_what_a_group_does_not_take_is_refused(wrong):
    with pytest.raises(ValidationError):
        read(**wrong)


def test_a_group_does_not_change():
    with pytest.raises(ValidationError):
        Noise().blur = 1.0
