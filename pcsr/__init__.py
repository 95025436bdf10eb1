"""pcsr: point-cloud super-resolution with touch.

Everything listed in `__all__` is public. Names are imported when first used, so that `import pcsr` and the
command line's help pages stay fast and never load torch.
"""

import importlib
from typing import TYPE_CHECKING, Any

from pcsr.errors import PcsrError, PcsrWarning, RunError, UserError
from pcsr.plugins.hookspecs import hookimpl
from pcsr.version import __version__

if TYPE_CHECKING:
    from pcsr import metrics, recorded, sensors
    from pcsr.clouds.meshes import read_mesh
    from pcsr.clouds.pose_error import PoseError
    from pcsr.clouds.touch import Touch
    from pcsr.contracts import (
        Backbone,
        Baseline,
        Encoder,
        Fingertip,
        Fusion,
        Logger,
        Metric,
        Objective,
        Policy,
        ShapeItem,
        ShapeSource,
        SimulatedFinger,
        TouchBatch,
        TouchCandidates,
        TouchSource,
        Trait,
        Upsampler,
        UpsamplingNetwork,
        Widths,
    )
    from pcsr.data.loader import Loader
    from pcsr.exploration.choosing import NextTouch, NextTouches
    from pcsr.exploration.next import next_touches
    from pcsr.export import export_onnx, export_weights
    from pcsr.grafting import Grafted, graft
    from pcsr.metrics.one_cloud import evaluate
    from pcsr.model import Model, load
    from pcsr.options import Choice, Options
    from pcsr.plugins.part_choice import PartChoice
    from pcsr.plugins.registry import Register
    from pcsr.registration import RegisteredTouch, Registration, register
    from pcsr.uncertainty import expected_errors
    from pcsr.weights.file import read_card


_HOMES = {
    "Touch": "pcsr.clouds.touch",
    "PoseError": "pcsr.clouds.pose_error",
    "read_mesh": "pcsr.clouds.meshes",
    "Register": "pcsr.plugins.registry",
    **dict.fromkeys(("Model", "load"), "pcsr.model"),
    "evaluate": "pcsr.metrics.one_cloud",
    "expected_errors": "pcsr.uncertainty",
    "read_card": "pcsr.weights.file",
    **dict.fromkeys(("export_onnx", "export_weights"), "pcsr.export"),
    **dict.fromkeys(("Choice", "Options"), "pcsr.options"),
    "PartChoice": "pcsr.plugins.part_choice",
    **dict.fromkeys(("NextTouch", "NextTouches"), "pcsr.exploration.choosing"),
    "next_touches": "pcsr.exploration.next",
    **dict.fromkeys(("RegisteredTouch", "Registration", "register"), "pcsr.registration"),
    **dict.fromkeys(("Grafted", "graft"), "pcsr.grafting"),
    "Loader": "pcsr.data.loader",
    **dict.fromkeys(
        (
            "Backbone",
            "Baseline",
            "Encoder",
            "Fingertip",
            "Fusion",
            "Logger",
            "Metric",
            "ShapeItem",
            "Objective",
            "Policy",
            "ShapeSource",
            "SimulatedFinger",
            "TouchSource",
            "TouchBatch",
            "TouchCandidates",
            "Trait",
            "Upsampler",
            "UpsamplingNetwork",
            "Widths",
        ),
        "pcsr.contracts",
    ),
}

__all__ = [
    "Backbone",
    "Baseline",
    "Choice",
    "Encoder",
    "Fingertip",
    "Fusion",
    "Grafted",
    "Loader",
    "Logger",
    "Metric",
    "Model",
    "NextTouch",
    "NextTouches",
    "Objective",
    "Options",
    "PartChoice",
    "PcsrError",
    "PcsrWarning",
    "Policy",
    "PoseError",
    "Register",
    "RegisteredTouch",
    "Registration",
    "RunError",
    "ShapeItem",
    "ShapeSource",
    "SimulatedFinger",
    "Touch",
    "TouchBatch",
    "TouchCandidates",
    "TouchSource",
    "Trait",
    "Upsampler",
    "UpsamplingNetwork",
    "UserError",
    "Widths",
    "__version__",
    "evaluate",
    "expected_errors",
    "export_onnx",
    "export_weights",
    "graft",
    "hookimpl",
    "load",
    "metrics",
    "next_touches",
    "read_card",
    "read_mesh",
    "recorded",
    "register",
    "sensors",
]


def __getattr__(name: str) -> Any:
    if name in ("metrics", "recorded", "sensors"):
        return importlib.import_module(f"pcsr.{name}")
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    new = importlib.import_module("pcsr.plugins.renamed").PUBLIC.get(name)
    if new is not None:  # no AttributeError, whose text `from pcsr import …` would drop
        raise ImportError(f"pcsr.{name} is now pcsr.{new}")
    raise AttributeError(f"module 'pcsr' has no attribute '{name}'")
