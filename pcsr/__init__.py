"""pcsr: point-cloud super-resolution with touch.

Everything listed in `__all__` is public. Names are imported when first used, so that `import pcsr` and the
command line's help pages stay fast and never load torch.
"""

import importlib
from typing import TYPE_CHECKING, Any

from pcsr.errors import PcsrError, PcsrWarning, RunError, UserError
from pcsr.hookspecs import hookimpl

if TYPE_CHECKING:
    from pcsr import metrics, recorded
    from pcsr.checkpoint import read_card
    from pcsr.clouds.formats.mesh import read_mesh
    from pcsr.clouds.touch import Touch
    from pcsr.contracts import (
        Backbone,
        Encoder,
        Fusion,
        Item,
        Objective,
        Shapes,
        Touches,
        TouchSource,
        Trait,
        Upsampler,
        Upsampling,
        Widths,
    )
    from pcsr.export import export_onnx, export_weights
    from pcsr.grafting import Grafted, graft
    from pcsr.library import Model, load
    from pcsr.measure import evaluate
    from pcsr.registry import Register

__version__ = "0.1.0"

_HOMES = {
    "Touch": "pcsr.clouds.touch",
    "read_mesh": "pcsr.clouds.formats.mesh",
    "Register": "pcsr.registry",
    **dict.fromkeys(("Model", "load"), "pcsr.library"),
    "evaluate": "pcsr.measure",
    "read_card": "pcsr.checkpoint",
    **dict.fromkeys(("export_onnx", "export_weights"), "pcsr.export"),
    **dict.fromkeys(("Grafted", "graft"), "pcsr.grafting"),
    **dict.fromkeys(
        (
            "Backbone",
            "Encoder",
            "Fusion",
            "Item",
            "Objective",
            "Shapes",
            "TouchSource",
            "Touches",
            "Trait",
            "Upsampler",
            "Upsampling",
            "Widths",
        ),
        "pcsr.contracts",
    ),
}

__all__ = [
    "Backbone",
    "Encoder",
    "Fusion",
    "Grafted",
    "Item",
    "Model",
    "Objective",
    "PcsrError",
    "PcsrWarning",
    "Register",
    "RunError",
    "Shapes",
    "Touch",
    "TouchSource",
    "Touches",
    "Trait",
    "Upsampler",
    "Upsampling",
    "UserError",
    "Widths",
    "__version__",
    "evaluate",
    "export_onnx",
    "export_weights",
    "graft",
    "hookimpl",
    "load",
    "metrics",
    "read_card",
    "read_mesh",
    "recorded",
]


def __getattr__(name: str) -> Any:
    if name in ("metrics", "recorded"):
        return importlib.import_module(f"pcsr.{name}")
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'pcsr' has no attribute '{name}'")
