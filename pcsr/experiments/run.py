"""Run of a recipe: data, training, evaluation, results and report, written to a run folder."""

import datetime
import functools
import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from jaxtyping import Float
from rich.console import Console

import pcsr
from pcsr import report
from pcsr.contracts import Metric
from pcsr.data.dataset import Split
from pcsr.data.plan import packages as data_packages
from pcsr.data.source import data_of
from pcsr.errors import PcsrWarning, UserError
from pcsr.experiments.environment import record
from pcsr.experiments.evaluation import Evaluation, evaluate, metrics_of
from pcsr.experiments.finished_runs import finished_results
from pcsr.experiments.methods import methods
from pcsr.experiments.run_options import RunOptions, run_folder
from pcsr.experiments.train import initial
from pcsr.experiments.trained_network import trained
from pcsr.extras import imported
from pcsr.metrics import METRICS
from pcsr.metrics.emd import EXACT
from pcsr.plugins.code import own_code
from pcsr.plugins.registry import Registry
from pcsr.progress import progress_bars
from pcsr.recipe import Recipe
from pcsr.recipe.schema import GraftedModel
from pcsr.results import Data, MetricNote, Results, Training, validated
from pcsr.run_files import HISTORY, Example, FinishedRun, read_history, write_run

if TYPE_CHECKING:
    from lightning_fabric import Fabric


def packages(recipe: Recipe, registry: Registry, options: RunOptions) -> dict[str, str]:
    """Return the optional packages that a run needs, with the reason for each, for `pcsr.extras.require`."""
    needed = {"lightning_fabric": "training", "plotly": "the report"}
    if "emd" in recipe.evaluate.metrics and recipe.data.points * recipe.data.rate > EXACT:
        needed["ot"] = "the metric 'emd'"
    for kind, names in (("metric", recipe.evaluate.metrics), ("baseline", recipe.evaluate.baselines)):
        for name in names:
            needed |= dict.fromkeys(sorted(registry.get(kind, name).needs), f"{kind} '{name}'")
    if recipe.weights is None:
        needed |= recipe.train.objective.needs(registry, "objective")
        for logger in recipe.train.loggers:
            needed |= logger.needs(registry, "logger")
    if not options.data:
        needed |= data_packages(recipe, registry)
    elif recipe.measured_on_meshes(registry):
        needed |= recipe.data.shapes.needs(registry, "shapes")
    return needed


def check_graft(recipe: Recipe, registry: Registry) -> None:
    """Build the graft of a recipe once, so that mistakes are reported before the data are built.

    Raises:
        UserError: the foreign network cannot be built, run or grafted, or its weights do not fit.
    """
    if isinstance(recipe.model, GraftedModel) and recipe.weights is None:
        try:
            initial(recipe, registry)
        except UserError as error:
            raise UserError(f"recipe '{recipe.name}': {error}") from error


def run(recipe: Recipe, registry: Registry, options: RunOptions, console: Console) -> FinishedRun | None:
    """Train a recipe's network, unless finished weights exist, and evaluate it, unless finished results exist.

    Training is skipped if the recipe names weights, or if the run folder, another run folder or the shipped weights
    hold finished weights of exactly this recipe, its data and the code of its parts. Evaluation is skipped if the run
    folder holds results of exactly this recipe, its data, these weights and the present code of pcsr.

    Args:
        recipe: recipe to run.
        registry: installed parts.
        options: device, processes and folders.
        console: console for messages and progress.

    Returns:
        The run, which is also written to the run folder with a report; None in all processes but the first.

    Raises:
        UserError: the data cannot be built or read, the weights do not fit, or the device does not exist.
        RunError: training fails, or a file cannot be written.
    """
    folder = run_folder(recipe, options)
    fabric = _fabric(recipe, options)
    fingerprint, data = data_of(recipe, registry, options.runs, options.data, options.jobs)
    data = functools.cache(data)
    if not (options.retrain or options.reevaluate):
        done = finished_results(recipe, registry, fingerprint, options.runs, folder)
        if done is not None:
            if not fabric.is_global_zero:
                return None
            text = f"finished: {folder}, measured {done.results.created}; --reevaluate measures again"
            console.print(text, markup=False, soft_wrap=True, highlight=False)
            report.write_page(done)
            return done
    with progress_bars(console, hidden=not fabric.is_global_zero) as progress:
        network, source = trained(recipe, registry, fingerprint, data, fabric, options, progress)
        if not fabric.is_global_zero:
            return None
        test = data("test", progress)
        if recipe.evaluate.objects is not None:
            test = test.spread(recipe.evaluate.objects)
        network.to(fabric.device)
        record(folder, "evaluation", recipe, registry, options.command)
        compared = methods(recipe, network, registry)
        task = progress.add_task("evaluating", total=2 * len(test) * len(compared))
        evaluation = evaluate(
            recipe, registry, compared, test, jobs=options.jobs, advance=lambda: progress.advance(task)
        )
    results = results_of(recipe, test, evaluation, source, metrics_of(recipe, registry))
    finished = FinishedRun(folder, results, examples_of(recipe, test, evaluation), _history(folder))
    write_run(finished)
    report.write_page(finished)
    return finished


