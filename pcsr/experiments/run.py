"""Run of a recipe: data, training, evaluation, results and report, all in a run folder."""

import functools
import json
import os
from typing import TYPE_CHECKING, Any

import torch
from rich.console import Console

from pcsr import report
from pcsr.data.plan import packages as data_packages
from pcsr.data.source import data_of
from pcsr.errors import UserError
from pcsr.experiments.evaluation import evaluate, methods, needs_meshes
from pcsr.experiments.run_options import Place, run_folder
from pcsr.experiments.trained_network import trained
from pcsr.extras import imported
from pcsr.files import write_text
from pcsr.metrics.emd import EXACT
from pcsr.plugins.registry import Registry
from pcsr.progress import progress_bars
from pcsr.recipe import Recipe
from pcsr.results import gathered, save_examples

if TYPE_CHECKING:
    from lightning_fabric import Fabric

RESULTS = "results.json"
EXAMPLES = "examples.safetensors"


def packages(recipe: Recipe, registry: Registry, place: Place) -> dict[str, str]:
    """Return the optional packages that a run needs, each with its user, for `pcsr.extras.require`."""
    needed = {"lightning_fabric": "training", "plotly": "the report"}
    if "emd" in recipe.evaluate.metrics and recipe.data.points * recipe.data.rate > EXACT:
        needed["ot"] = "the metric 'emd'"
    if recipe.weights is None:
        needed |= recipe.train.objective.needs(registry, "objective")
    if not place.data:
        needed |= data_packages(recipe, registry)
    elif needs_meshes(recipe):
        needed |= recipe.data.shapes.needs(registry, "shapes")
    return needed


def run(recipe: Recipe, registry: Registry, place: Place, console: Console) -> dict[str, Any]:
    """Train a recipe's network, unless finished weights exist, and evaluate it.

    Training is skipped if the recipe names weights, or if the run folder, another run folder or the shipped weights
    hold finished weights of exactly this recipe, its data and the code of its parts.

    Args:
        recipe: recipe to run.
        registry: installed parts.
        place: device, processes and folders.
        console: console for messages and progress.

    Returns:
        The results, which are also written to the run folder, with a report. Empty in all processes but the first.

    Raises:
        UserError: the data cannot be built or read, the weights do not fit, or the device does not exist.
        RunError: training fails, or a file cannot be written.
    """
    folder = run_folder(recipe, place)
    fabric = _fabric(recipe, place)
    fingerprint, data = data_of(recipe, registry, place.runs, place.data, place.jobs)
    data = functools.cache(data)
    with progress_bars(console, hidden=not fabric.is_global_zero) as progress:
        network, source = trained(recipe, registry, fingerprint, data, fabric, place, progress)
        if not fabric.is_global_zero:
            return {}
        test = data("test", progress)
        if recipe.evaluate.objects is not None:
            test = test.spread(recipe.evaluate.objects)
        network.to(fabric.device)
        compared = methods(recipe, network)
        task = progress.add_task("evaluating", total=2 * len(test) * len(compared))
        scores = evaluate(recipe, registry, compared, test, jobs=place.jobs, advance=lambda: progress.advance(task))
    results = gathered(recipe, test, scores, source)
    save_examples(folder / EXAMPLES, recipe, test, scores)
    write_text(folder / RESULTS, json.dumps(results, indent=1))
    report.write(folder)
    return results


def _fabric(recipe: Recipe, place: Place) -> "Fabric":
    distributed = place.devices * place.nodes > 1 or "LOCAL_RANK" in os.environ
    if place.device == "cuda" and not torch.cuda.is_available():
        raise UserError("--device cuda: torch finds no CUDA device here; use --device cpu, or install torch for CUDA")
    fabric: Fabric = imported("lightning_fabric", "training").Fabric(
        accelerator="cuda" if place.device != "cpu" and torch.cuda.is_available() else "cpu",
        devices=place.devices,
        num_nodes=place.nodes,
        # In a batch without touches the fusion's weights have no gradient.
        strategy="ddp_find_unused_parameters_true" if distributed else "auto",
        precision=recipe.train.precision,
    )
    fabric.launch()
    return fabric
