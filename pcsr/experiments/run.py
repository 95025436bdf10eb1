"""A recipe to a run folder: data, training, evaluation, results and report."""

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
from pcsr.experiments.evaluation import evaluate, measured_by, methods
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
    """The optional packages that a run needs, each with what needs it, as `pcsr.extras.require` takes them."""
    needed = {"lightning_fabric": "training", "plotly": "the report"}
    if "emd" in recipe.evaluate.metrics and recipe.data.points * recipe.data.rate > EXACT:
        needed["ot"] = "the metric 'emd'"
    for kind, names in (("metric", recipe.evaluate.metrics), ("baseline", recipe.evaluate.baselines)):
        for name in names:
            needed |= dict.fromkeys(sorted(registry.get(kind, name).needs), f"{kind} '{name}'")
    if recipe.weights is None:
        needed |= recipe.train.objective.needs(registry, "objective")
    if not place.data:
        needed |= data_packages(recipe, registry)
    elif recipe.measured_on_meshes(registry):
        needed |= recipe.data.shapes.needs(registry, "shapes")
    return needed


def run(recipe: Recipe, registry: Registry, place: Place, console: Console) -> dict[str, Any]:
    """Do whatever of a recipe isn't done yet, and evaluate.

    Training is skipped where the recipe names weights, and where finished weights of exactly this recipe, and of the
    code of its parts, are in the run folder or shipped.

    Returns:
        The results, which also stand in the run folder beside the report.
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
        compared = methods(recipe, network, registry)
        task = progress.add_task("evaluating", total=2 * len(test) * len(compared))
        scores = evaluate(recipe, registry, compared, test, jobs=place.jobs, advance=lambda: progress.advance(task))
    results = gathered(recipe, test, scores, source, measured_by(recipe, registry))
    save_examples(folder / EXAMPLES, recipe, test, scores)
    write_text(folder / RESULTS, json.dumps(results, indent=1))
    report.write(folder)
    return results


def _fabric(recipe: Recipe, place: Place) -> "Fabric":
    many = place.devices * place.nodes > 1 or "LOCAL_RANK" in os.environ
    if place.device == "cuda" and not torch.cuda.is_available():
        raise UserError("--device cuda: torch finds no CUDA device here; use --device cpu, or install torch for CUDA")
    fabric: Fabric = imported("lightning_fabric", "training").Fabric(
        accelerator="cuda" if place.device != "cpu" and torch.cuda.is_available() else "cpu",
        devices=place.devices,
        num_nodes=place.nodes,
        # A batch without touches leaves the fusion's weights without a gradient.
        strategy="ddp_find_unused_parameters_true" if many else "auto",
        precision=recipe.train.precision,
    )
    fabric.launch()
    return fabric
