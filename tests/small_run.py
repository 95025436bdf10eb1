"""Run folders made by hand, without a training."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import save_file

OBJECTS = 8


def put(
    folder: Path, name: str = "net", *, seed: int = 0, factor: float = 1.0, fusion: str = "none", **data: Any
) -> Path:
    """Write a run folder of a network whose errors are those of interpolation times a factor, but for noise."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(1)
    clouds = {f"0/{key}": rng.normal(size=(n, 3)).astype(np.float32) for key, n in (("input", 32), ("truth", 128))}
    clouds |= {f"0/{key}": clouds["0/truth"] for key in (name, "midpoint")}
    save_file(clouds, folder / "examples.safetensors", {"names": '["part 0"]', "touches": "[0]"})
    errors = rng.uniform(0.001, 0.002, OBJECTS)
    own = errors * factor * np.random.default_rng([2, seed]).uniform(0.99, 1.01, OBJECTS)
    recipe = {
        "name": name,
        "seed": seed,
        "data": {"shapes": {"use": "cad-parts"}, "points": 32, "rate": 4, "seed": 0, **data},
        "model": {"encoder": {"use": "unet", "channels": 8}, "touch_encoder": None, "fusion": {"use": fusion}},
        "train": {"objective": {"use": "chamfer"}, "epochs": 2},
        "code": {"model.fusion": "0123456789ab"} if fusion == "mine" else {},
    }
    results = {
        "name": name, "fingerprint": f"ab12cd34ef{seed}", "seed": seed, "version": "0.2.0", "recipe": recipe,
        "data": {
            "shapes": "cad-parts", "split": "test", "points": data.get("points", 32), "truth": 128,
            "rate": data.get("rate", 4), "touches": 0, "sampling": "random", "seed": 0,
            "normalisation": "none", "fingerprint": "f00",
        },
        "metrics": {"cd": {"description": "distance", "scale": 1000}},
        "objects": [f"part {k}" for k in range(OBJECTS)], "groups": ["part"] * OBJECTS,
        "methods": [
            {"name": name, "parameters": 10, "seconds": 0.1, "values": {"cd": own.tolist()}},
            {"name": "midpoint", "parameters": 0, "seconds": 0.1, "values": {"cd": errors.tolist()}},
        ],
        "training": {"steps": 8, "seconds": 1.0, "source": "trained by this run"}, "created": "today",
    }  # fmt: skip
    (folder / "results.json").write_text(json.dumps(results), encoding="utf-8")
    (folder / "recipe.json").write_text(json.dumps(recipe), encoding="utf-8")
    history = [{"step": step, "epoch": step // 4, "loss": 1 / step, "seconds": step} for step in range(1, 9)]
    (folder / "metrics.jsonl").write_text("".join(json.dumps(line) + "\n" for line in history), encoding="utf-8")
    return folder


def unfinish(folder: Path) -> Path:
    """Remove what the evaluation of a run has written."""
    (folder / "results.json").unlink()
    (folder / "examples.safetensors").unlink()
    return folder
