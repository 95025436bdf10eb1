"""Recipes that a stranger wrote: each refused in one line or a few, soon, and nothing is left behind."""

import os

import pytest

GOOD = """name: a
model:
  encoder: {use: unet, channels: 8}
  fusion: none
  backbone: {use: pu-transformer, channels: [8, 8]}
  upsampler: shuffle
"""
LAUGHS = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 10)
)
MERGES = "a0: &a0 {k: 1}\n" + "".join(f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 10)}]}}\n" for i in range(1, 10))


@pytest.fixture
def check(limited, tmp_path):
    def run(text="", *options, name="recipe.yaml", **bounds):
        if text:
            (tmp_path / name).write_text(text)
        before = sorted(tmp_path.rglob("*"))
        outcome = limited("recipe", "check", name, *options, folder=tmp_path)
        assert sorted(tmp_path.rglob("*")) == before
        return outcome

    return run


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"{LAUGHS}name: a", ["recipe.yaml: more than 10000 values", "aliases"]),
        (f"{MERGES}name: a", ["recipe.yaml: more than 10000 values", "aliases"]),
        (f"? {'[' * 20}a{']' * 20}\n: 1", ["recipe.yaml:1:1: a key is a name"]),
        ("name: a\nmodel: &m {<<: *m}", ["recipe.yaml:2:8: `<<` merges a mapping into itself"]),
        ("name: a\nmodel: {<<: null}", ["recipe.yaml:2:8: `<<` merges mappings in"]),
        ("a: " + 100_000 * "[", ["recipe.yaml: nested in more than 32 levels"]),
        ("a: " + 60 * "[" + 60 * "]", ["nested in more than 32 levels"]),
        ("\n".join(f"{' ' * i}a:" for i in range(300)), ["nested in more than 32 levels"]),
        (f"name: a\n{'k' * 1_000}: 1", ["recipe.yaml:2:1: a recipe", "takes no 'kkk"]),
        (f"name: {'a' * 300}", ["recipe.yaml:1:7: name: it must be up to 200 of a-z, 0-9, ., _ and -"]),
        (f"name: a\nseed: {'1' * 100_000}", ["recipe.yaml:2:7: a whole number has at most 100 digits, got 100000"]),
        ("name: a\ntrain: {epochs: 1000000000000000000000}", ["train.epochs: it must be at most 1000000"]),
        ("name: a\ntrain: {batch: 1000000000}", ["train.batch: it must be at most 65536"]),
        ("name: a\ntrain: {learning_rate: 1e400}", ["train.learning_rate: it must be a finite number"]),
        ("name: a\nseed: 2026-01-01", ["recipe.yaml:2:7: a date is not plain data"]),
        ("name: a\nseed: !!binary aGk=", ["remove the tag !!binary"]),
        ("name: a\nmodel: !!set {a, b}", ["remove the tag !!set"]),
        ("name: a\nmatrix: {seed: [" + ", ".join(map(str, range(10_000))) + "]}", ["more than 10000 values"]),
        ("name: a\nmatrix: {seed: [" + ", ".join(map(str, range(2_000))) + "]}", ["it has 2000 runs", "at most 1000"]),
        (
            "name: a\nmatrix:\n" + "".join(f"  data.k{i}: [{', '.join(map(str, range(100)))}]\n" for i in range(10)),
            ["recipe.yaml:3:3: it has", "at most 1000"],
        ),
        (f"name: a\nrecipes: [{', '.join(['b.yaml'] * 5_000)}]", ["recipes names 5000 recipes", "at most 1000"]),
        ("name: a\nrecipes: [recipe.yaml]", ["recipe.yaml:2:11", "is a study itself"]),
        ('name: a\nextends: "b\\0.yaml"', ["recipe.yaml:2:10: there is no recipe", "extends is relative"]),
        ("name: a\nextends: ~nosuchuser/b.yaml", ["there is no recipe ~nosuchuser/b.yaml"]),
        ("name: a\nextends: ..", ["there is no recipe .."]),
        (f"name: a\nextends: {'b' * 300}", ["there is no recipe 'bbb"]),
        ("name: a\nextends: [b, c]", ["extends must be one recipe file"]),
        ('name: a\nweights: "b\\0"', ["recipe.yaml:2:10: there are no weights"]),
        (f"name: a\nweights: {'b' * 300}", ["recipe.yaml:2:10: there are no weights"]),
        ("name: a\nweights: ~nosuchuser/b", ["recipe.yaml:2:10: there are no weights"]),
        ("\0", ["recipe.yaml: not YAML"]),
    ],
)
def test_one_line_says_what_is_wrong(check, text, words):
    check(text).refused(*words)


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("model.encoder.channels=0", "encoder 'unet'.channels: it must be 2 or more, got 0"),
        ("model.encoder.channels=-1", "encoder 'unet'.channels: it must be 2 or more, got -1"),
        ("model.encoder.channels=1000000000", "encoder 'unet'.channels: it must be at most 2048, got 1000000000"),
        (
            "model.backbone.channels=[]",
            "backbone 'pu-transformer'.channels: it must be a list of 1 item or more, got []",
        ),
        ("model.backbone.neighbours=0", "backbone 'pu-transformer'.neighbours: it must be 1 or more, got 0"),
        ("model.upsampler.hidden=0xffffffffffffffffffffffff", "upsampler 'shuffle'.hidden: it must be at most 2048"),
        ("evaluate.published={a: 1e999}", "evaluate.published.a: it must be a finite number, got inf"),
        (f"{'.'.join('a' * 3000)}=1", "it nests 3000 keys"),
        (f"name={'a' * 100_000}", "name: it must be up to 200 of"),
        (f"{'a' * 100_000}=1", "a recipe takes no 'aaa"),
        (f"seed={'[' * 10_000}", "nested in more than 32 levels"),
        (f"seed={'1' * 100_000}", "a whole number has at most 100 digits"),
        ("=", "write --set dotted.key=value"),
        ("", "write --set dotted.key=value"),
        ("\0=1", "a recipe takes no"),
    ],
)
def test_an_option_beyond_its_limits_is_named_with_them(check, option, words):
    outcome = check(GOOD, "--set", option)
    outcome.refused(words)
    assert len(outcome.err) < 1000


