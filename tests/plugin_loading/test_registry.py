"""The registry: parts by kind and name, loaded when asked for, and errors that say what to do."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr.contracts import Encoder, Fusion
from pcsr.errors import UserError, did_you_mean
from pcsr.plugins.registry import KINDS, Entry, Failure, Register, Registry


class Good(Fusion):
    """A fusion."""


def filled(*names, kind="fusion"):
    registry = Registry()
    for name in names:
        registry.add(Entry(kind, name, Good, "owner", "1"))
    return registry


def test_a_part_is_found_by_kind_and_name():
    registry = filled("good")
    registry.add(Entry("fusion", "lazy", f"{__name__}:Good", "owner", "1"))
    assert registry.get("fusion", "good") is Good
    with pytest.raises(UserError, match="there is no encoder 'good': none is known"):
        registry.get("encoder", "good")


def test_a_part_given_as_text_is_imported_when_asked_for():
    registry = Registry()
    registry.add(Entry("encoder", "late", "pcsr.contracts:Encoder", "owner", "1"))
    assert registry.get("encoder", "late") is Encoder


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ("no_such_module:X", "cannot be loaded from 'no_such_module:X': ModuleNotFoundError"),
        ("pcsr.contracts:Nothing", "cannot be loaded from 'pcsr.contracts:Nothing': AttributeError"),
        ("pcsr.contracts", "cannot be loaded from 'pcsr.contracts'"),
        ("pcsr.contracts:Encoder", "is not a Fusion: derive it from pcsr.Fusion"),
        (int, "is <class 'int'>, which is not a Fusion"),
        ("math:pi", "is 3.14"),
    ],
)
def test_a_part_that_is_none(target, said):
    registry = Registry()
    registry.add(Entry("fusion", "bad", target, "someone", "1"))
    with pytest.raises(UserError) as caught:
        registry.get("fusion", "bad")
    assert str(caught.value).startswith("fusion 'bad' of someone ")
    assert said in str(caught.value)


def test_an_unknown_name_offers_the_closest_or_all():
    registry = filled("iterative", "concat")
    with pytest.raises(UserError, match=r"^there is no fusion 'iterativ': did you mean 'iterative'\?$"):
        registry.get("fusion", "iterativ")
    with pytest.raises(UserError, match=r"^there is no fusion 'zzz': known: concat, iterative$"):
        registry.get("fusion", "zzz")


def test_an_unknown_name_points_at_plugins_that_failed():
    registry = filled("concat")
    registry.failures.append(Failure("pcsr-fusion-x", "1", ValueError()))
    with pytest.raises(UserError, match=r"failed to load: pcsr-fusion-x; see `pcsr plugins --why x`"):
        registry.get("fusion", "x")


def test_a_name_taken_twice_names_both_owners_and_keeps_the_first():
    registry = filled("good")
    with pytest.raises(UserError, match="fusion 'good' is registered twice, by owner and by other: rename one"):
        registry.add(Entry("fusion", "good", "x:Y", "other", "1"))
    assert registry.get("fusion", "good") is Good
    registry.add(Entry("encoder", "good", "x:Y", "other", "1"))  # another kind is another name


def test_an_unknown_kind():
    with pytest.raises(UserError, match="'fusoin' is not a kind of part: did you mean 'fusion'"):
        Registry().add(Entry("fusoin", "good", Good, "owner", "1"))


@given(st.lists(st.sampled_from("abcdef"), unique=True))
def test_names_are_sorted_whatever_the_order_of_registration(names):
    registry = filled(*names)
    assert registry.names("fusion") == sorted(names)
    assert [entry.name for entry in registry] == sorted(names)
    assert registry.names("encoder") == []


def test_the_register_has_a_method_for_each_kind():
    registry = Registry()
    for kind in KINDS:
        getattr(Register(registry, "owner", "2"), kind)("one", "x:Y")
    assert [(e.kind, e.name, e.target, e.owner, e.version) for e in registry] == [
        (kind, "one", "x:Y", "owner", "2") for kind in KINDS
    ]


@given(st.text(min_size=1), st.sets(st.text(min_size=1)))
def test_did_you_mean_only_says_what_is_known(name, known):
    said = did_you_mean(name, known)
    if said.startswith("did you mean '"):
        assert said.removeprefix("did you mean '").removesuffix("'?") in known
    else:
        assert said == (f"known: {', '.join(sorted(known))}" if known else "none is known")
