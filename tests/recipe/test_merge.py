"""Layers of a recipe are merged: each leaf keeps its place."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr.recipe.merge import assign, merge, normalize
from pcsr.recipe.source import Location, parse
from tests.recipe.sources import source

LEAVES = st.integers(0, 9) | st.text("xyz", max_size=2) | st.lists(st.integers(0, 9), max_size=2)
NAMES = st.sampled_from("abcd")
TREES = st.recursive(st.dictionaries(NAMES, LEAVES), lambda inner: st.dictionaries(NAMES, inner | LEAVES), max_leaves=8)


def slow_merge(under, over):
    """The definition: keys of either; mappings merged, everything else from above."""
    if not (isinstance(under, dict) and isinstance(over, dict)):
        return over
    both = {key: slow_merge(under[key], over[key]) for key in under.keys() & over.keys()}
    return {**under, **over, **both}


@given(TREES, TREES)
def test_merge_is_its_definition(a, b):
    assert merge(source(a), source(b)).data == slow_merge(a, b)


@given(TREES)
def test_merging_with_nothing_changes_nothing(a):
    assert merge(source(a), source({})).data == merge(source({}), source(a)).data == a


@given(TREES, TREES, TREES)
def test_merge_is_associative_of_trees_that_agree_on_what_is_a_mapping(a, b, c):
    # A leaf that replaces a mapping forgets what was in it, so that the order matters: keep the shapes apart.
    a, b, c = (_sections(tree) for tree in (a, b, c))
    left = merge(merge(source(a), source(b)), source(c))
    right = merge(source(a), merge(source(b), source(c)))
    assert left.data == right.data


def _sections(tree):
    """The same tree with mappings and leaves under different names."""
    return {
        f"{key}-map" if isinstance(value, dict) else key: _sections(value) if isinstance(value, dict) else value
        for key, value in tree.items()
    }


@given(TREES, TREES)
def test_each_leaf_keeps_the_place_of_the_file_that_it_came_from(a, b):
    merged = merge(source(a, "under"), source(b, "over"))

    def leaves(node, keys=()):
        if isinstance(node, dict) and node:
            for key, value in node.items():
                yield from leaves(value, (*keys, key))
        else:
            yield keys

    for keys in leaves(merged.data):
        written = b
        for key in keys:
            written = written.get(key, ...) if isinstance(written, dict) else ...
        from_over = written is not ... and written == _at(merged.data, keys) and not (written == {} and keys)
        if from_over and keys:
            assert merged.location(keys).origin == "over"
        elif keys and written is ...:
            assert merged.location(keys).origin == "under"


def _at(node, keys):
    for key in keys:
        node = node[key]
    return node


@given(TREES, TREES)
def test_merge_changes_neither_of_the_two(a, b):
    under, over = source(a), source(b)
    merged = merge(under, over)
    merged.data["new"] = 1
    for value in merged.data.values():
        if isinstance(value, list):
            value.append("changed")
    assert (under.data, over.data) == (a, b)


def model(text):
    return normalize(parse(f"model: {{encoder: {text}}}", "file"))


@pytest.mark.parametrize(
    ("under", "over", "expected"),
    [
        ("net", "net", {"use": "net"}),
        ("{use: net, channels: 4}", "net", {"use": "net", "channels": 4}),
        ("{use: net, channels: 4}", "{channels: 8}", {"use": "net", "channels": 8}),
        ("net", "{channels: 8}", {"use": "net", "channels": 8}),
        ("{use: net, channels: 4}", "mlp", {"use": "mlp"}),
        ("{use: net, channels: 4}", "{use: mlp, width: 2}", {"use": "mlp", "width": 2}),
        ("{use: net, channels: 4}", "null", None),
        ("null", "net", {"use": "net"}),
    ],
)
def test_options_go_with_their_part(under, over, expected):
    assert merge(model(under), model(over)).data == {"model": {"encoder": expected}}


@given(st.lists(st.sampled_from("abcd"), min_size=1, max_size=3), LEAVES, TREES)
def test_set_is_a_merge_of_one_value(keys, value, tree):
    made = source(tree)
    assign(made, tuple(keys), value, Location("--set"))
    nested = value
    for key in reversed(keys):
        nested = {key: nested}
    assert made.data == slow_merge(tree, nested)
    assert made.location(tuple(keys)) == Location("--set")
