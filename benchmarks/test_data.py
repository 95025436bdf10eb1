"""The builder: time and memory of 200 objects, what that makes of the paper's 12,732 (TAPSR, Sec. 4.1), and its parts.

make bench ARGS=benchmarks/test_data.py
"""

import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from processes import run

from pcsr.data import sample
from pcsr.data.sample import make_sample
from pcsr.geometry.rays import MeshRays
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import for_data
from pcsr_plugins.shapes.cad_parts import CadParts
from pcsr_plugins.touch.digit import Digit
from pcsr_plugins.touch.digit.hand import Hand

OBJECTS, PAPER = 200, 12_732
SPLIT = 24
PARTS = {
    (CadParts, "item"): "load",
    (sample, "_truth"): "sample",
    (sample, "_sparse"): "sample",
    (MeshRays, "__init__"): "prepare rays",
    (MeshRays, "depths"): "cast rays",
    (Hand, "candidates"): "draw candidates",
    (Digit, "touches"): "press",
    (sample, "covered"): "coverage",
}


@pytest.mark.skipif(not Path("/proc/self/smaps_rollup").exists(), reason="memory is read from /proc")
@pytest.mark.parametrize("jobs", [1, 2])
def test_build(benchmark, line, tmp_path, jobs):
    line(f"data of {OBJECTS} cad-parts, five touches each, --jobs {jobs}")
    command = [
        sys.executable, "-m", "pcsr.cli", "data", "make", "cad-parts", "-o", str(tmp_path / "data"),
        "--jobs", str(jobs), "--set", f"count={OBJECTS}", "--set", "held_out=0",
    ]  # fmt: skip
    seconds, peak = benchmark.pedantic(run, (command,), rounds=1)
    size = sum(path.stat().st_size for path in (tmp_path / "data").iterdir())
    benchmark.extra_info["says"] = (
        f"{seconds / OBJECTS:.3f} s an object, {peak / 1e6:.0f} MB; the paper's {PAPER:,} objects: "
        f"{seconds / OBJECTS * PAPER / 3600:.2f} h, {size / OBJECTS * PAPER / 1e9:.2f} GB on disk"
    )


def test_parts(benchmark, line, monkeypatch):
    """Where the time of an object goes, in one process, by its clock: each part without the parts that it calls."""
    line(f"the parts of that, {SPLIT} objects")
    registry = load_plugins([])
    recipe = for_data("cad-parts", {"count": SPLIT, "held_out": 0}, registry)
    shapes = recipe.data.shapes.build(registry, "shapes")
    source = recipe.data.touch.build(registry, "touch")
    spent: Counter[str] = Counter()
    within = [0.0]

    def watch(owner, name, part):
        function = getattr(owner, name)

        def timed(*args, **options):
            start = time.process_time()
            within.append(0.0)
            try:
                return function(*args, **options)
            finally:
                took = time.process_time() - start
                spent[part] += took - within.pop()
                within[-1] += took

        monkeypatch.setattr(owner, name, timed)

    for (owner, name), part in PARTS.items():
        watch(owner, name, part)

    def build():
        spent.clear()
        for name in shapes.names("train"):
            make_sample(shapes.item(name), source, recipe.data, recipe.most_touches, 0)

    benchmark.pedantic(build, rounds=1, warmup_rounds=1)
    each = ", ".join(f"{part} {1000 * seconds / SPLIT:.1f}" for part, seconds in spent.most_common())
    benchmark.extra_info["says"] = f"ms an object: {each}"
