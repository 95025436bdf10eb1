"""Options beyond what they can be: each refused in one line that names it, and no file is left behind."""

import numpy as np
import pytest

ANYTHING = [
    ["--rate", "nan"],
    ["--rate", "inf"],
    ["--rate", "1e308"],
    ["--rate", "-4"],
    ["--rate", "1"],
    ["--points", "-1"],
    ["--points", "0"],
    ["--points", "1" + 30 * "0"],
    ["--points", "1000000000000"],
    ["--rate", "4", "--points", "200"],
    ["--model", ""],
    ["--model", "b" * 300],
    ["--model", "~nosuchuser/w.safetensors"],
    ["--model", "a\0b"],
    ["--device", "meta"],
    ["--device", "mps"],
    ["--device", "cpu:1"],
    ["--device", "cuda:" + "9" * 5000],
    ["--device", ""],
    ["--jobs", "0"],
    ["--jobs", "1" + 18 * "0"],
    ["--format", "", "-o", "-"],
    ["--format", "nonsense", "-o", "-"],
    ["--scheduler", ""],
    ["--scheduler", "nonsense"],
    ["--touch", "nothing"],
    ["--touch", "a\0b"],
    ["--mesh", "out.nonsense"],
    ["--plugin", "nothing.py"],
    ["--plugin", ""],
    ["--plugin", "a\0b.py"],
    ["--plugin", "~nosuchuser/a.py"],
    ["--plugin", "b" * 300],
]


@pytest.fixture
def cloud(tmp_path):
    np.savetxt(tmp_path / "in.xyz", np.random.default_rng(0).normal(size=(60, 3)))
    return tmp_path


@pytest.fixture
def refused(limited, cloud):
    def run(*arguments, words=(), code=2):
        before = sorted(cloud.rglob("*"))
        limited(*arguments, folder=cloud).refused(*words, code=code)
        assert sorted(cloud.rglob("*")) == before

    return run


def last_line(outcome):
    return outcome.err.strip().splitlines()[-1]


@pytest.mark.parametrize("options", ANYTHING, ids=lambda options: " ".join(options)[:40].replace("\0", "NUL"))
def test_an_option_of_upsample(limited, cloud, options):
    before = sorted(cloud.rglob("*"))
    output = [] if "-o" in options else ["-o", "out.ply"]
    outcome = limited("upsample", "in.xyz", *output, "--model", "midpoint", *options, folder=cloud)
    assert outcome.code == 2, (outcome.code, outcome.out, outcome.err)
    assert "--traceback" not in outcome.err
    assert "Traceback" not in outcome.err
    assert options[0].lstrip("-").split("-")[0] in last_line(outcome), outcome.err
    assert len(last_line(outcome)) < 500
    assert outcome.seconds < 10
    assert outcome.megabytes < 300
    assert sorted(cloud.rglob("*")) == before


@pytest.mark.parametrize(
    "output", ["", "a\0b.ply", "b" * 300 + ".ply", "in.xyz/out.ply", "/dev/full", "/dev/full/out.ply", "out", "."]
)
def test_an_output_that_cannot_be(limited, cloud, output):
    before = sorted(cloud.rglob("*"))
    outcome = limited("upsample", "in.xyz", "-o", output, "--model", "midpoint", folder=cloud)
    assert outcome.code in (1, 2), (outcome.code, outcome.out, outcome.err)
    assert "--traceback" not in outcome.err
    assert sorted(cloud.rglob("*")) == before


def test_an_output_that_is_the_input_and_one_in_a_new_folder(limited, cloud):
    given = np.loadtxt(cloud / "in.xyz")
    outcome = limited("upsample", "in.xyz", "-o", "new/folder/out.xyz", "--model", "midpoint", folder=cloud)
    assert outcome.code == 0, outcome.err
    assert limited("upsample", "in.xyz", "-o", "in.xyz", "--model", "midpoint", folder=cloud).code == 0
    made = np.loadtxt(cloud / "in.xyz")
    np.testing.assert_array_equal(made[:60], given)
    np.testing.assert_array_equal(made, np.loadtxt(cloud / "new/folder/out.xyz"))


def test_the_last_of_one_option_given_twice_counts(limited, cloud):
    options = ["--points", "100", "--points", "90", "-o", "a.xyz", "-o", "out.xyz", "--model", "midpoint"]
    assert limited("upsample", "in.xyz", *options, folder=cloud).code == 0
    assert len(np.loadtxt(cloud / "out.xyz")) == 90
    assert not (cloud / "a.xyz").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["upsample", ""],
        ["upsample", "a\0b"],
        ["evaluate", "a\0b", "in.xyz"],
        ["run", ""],
        ["run", "a\0b"],
        ["run", "recipe.yaml", "--jobs", "1" + 18 * "0"],
        ["run", "recipe.yaml", "--devices", "1" + 18 * "0"],
        ["run", "recipe.yaml", "--nodes", "1" + 18 * "0"],
        ["run", "recipe.yaml", "--device", "meta"],
        ["run", "recipe.yaml", "--runs", "a\0b"],
        ["run", "recipe.yaml", "--data", "b" * 300],
        ["compare", "recipe.yaml", "--seeds", "1" + 18 * "0"],
        ["compare", "recipe.yaml", "--name", "b" * 300],
        ["compare", "recipe.yaml", "--fusion", ""],
        ["recipe", "check", "a\0b"],
        ["recipe", "check", "b" * 300],
        ["plugins", "check", ""],
        ["plugins", "check", "a\0b"],
        ["plugins", "check", "unet", "--kind", ""],
        ["plugins", "check", "unet", "--set", "channels=" + "1" * 10_000],
        ["plugins", "check", "unet", "--set", "=" * 10_000],
        ["plugins", "check", "unet", "--time-limit", "0"],
        ["plugins", "check", "unet", "--time-limit", "nan"],
        ["plugins", "check", "digit", "--mesh", "a\0b"],
        ["plugins", "new", "fusion", "a\0b"],
        ["plugins", "new", "fusion", "b" * 300],
        ["plugins", "--plugin", "a\0b"],
        ["nonsense\0"],
        [""],
        ["--nonsense"],
    ],
    ids=lambda arguments: " ".join(arguments)[:40].replace("\0", "NUL"),
)
def test_arguments_of_the_other_commands(limited, cloud, arguments):
    (cloud / "recipe.yaml").write_text("name: a\ntrain: {epochs: 1}\n")
    before = sorted(cloud.rglob("*"))
    outcome = limited(*arguments, folder=cloud)
    assert outcome.code == 2, (outcome.code, outcome.out, outcome.err)
    assert "Traceback" not in outcome.err
    assert "--traceback" not in outcome.err
    assert len(last_line(outcome)) < 500
    assert outcome.seconds < 10
    assert outcome.megabytes < 300
    assert sorted(cloud.rglob("*")) == before


def test_commands_without_their_arguments(limited, cloud):
    for command in ("upsample", "evaluate", "run", "compare", "figures", "export", "view"):
        outcome = limited(command, folder=cloud)
        assert outcome.code == 2, (command, outcome)
        assert "Traceback" not in outcome.err
