"""A registry of small parts, and recipes written to a temporary folder."""

from collections.abc import Callable
from pathlib import Path
from textwrap import dedent
from typing import Annotated, Literal

import pytest
from annotated_types import Gt

from pcsr.contracts import Backbone, Encoder, Fusion, Objective, ShapeSource, TouchSource, Upsampler, Widths
from pcsr.metrics import METRICS
from pcsr.plugins.registry import Entry, Registry


class Net(Encoder):
    def __init__(
        self,
        widths: Widths,
        *,
        channels: Annotated[int, Gt(0)] = 8,
        order: Literal["hilbert", "file"] = "hilbert",
        layers: tuple[int, ...] = (1, 2),
        dropout: float | None = None,
    ) -> None:
        super().__init__()
        self.channels = channels
        self.layers = layers


class Attention(Fusion):
    def __init__(self, widths: Widths, *, heads: int) -> None:
        super().__init__()


class Blend(Fusion):
    def __init__(self, widths: Widths) -> None:
        super().__init__()


class Deaf(Fusion):
    uses_touch_features = False

    def __init__(self, widths: Widths) -> None:
        super().__init__()


class Refine(Backbone):
    def __init__(self, widths: Widths, *, steps: int = 3) -> None:
        super().__init__()


class Dense(Upsampler):
    def __init__(self, widths: Widths) -> None:
        super().__init__()


class Parts(ShapeSource):
    def __init__(self, *, count: int = 10) -> None:
        self.count = count


class Finger(TouchSource):
    def __init__(self, *, points: int = 32) -> None:
        self.points = points


class Distance(Objective):
    pass


@pytest.fixture(scope="session")
def registry() -> Registry:
    made = Registry()
    for kind, name, part in (
        ("encoder", "net", Net),
        ("fusion", "attention", Attention),
        ("fusion", "blend", Blend),
        ("fusion", "deaf", Deaf),
        ("fusion", "broken", "pcsr_no_such_module:Broken"),
        ("backbone", "refine", Refine),
        ("upsampler", "dense", Dense),
        ("shapes", "cad-parts", Parts),
        ("touch", "digit", Finger),
        ("objective", "chamfer", Distance),
        ("baseline", "midpoint", "pcsr_plugins.baselines.midpoint:Midpoint"),
        ("baseline", "floor", "pcsr_plugins.baselines.floor:Floor"),
        ("logger", "jsonl", "pcsr.experiments.history:JsonLines"),
        *(("metric", name, type(metric)) for name, metric in METRICS.items()),
    ):
        made.add(Entry(kind, name, part, "tests", "1"))
    return made


MODEL = """
    model:
      encoder: net
      fusion: blend
      backbone: refine
      upsampler: dense
"""


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Write a recipe; `model=True` adds a whole model behind it."""

    def write_recipe(text: str, name: str = "recipe.yaml", *, model: bool = False) -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(dedent(text).strip("\n") + "\n" + (dedent(MODEL) if model else ""), encoding="utf-8")
        return path

    return write_recipe
