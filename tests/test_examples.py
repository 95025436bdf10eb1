"""The docstring of every public function, class and method shows an example, and each runs as it stands."""

import doctest
import importlib
import inspect
import re
import sys
from pathlib import Path
from typing import Protocol

import numpy as np
import pytest
import torch

import pcsr
import pcsr.contracts
import pcsr.grafting
import pcsr.testing

LISTED = (Path(__file__).parent / "public_api.txt").read_text(encoding="utf-8")
NAMES = [
    *(
        name
        for name in re.findall(r"^(pcsr\.[\w.]+): (?:class |@?\w+[( ])", LISTED, re.MULTILINE)
        if ".tensors." not in name
    ),
    "pcsr.plugins.hookspecs.pcsr_register",
]
CONTRACTS = {pcsr.contracts.Part, pcsr.contracts.SimulatedFinger, pcsr.PartChoice, Protocol}
"""What plugins derive from, and what they are given: their methods are the host's to call."""


def found(name):
    """A public name and, of a class, the methods that a person calls."""
    module, _, attribute = name.rpartition(".")
    thing = getattr(importlib.import_module(module), attribute)
    yield name, thing
    if isinstance(thing, type) and not CONTRACTS & set(thing.__mro__):
        for method, value in vars(thing).items():
            if inspect.isfunction(getattr(value, "__func__", value)) and method[0] != "_" and method != "forward":
                yield f"{name}.{method}", value


DOCUMENTED = dict(pair for name in NAMES for pair in found(name))


def said(name):
    return inspect.getdoc(DOCUMENTED[name]) or ""


@pytest.mark.parametrize("name", DOCUMENTED)
def test_there_is_an_example(name):
    owner, _, method = name.rpartition(".")
    calls = re.findall(rf"^ *(?:>>>|\.\.\.) .*\.{method}\(", said(owner), re.MULTILINE) if owner in DOCUMENTED else []
    assert ">>> " in said(name) or calls, f"show how `{name}` is called: a docstring's section Examples"


@pytest.mark.parametrize("name", [name for name in DOCUMENTED if ">>> " in said(name)])
def test_the_example_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if "onnx" in name:
        pytest.importorskip("onnxscript", reason="the extra [onnx]")
    torch.manual_seed(0)
    own = vars(sys.modules[getattr(DOCUMENTED[name], "__module__", None) or "pcsr"])
    known = {**own, "np": np, "torch": torch, "pcsr": pcsr, "Path": Path}
    test = doctest.DocTestParser().get_doctest(said(name), known, name, None, 0)
    printed = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    assert runner.run(test, out=printed.append).failed == 0, "".join(printed)
    assert test.examples
