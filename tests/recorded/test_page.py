"""docs/recorded.md: its examples are right, it names every layout, key and turn."""

import json
import re
from pathlib import Path

import numpy as np

from pcsr.recorded.fields import UNITS
from pcsr.recorded.layouts import LAYOUTS
from pcsr.recorded.manifest import GraspEntry, LayoutManifest, RecordingManifest, check_entry, checked
from pcsr.recorded.pose import rotation_from, sensor_to_object

PAGE = (Path(__file__).parents[2] / "docs" / "recorded.md").read_text(encoding="utf-8")
EXAMPLES = [json.loads(text) for text in re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)]


def test_the_examples_of_the_page_are_right():
    manifests = [example for example in EXAMPLES if "touches" in example]
    for example in manifests:
        recorded = checked(RecordingManifest, example, "")
        for index, value in enumerate(recorded.touches):
            entry = check_entry(value, f"touches.{index}")
            fingers = entry.fingers if isinstance(entry, GraspEntry) else [value]
            for finger in fingers:
                pose = check_entry(finger, "finger", in_grasp=True).pose
                sensor_to_object(pose, recorded.unit, recorded.object_unit)
    said = [checked(LayoutManifest, example, "").layout for example in EXAMPLES if "layout" in example]
    for layout in said:
        options, _ = LAYOUTS[layout.pop("name")]
        checked(options, layout, "layout")
    assert len(manifests) == 4
    assert len(said) == len(LAYOUTS) + 1  # of ycb-slide there are two kinds


def test_the_page_tells_every_turn():
    rows = re.findall(r"^\| `([+-][xyz])` \| (.*) \|$", PAGE, re.MULTILINE)
    assert len(rows) == 6
    for axes, described in rows:
        for ours, theirs in enumerate(described.replace("−", "-").split(" | ")):
            expected = np.zeros(3)
            expected["xyz".index(theirs[1])] = float(theirs[0] + "1")
            np.testing.assert_array_equal(rotation_from(axes)[:3, ours], expected)


def test_the_page_names_every_layout_and_key():
    for name, (options, _) in LAYOUTS.items():
        section = PAGE.split(f"### {name}\n")[1].split("\n## ")[0].split("\n### ")[0]
        for key in options.model_fields:
            assert f'"{key}"' in section or f"`{key}`" in section, f"{name}: {key}"
    for key in {**RecordingManifest.model_fields, **UNITS}:
        assert f"`{key}`" in PAGE
