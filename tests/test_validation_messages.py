"""pydantic's errors in plain words: every kind of constraint that schemas of ours have."""

from typing import Annotated, Any, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model, model_validator

from pcsr.validation_messages import LONGEST, explained, shown


def said(kind: Any, value: Any) -> str:
    model = create_model("Model", __config__=ConfigDict(strict=True, allow_inf_nan=False), x=(kind, ...))
    with pytest.raises(ValidationError) as caught:
        model.model_validate({"x": value})
    return explained(caught.value.errors())


@pytest.mark.parametrize(
    ("kind", "value", "expected"),
    [
        (int, "many", "it must be a whole number, got 'many'"),
        (int, 1.5, "it must be a whole number, got 1.5"),
        (float, "1", "it must be a number, got '1'"),
        (float, float("inf"), "it must be a finite number, got inf"),
        (bool, 1, "it must be true or false, got 1"),
        (str, 3, "it must be text, got 3"),
        (None, 3, "it must be null, got 3"),
        (list[int], 3, "it must be a list, got 3"),
        (tuple[int, ...], {}, "it must be a list, got {}"),
        (dict[str, int], 3, "it must be a mapping, got 3"),
        (Annotated[int, Field(gt=0)], 0, "it must be more than 0, got 0"),
        (Annotated[int, Field(ge=1)], 0, "it must be 1 or more, got 0"),
        (Annotated[float, Field(lt=0.5)], 1.0, "it must be less than 0.5, got 1.0"),
        (Annotated[float, Field(le=3.0)], 4.0, "it must be at most 3, got 4.0"),
        (Annotated[int, Field(multiple_of=2)], 3, "it must be a multiple of 2, got 3"),
        (Literal["a", "b"], "c", "it must be 'a' or 'b', got 'c'"),
        (Annotated[list[int], Field(min_length=1)], [], "it must be a list of 1 item or more, got []"),
        (Annotated[list[int], Field(max_length=2)], [1, 2, 3], "it must be a list of at most 2 items, got [1, 2, 3]"),
        (Annotated[str, Field(min_length=1)], "", "it must be text of 1 character or more, got ''"),
        (Annotated[str, Field(max_length=2)], "abc", "it must be text of at most 2 characters, got 'abc'"),
        (Annotated[str, Field(pattern="^[ab]$")], "c", "it must be text that matches ^[ab]$, got 'c'"),
        (int | str | None, 1.5, "it must be a whole number or text, got 1.5"),
    ],
)
def test_what_a_value_must_be_and_what_it_is(kind, value, expected):
    assert said(kind, value) == expected


def test_a_validator_speaks_for_itself():
    class Pair(BaseModel):
        low: int
        high: int

        @model_validator(mode="after")
        def ordered(self):
            if self.low > self.high:
                raise ValueError("'low' is more than 'high'")
            return self

    assert said(Pair, {"low": 2, "high": 1}) == "'low' is more than 'high'"


def test_a_value_is_shown_in_one_short_line():
    for value in ("a" * 10**6, "\n\x00", list(range(10**5)), 10**10_000, -(10**10_000), [10**10_000]):
        assert len(shown(value)) <= LONGEST + 1
        assert shown(value).isprintable()


def test_a_list_that_holds_itself_is_shown():
    endless: list[Any] = []
    endless.append(endless)
    assert shown(endless) == "[[[[[...]]]]]"


def test_a_short_value_is_shown_as_it_is():
    assert [shown(one) for one in ("a", 3, 1.5, None, [1, "b"])] == ["'a'", "3", "1.5", "None", "[1, 'b']"]
    assert shown(10**10_000) == "a number of about 10000 digits"


def test_lists_in_lists_that_would_never_end():
    value = [0]
    for _ in range(64):  # written out it has 2^64 numbers
        value = [value, value]
    assert len(shown(value)) <= LONGEST + 1
