"""Reading YAML: plain data with locations, and what is not plain data."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from pcsr.errors import UserError
from pcsr.recipe.source import Location, RecipeError, parse, read, scalar

KEYS = st.text("abcxyz-_", min_size=1, max_size=6)
TREES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(max_codepoint=0xD7FF)),  # JSON escapes the rest as two surrogates
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=4),
    max_leaves=12,
)


@settings(max_examples=40, deadline=None)
@given(st.dictionaries(KEYS, TREES, min_size=1, max_size=4))
def test_json_is_read_as_json_reads_it(tree):
    assert parse(json.dumps(tree), "file").data == tree  # JSON is YAML 1.2


@settings(max_examples=40, deadline=None)
@given(st.dictionaries(KEYS, TREES, min_size=1, max_size=4), st.booleans())
def test_every_value_has_the_place_where_its_text_stands(tree, flow):
    text = json.dumps(tree, indent=None if flow else 2)
    rows = text.splitlines()
    source = parse(text, "file")
    for keys, location in source.names.items():
        assert rows[location.line - 1][location.column - 1 :].startswith(f'"{keys[-1]}"')
    for keys, location in source.values.items():
        node = source.data
        for key in keys:
            node = node[key]
        start = json.dumps(node)[0]
        assert rows[location.line - 1][location.column - 1] == start


def test_it_is_yaml_1_2():
    data = parse("a: 1e-3\nb: no\nc: 0o17\nd: on", "file").data
    assert data == {"a": 1e-3, "b": "no", "c": 15, "d": "on"}
    assert [type(value) for value in data.values()] == [float, str, int, str]  # not ruamel's own types


def test_aliases_and_merge_keys_are_plain_data():
    source = parse("one: &x {k: 1, l: &y true}\ntwo: {<<: *x, k: 2}\nthree: *y", "file")
    assert source.data == {"one": {"k": 1, "l": True}, "two": {"k": 2, "l": True}, "three": True}
    assert source.location(("two", "l")) == Location("file", 2, 6)  # merged in: the place of what it went into
    assert not source.mistakes


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a: [1, 2\nb: 3", "file:2:2: expected ',' or ']', but got ':': correct the YAML there"),
        ("a: 'open", "file:1:9: found unexpected end of stream: correct the YAML there"),
        ("\ta: 1", "file:1:1: found character '\\t' that cannot start any token: correct the YAML there"),
        ("- a\n- b", "file:1:1: a recipe is a mapping: it starts with `name: …`"),
        ("", "file:1:1: a recipe is a mapping: it starts with `name: …`"),
        ("a: 1\n---\nb: 2", "file:2:1: but found another document: correct the YAML there"),
        ("a: \x07", "file: not YAML: "),
        ("a: " + 400 * "[", "file"),
    ],
)
def test_what_is_not_a_recipe(text, expected):
    with pytest.raises(RecipeError) as caught:
        parse(text, "file")
    assert str(caught.value).startswith(expected), str(caught.value)
    assert "\n" not in str(caught.value)


def test_every_key_that_is_written_twice_is_collected():
    source = parse("name: a\ndata: {rate: 1, rate: 2}\nname: b\nlist: [{k: 1}, {k: 2}]\nname: c", "file")
    assert sorted(map(str, source.mistakes)) == [
        "file:2:17: 'rate' is written twice: remove one of the two",
        "file:3:1: 'name' is written twice: remove one of the two",
        "file:5:1: 'name' is written twice: remove one of the two",
    ]
    assert source.data == {"name": "a", "data": {"rate": 1}, "list": [{"k": 1}, {"k": 2}]}
    assert source.location(("name",)) == Location("file", 1, 7)
    assert not parse("name: a", "file").mistakes  # nothing is left over from another file


def test_what_is_not_plain_data_is_collected():
    source = parse("&r\na: !!python/object/apply:os.system [echo]\nb: {c: !env HOME}\nd: *r\ne: 2026-13-01", "file")
    assert source.data == {"a": None, "b": {"c": None}, "d": None, "e": None}
    locations = [str(mistake.location) for mistake in source.mistakes]
    assert locations == [
        "file:2:4",
        "file:3:8",
        "file:1:1",
        "file:5:4",
    ]  # an alias has the place of what it stands for
    assert "remove the tag" in source.mistakes[0].text
    assert "!env" in source.mistakes[1].text
    assert "alias" in source.mistakes[2].text
    assert "put it in quotes" in source.mistakes[3].text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a: {<<: null}", "file:1:4: `<<` merges mappings in"),
        ("a: {<<: [1, 2]}", "file:1:4: `<<` merges mappings in"),
        ("a: &a {<<: *a}", "file:1:4: `<<` merges a mapping into itself"),
        ("a: &a {b: {<<: *a}}", "file:1:11: `<<` merges a mapping into itself"),
        ("? [a, b]\n: 1", "file:1:1: a key is a name"),
        ("a: !!binary aGk=", "file:1:4: recipes are plain data: remove the tag !!binary"),
        ("a: !!set {b, c}", "file:1:4: recipes are plain data: remove the tag !!set"),
        ("a: !!int few", "file:1:4: 'few' is no int: remove the tag"),
        (f"a: {'1' * 5000}", "file:1:4: a whole number has at most 100 digits, got 5000"),
        (f"a: 0x{'f' * 5000}", "file:1:4: a whole number has at most 100 digits, got 5002"),
    ],
)
def test_what_yaml_has_and_recipes_have_not(text, expected):
    (mistake,) = set(parse(text, "file").mistakes)
    assert str(mistake).startswith(expected)


def test_merge_keys_keep_the_order_of_yaml():
    text = "a: &a {k: 1, l: 1}\nb: &b {k: 2, m: 2}\nc: {<<: [*a, *b], l: 3}\nd: &d {<<: *a}\ne: {<<: *d}"
    source = parse(text, "file")
    assert source.data["c"] == {"l": 3, "k": 1, "m": 2}
    assert source.data["e"] == {"k": 1, "l": 1}
    assert not source.mistakes


def test_the_mistakes_that_are_told_have_an_end():
    source = parse("\n".join(f"a{i}: !x 1" for i in range(130)), "file")
    lines = str(RecipeError(source.mistakes)).splitlines()
    assert len(lines) == 101
    assert lines[-1] == "and 30 more mistakes"


def test_a_file_that_cannot_be_read(tmp_path):
    with pytest.raises(UserError, match=r"nothing\.yaml cannot be read: No such file"):
        read(tmp_path / "nothing.yaml")
    (tmp_path / "latin.yaml").write_bytes("name: é".encode("latin-1"))
    with pytest.raises(UserError, match=r"latin\.yaml is not UTF-8 text: .* at byte 6"):
        read(tmp_path / "latin.yaml")


@settings(max_examples=40, deadline=None)
@given(TREES)
def test_a_scalar_is_any_yaml(tree):
    assert scalar(json.dumps(tree), Location("--set a")) == tree


@pytest.mark.parametrize("text", ["[1", "{a: 1, a: 2}", "!env HOME"])
def test_a_scalar_that_is_not_plain_yaml(text):
    with pytest.raises(RecipeError, match=r"^--set a: "):
        scalar(text, Location("--set a"))


def test_the_safe_loader_agrees():
    text = "a: [1, 2.5, x]\nb: {c: null, d: true}\n"
    assert parse(text, "file").data == YAML(typ="safe", pure=True).load(text)
