"""A plugin that was written for pcsr 0.1 fails with the new name of each old one."""

from pathlib import Path

import pytest

import pcsr
from pcsr import Fusion, Objective, TouchSource, Upsampler, UserError
from pcsr.plugins import renamed
from pcsr.plugins.loading import load_plugins, why

OLD = Path(__file__).parents[1] / "version_0_1"
EXAMPLES = {
    "pcsr-fusion-attention/pcsr_fusion_attention.py": [
        "Touches is now TouchBatch",
        "Trait.POINT_ORDER_FREE is now Trait.PERMUTATION_EQUIVARIANT",
        "Trait.TOUCH_ORDER_FREE is now Trait.TOUCH_PERMUTATION_INVARIANT",
    ],
    "pcsr-touch-taxels/pcsr_touch_taxels.py": [
        "Item is now ShapeItem",
        "Touch.of_one_finger is now Touch.single",
        ".thinned is now Touch.resampled",
        ".places is now MeshRays.surface_points",
    ],
}


@pytest.mark.parametrize(("file", "names"), EXAMPLES.items())
def test_the_examples_of_0_1_fail_with_each_new_name(file, names):
    registry = load_plugins([OLD / file])
    (failure,) = registry.failures
    assert "it was written for pcsr 0.1" in failure.message
    for name in names:
        assert name in failure.message
    assert failure.message in why(registry, str(OLD / file))


def test_an_old_name_of_the_package_names_the_new_one():
    for old, new in renamed.PUBLIC.items():
        with pytest.raises(ImportError, match=f"pcsr.{old} is now pcsr.{new}"):
            getattr(pcsr, old)
        assert new in pcsr.__all__


@pytest.mark.parametrize(
    ("base", "old", "value"),
    [
        (TouchSource, "places", frozenset({"folder"})),
        (Fusion, "hears_features", False),
        (Fusion, "anchors", True),
        (Upsampler, "at_once", 8),
        (Objective, "pace", 0.1),
    ],
)
def test_an_old_attribute_is_not_ignored(base, old, value):
    part = type("Mine", (base,), {old: value})
    with pytest.raises(UserError, match=f"Mine was written for pcsr 0.1: {old} is now {renamed.ATTRIBUTES[old]}"):
        renamed.check_class(part)
    assert hasattr(base, renamed.ATTRIBUTES[old])
    renamed.check_class(type("Method", (base,), {old: lambda self: value}))


def test_all_old_names_of_a_file_are_found(tmp_path):
    file = tmp_path / "plugin.py"
    file.write_text(
        "import pcsr\nfrom pcsr import Shapes\n"
        "class A(pcsr.Upsampler):\n    at_once: int = 8\n    traits = {pcsr.Trait.POINT_ORDER_FREE}\n"
        "class B(Shapes):\n    places = frozenset()\n"
    )
    found = renamed.old_names([file])
    for text in (
        "Shapes is now ShapeSource",
        "at_once is now max_rate_per_pass",
        "pcsr.Trait.POINT_ORDER_FREE is now pcsr.Trait.PERMUTATION_EQUIVARIANT",
        "places is now path_options",
    ):
        assert text in found
    file.write_text("from pcsr import ShapeSource\nplaces = 3\n")
    assert renamed.old_names([file, tmp_path / "missing.py"]) == ""
    file.write_text("not Python")
    assert renamed.old_names([file]) == ""


def test_no_part_takes_the_old_name_of_another(tmp_path):
    file = tmp_path / "fan.py"
    file.write_text(
        "import pcsr\nclass Fan(pcsr.Upsampler): pass\n"
        "@pcsr.hookimpl\ndef pcsr_register(register): register.upsampler('fan', Fan)\n"
    )
    (failure,) = load_plugins([file]).failures
    assert "had in pcsr 0.1" in failure.message
    assert "rename it" in failure.message