def test_many_unknown_keys_are_told_in_part(check):
    outcome = check("name: a\n" + "".join(f"k{i}: 1\n" for i in range(9_000)))
    assert outcome.code == 2
    lines = outcome.err.splitlines()
    assert len(lines) == 101
    assert lines[-1] == "and 8900 more mistakes"
    assert outcome.seconds < 20  # 4 without load
    assert outcome.megabytes < 300


def test_more_unknown_keys_than_a_recipe_has_values(check):
    check("name: a\n" + "".join(f"k{i}: 1\n" for i in range(30_000))).refused("larger than 262144 bytes")
    check("name: a\n" + "".join(f"k{i}: 1\n" for i in range(12_000))).refused("more than 10000 values", seconds=20)


def test_many_options_are_refused(check):
    check(GOOD, *["--set", "seed=1"] * 1_001).refused("--set is given 1001 times")


def test_many_options_that_are_allowed_are_laid_over(check):
    outcome = check(GOOD, *[f"--set=evaluate.published.k{i}=1" for i in range(1_000)])
    outcome.refused("evaluate.published: it must be", "at most 64 items", seconds=20)


def test_a_matrix_of_mistakes_ends_early(check):
    seeds = ", ".join(map(str, range(1_000)))
    outcome = check(f"name: a\nmatrix: {{seed: [{seeds}]}}\n" + "".join(f"k{i}: 1\n" for i in range(3_000)))
    assert outcome.code == 2
    assert outcome.err.splitlines()[-1].startswith("and ")
    assert outcome.seconds < 20
    assert outcome.megabytes < 300


def test_recipes_that_extend_each_other_without_end(check, tmp_path):
    for i in range(1_000):
        (tmp_path / f"r{i}.yaml").write_text(f"name: a\nextends: r{i + 1}.yaml")
    check(name="r0.yaml").refused("more than 32 recipes extend each other")


def test_what_is_no_file_is_not_read(check, tmp_path):
    check(name="/dev/zero").refused("/dev/zero is no file but a pipe or a device")
    os.mkfifo(tmp_path / "pipe.yaml")
    check(name="pipe.yaml").refused("pipe.yaml is no file but a pipe or a device")
    check(name=".").refused("cannot be read: Is a directory")
    with (tmp_path / "large.yaml").open("wb") as file:
        file.truncate(1 << 30)
    check(name="large.yaml").refused("large.yaml is larger than 262144 bytes", megabytes=50)
    check("name: a\nextends: large.yaml").refused("large.yaml is larger than 262144 bytes", megabytes=50)
