"""What an evaluation leaves in the run folder: all numbers, object by object, and a few clouds to look at."""

import datetime
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch

import pcsr
from pcsr.data.dataset import Split
from pcsr.experiments.evaluation import Scores
from pcsr.files import save_tensors
from pcsr.metrics import METRICS, Metric
from pcsr.recipe import Recipe


def gathered(
    recipe: Recipe,
    split: Split,
    scores: Sequence[Scores],
    source: dict[str, Any],
    metrics: Mapping[str, Metric] = METRICS,
) -> dict[str, Any]:
    """What `results.json` says of an evaluation.

    Args:
        recipe: as it was run.
        split: what it was measured on.
        scores: of each method, the recipe's own first.
        source: where the weights came from, and how they were trained.
        metrics: by name, those of the recipe at least.
    """
    data = recipe.data
    return {
        "name": recipe.name,
        "fingerprint": recipe.fingerprint,
        "seed": recipe.seed,
        "version": pcsr.__version__,
        "recipe": recipe.resolved(),
        "data": {
            "shapes": data.shapes.use,
            "split": "test",
            "points": data.points,
            "truth": data.points * data.rate,
            "rate": data.rate,
            "touches": data.touches,
            "sampling": data.sampling,
            "seed": recipe.data_seed,
            "normalisation": "compared in the frame in which the truth fills the unit sphere",
            "object_size": data.touch.options.get("object_size"),
            "coverage": split.coverage(data.touches),
            "left_out": len(split.about["rejected"]),
            "fingerprint": split.about["fingerprint"],
        },
        "metrics": {
            name: {"description": metrics[name].description, "scale": metrics[name].scale}
            for name in recipe.evaluate.metrics
        },
        "objects": split.names,
        "groups": split.groups,
        "methods": [
            {
                "name": s.method.name,
                "parameters": s.method.parameters,
                "seconds": s.seconds,
                "values": s.values,
            }
            for s in scores
        ],
        "touch": None if scores[0].touch is None else asdict(scores[0].touch),
        "training": source,
        "timing": "median",
        "hardware": {
            "cores": os.cpu_count(),
            "threads": scores[0].threads,
            "load": scores[0].load,
            "torch": torch.__version__,
        },
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def save_examples(path: Path, recipe: Recipe, split: Split, scores: Sequence[Scores]) -> None:
    """The clouds that the report shows: the objects with the most touched surface would flatter, so the first ones."""
    chosen = range(min(recipe.evaluate.examples, len(split)))
    tensors = {}
    for k in chosen:
        tensors[f"{k}/input"] = split.points[k]
        tensors[f"{k}/truth"] = split.truth[k]
        if recipe.data.touches:
            tensors[f"{k}/touches"] = split.touches[k][: recipe.data.touches].flatten(0, 1)
        for s in scores:
            tensors[f"{k}/{s.method.name}"] = torch.from_numpy(s.dense[k]).float()
    save_tensors(path, tensors, {"names": json.dumps([split.names[k] for k in chosen])})
