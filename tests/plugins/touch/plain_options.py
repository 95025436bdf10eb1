"""A `Digit` from options as a recipe writes them, or flat: `width=20.0` for `sensor={"width": 20.0}`."""

import json
from typing import Any

from pcsr.recipe.old_names import OPTIONS
from pcsr.recipe.schema import options_model
from pcsr_plugins.touch.digit import Digit


def digit(**options: Any) -> Digit:
    """The touch source with these options, checked."""
    nested: dict[str, Any] = {}
    for key, value in options.items():
        group, *inner = OPTIONS["touch", "digit"].get(key, (key,))
        if inner or isinstance(value, dict):
            at = nested.setdefault(group, {})
            if isinstance(at, str):
                at = nested[group] = {"use": at}
            at.update({inner[0]: value} if inner else value)
        else:
            nested[group] = value
    checked = options_model(Digit).model_validate_json(json.dumps(nested))
    return Digit(**{name: getattr(checked, name) for name in type(checked).model_fields})
