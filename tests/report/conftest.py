import copy
import json
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import save_file

OBJECTS, EXAMPLES, TOUCHED = 6, 2, 30
METHODS = ("tapsr", "midpoint", "a <b>&")


@pytest.fixture
def results() -> dict[str, Any]:
    rng = np.random.default_rng(0)
    methods = [
        {
            "name": name,
            "parameters": 1234567 * (k == 0),
            "seconds": 0.25 * (k + 1),
            "values": {"cd": rng.uniform(3e-4, 6e-4, OBJECTS).tolist(), "hd": rng.uniform(0.02, 0.1, OBJECTS).tolist()},
        }
        for k, name in enumerate(METHODS)
    ]
    return {
        "name": "tapsr",
        "fingerprint": "ab12cd34ef56",
        "seed": 7,
        "version": "0.1.0",
        "recipe": {
            "name": "tapsr",
            "data": {"points": 64, "shapes": {"use": "<script>alert(1)</script>"}},
            "train": {"epochs": 10},
        },
        "data": {
            "shapes": "cad-parts",
            "split": "test",
            "points": 64,
            "truth": 256,
            "rate": 4,
            "touches": 2,
            "sampling": "random",
            "normalisation": "compared in the unit sphere",
            "coverage": 0.0712,
            "object_size": 60.0,
        },
        "metrics": {
            "cd": {"description": "mean squared distance, a < b & c", "scale": 1000},
            "hd": {"description": "greatest distance", "scale": 1000},
        },
        "objects": [f"test/gear/{i:04d}" for i in range(OBJECTS)],
        "groups": ["gear", "</script><b>", "gear", "pipe", "pipe", "pipe"],
        "methods": methods,
        "training": {"seconds": 3600.0, "steps": 9000, "device": "1 x cpu", "source": "shipped weights"},
        "created": "2026-11-26T10:00:00Z",
    }


@pytest.fixture
def clouds() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    sizes = {"input": 64, "touches": TOUCHED, "truth": 256, **dict.fromkeys(METHODS, 256)}
    return {
        f"{k}/{name}": rng.uniform(-1, 1, (size, 3)).astype(np.float32)
        for k in range(EXAMPLES)
        for name, size in sizes.items()
    }


@pytest.fixture
def history() -> list[dict[str, Any]]:
    lines: list[dict[str, Any]] = [
        {"step": s, "epoch": s // 10, "loss": 0.1 / s, "losses": {"chamfer": 0.1 / s}, "rate": 1e-3, "seconds": s}
        for s in range(1, 31)
    ]
    return [*lines, {"epoch": 3, "step": 30, "validation": {"cd": 0.0011}}]


@pytest.fixture
def run(tmp_path, results, clouds, history):
    """A finished run's folder."""
    (tmp_path / "results.json").write_text(json.dumps(results), encoding="utf-8")
    names = results["objects"][:EXAMPLES]
    save_file(clouds, tmp_path / "examples.safetensors", {"names": json.dumps(names)})
    (tmp_path / "metrics.jsonl").write_text("".join(json.dumps(line) + "\n" for line in history), encoding="utf-8")
    return tmp_path


@pytest.fixture
def touch(results) -> dict[str, Any]:
    """What touch does in the results, which hold it from now on: of what it could take it takes a third."""
    results["touch"] = {
        "touched": [5.0e-4] * OBJECTS,
        "plain": [6.0e-4] * OBJECTS,
        "replaced": [3.0e-4] * OBJECTS,
        "seconds": 0.125,
        "edges": [0.0, 0.1, 0.4],
        "counts": [3, 0, 9],
        "errors": {
            "tapsr": [2e-4, None, 3e-4],
            "tapsr without touch": [4e-4, None, 3e-4],
            "a <b>&": [5e-4, None, 6e-4],
        },
    }
    return results["touch"]


@pytest.fixture
def variant():
    """Make the results of another run from some results."""

    def make(results, name, *, seed=0, factor=1.0, published=None, **recipe):
        made = copy.deepcopy(results)
        made |= {"name": name, "seed": seed}
        made["recipe"] |= {
            "name": name,
            "seed": seed,
            "train": {"epochs": 10},
            "evaluate": {"published": published or {}},
            **recipe,
        }
        own = made["methods"][0]
        own["name"] = name
        own["values"] = {metric: [factor * value for value in values] for metric, values in own["values"].items()}
        return made

    return make