def _history(folder: Path) -> list[dict[str, Any]] | None:
    """Read the history of a training. A damaged one costs its chart, but not the evaluation.

    Warns:
        PcsrWarning: the history is damaged.
    """
    try:
        return read_history(folder / HISTORY)
    except UserError as error:
        text = str(error).partition(";")[0]  # the run has just been done again
        warnings.warn(f"{text}: the report lacks the training; --retrain makes it again", PcsrWarning, stacklevel=2)
        return None


def results_of(
    recipe: Recipe,
    split: Split,
    evaluation: Evaluation,
    training: dict[str, Any],
    metrics: Mapping[str, Metric] = METRICS,
) -> Results:
    """Create the results of a run.

    Args:
        recipe: recipe that was run.
        split: objects on which the methods were compared.
        evaluation: result of `evaluate`.
        training: origin of the weights; the fields of `pcsr.results.Training`.
        metrics: metrics of the recipe by name; by default those of pcsr.

    Raises:
        UserError: a value of `training` is of the wrong type, as in a damaged card of weights.
    """
    data = recipe.data
    return Results(
        name=recipe.name,
        fingerprint=recipe.fingerprint,
        seed=recipe.seed,
        version=pcsr.__version__,
        recipe=recipe.resolved(),
        data=Data(
            shapes=data.shapes.use,
            split="test",
            points=data.points,
            truth=data.points * data.rate,
            rate=data.rate,
            touches=data.touches,
            sampling=data.sampling,
            seed=recipe.data_seed,
            normalisation="compared in the frame in which the truth fills the unit sphere",
            object_size=data.touch.options.get("object_size"),
            coverage=split.coverage(data.touches),
            left_out=len(split.about["rejected"]),
            fingerprint=split.about["fingerprint"],
            radii=[_radius(points) for points in split.points],
        ),
        metrics={
            name: MetricNote(description=metric.description, scale=metric.scale)
            for name, metric in metrics.items()
            if name in recipe.evaluate.metrics
        },
        objects=list(split.names),
        groups=list(split.groups),
        methods=evaluation.methods,
        touch=evaluation.touch,
        training=validated(Training, training, "the card of the weights: training", "train the weights again"),
        protocol=evaluation.protocol,
        timing="median",
        code=own_code(),
        hardware={
            "cores": os.cpu_count(),
            "threads": evaluation.threads[0],
            "load": evaluation.load,
            "torch": torch.__version__,
        },
        created=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    )


def _radius(points: Float[torch.Tensor, "n 3"]) -> float:
    """Root mean square distance of points from their mean."""
    return float((points.double() - points.double().mean(0)).square().sum(1).mean().sqrt())


def examples_of(recipe: Recipe, split: Split, evaluation: Evaluation) -> list[Example]:
    """Return the clouds that the report shows: those of the first objects, so that no result influences the choice."""
    shown = range(min(recipe.evaluate.examples, len(split)))
    touches = [split.touches[k][: recipe.data.touches] for k in shown]
    return [
        Example(
            split.names[k],
            split.points[k].numpy(),
            touches[k].flatten(0, 1).numpy() if len(touches[k]) else None,
            split.truth[k].numpy(),
            {
                method.name: clouds[k].astype(np.float32)
                for method, clouds in zip(evaluation.methods, evaluation.dense, strict=True)
            },
            len(touches[k]),
        )
        for k in shown
    ]


def _fabric(recipe: Recipe, options: RunOptions) -> "Fabric":
    distributed = options.devices * options.nodes > 1 or "LOCAL_RANK" in os.environ
    if options.device == "cuda" and not torch.cuda.is_available():
        raise UserError("--device cuda: torch finds no CUDA device here; use --device cpu, or install torch for CUDA")
    fabric: Fabric = imported("lightning_fabric", "training").Fabric(
        accelerator="cuda" if options.device != "cpu" and torch.cuda.is_available() else "cpu",
        devices=options.devices,
        num_nodes=options.nodes,
        # In a batch without touches the fusion's weights have no gradient.
        strategy="ddp_find_unused_parameters_true" if distributed else "auto",
        precision=recipe.train.precision,
    )
    fabric.launch()
    return fabric
