"""A recipe to a run folder: data, training, evaluation, results and report."""

import functools
import json
import os
import shutil
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from rich.console import Console
from rich.progress import Progress

import pcsr
from pcsr import report
from pcsr.checkpoint import load_weights, save_weights
from pcsr.data.build import load_or_build
from pcsr.data.built import Built
from pcsr.data.dataset import Split
from pcsr.data.loading import LOADERS
from pcsr.data.plan import Plan
from pcsr.data.plan import packages as data_packages
from pcsr.errors import PcsrWarning, UserError
from pcsr.evaluation import evaluate, methods, needs_meshes
from pcsr.extras import imported
from pcsr.files import write_text
from pcsr.finished import WEIGHTS, Earlier, of_other_code, of_recipe
from pcsr.metrics.emd import EXACT
from pcsr.model import Network
from pcsr.origins import other_code
from pcsr.progress import progress_bars
from pcsr.recipe import Recipe
from pcsr.recipe.pretrained import check_weights
from pcsr.registry import Registry
from pcsr.results import gathered, save_examples
from pcsr.train import CHECKPOINT, HISTORY, train
from pcsr.workers import worker_pool

if TYPE_CHECKING:
    from lightning_fabric import Fabric

RESULTS = "results.json"
EXAMPLES = "examples.safetensors"
MOMENT = 1 << 28
"""Bytes that are read and hashed in about a second."""
RETRAINING = "retraining"
"""The folder in a run folder where `--retrain` keeps its checkpoint and its history until it is finished."""


@dataclass(frozen=True)
class Place:
    """Where to compute and where to keep things."""

    runs: Path = Path("runs")
    device: str = "auto"
    devices: int = 1
    nodes: int = 1
    jobs: int | None = None
    """Processes for data and metrics, all cores by default; and for the batches of all GPUs, two each by default."""
    data: tuple[Path, ...] = ()
    """Folders of data that is built already; the recipe must be on them, as `pcsr.data.built.Built` lays it."""
    keep_weights: bool = False
    """Weights that were trained before the code of a part changed are measured, instead of training again."""
    retrain: bool = False
    """The network is trained anew, whatever finished weights there are; they stay until the new ones are finished."""


def run_folder(recipe: Recipe, place: Place) -> Path:
    """The folder of a recipe: the same recipe comes back to it, another never does."""
    return place.runs / f"{recipe.name}-{recipe.fingerprint[:8]}"


def packages(recipe: Recipe, registry: Registry, place: Place) -> dict[str, str]:
    """The optional packages that a run needs, each with what needs it, as `pcsr.extras.require` takes them."""
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
    """Do whatever of a recipe isn't done yet, and evaluate.

    Training is skipped where the recipe names weights, and where finished weights of exactly this recipe, and of the
    code of its parts, are in the run folder or shipped.

    Returns:
        The results, which also stand in the run folder beside the report.
    """
    folder = run_folder(recipe, place)
    fabric = _fabric(recipe, place)
    fingerprint, data = _data(recipe, registry, place)
    data = functools.cache(data)
    with progress_bars(console, hidden=not fabric.is_global_zero) as progress:
        network, source = _trained(recipe, registry, fingerprint, data, fabric, place, progress)
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


def _trained(
    recipe: Recipe,
    registry: Registry,
    fingerprint: str,
    data: "Data",
    fabric: "Fabric",
    place: Place,
    progress: Progress,
) -> tuple[Network, dict[str, Any]]:
    """The recipe's network with finished weights, and where they came from."""
    named = check_weights(recipe, registry)
    folder = run_folder(recipe, place)
    if named is not None and place.retrain:
        raise UserError(f"recipe '{recipe.name}' names weights, so that nothing is trained: leave out --retrain")
    if named is not None:
        source = f"{named.path.stem} of recipe '{named.recipe.name}', sha256 {named.sha256[:12]}"
        return _loaded(named.path, source, registry, progress)
    exact = None if place.retrain else of_recipe(recipe, fingerprint, place.runs, folder)
    if exact is not None:
        return _loaded(*exact, registry, progress)
    earlier = None if place.retrain else of_other_code(recipe, fingerprint, place.runs, registry)
    if place.keep_weights:
        return _kept(recipe, earlier, registry, place, progress)
    # Until new weights are finished, those that are there stay as they are, and their history with them.
    training_folder = folder / RETRAINING if place.retrain else folder
    # One process writes the recipe and builds the data, the others wait and read it.
    with fabric.rank_zero_first():
        train_data, validation = data("train", progress), data("validation", progress)
        if fabric.is_global_zero:
            data("test", progress)  # what is missing or damaged is said before hours of training
            write_text(folder / "recipe.json", json.dumps(recipe.resolved(), indent=1))
            training_folder.mkdir(exist_ok=True)
    if fabric.is_global_zero:
        if earlier is not None:
            remedy = "training again; --keep-weights measures the old weights with the new code"
            progress.console.print(f"{earlier}: {remedy}", markup=False, soft_wrap=True)
        why = "--retrain" if place.retrain else "no weights of exactly this recipe yet"
        progress.console.print(f"{why}: training, {recipe.train.epochs} epochs")
    task = progress.add_task("training", total=None)
    network = train(
        recipe,
        registry,
        train_data,
        validation,
        training_folder,
        fabric,
        shown=lambda p: progress.update(
            task, total=p.steps, completed=p.step, description=f"training, loss {1e3 * p.loss:.3f} ×10⁻³"
        ),
        loaders=max(1, place.jobs // fabric.world_size) if place.jobs else LOADERS,
        data_fingerprint=fingerprint,
    )
    if not fabric.is_global_zero:  # the history is the first process's, who may not be done with it
        return network, {}
    training = _training(training_folder, fabric)
    card: dict[str, Any] = {
        "name": recipe.name,
        "fingerprint": recipe.fingerprint,
        "data_fingerprint": fingerprint,
        "recipe": recipe.resolved(),
        "version": pcsr.__version__,
        "training": training,
    }
    if recipe.code:
        card["settings_fingerprint"] = recipe.settings_fingerprint
    if place.data:
        card["data"] = Built.read(place.data).card()
    save_weights(folder / WEIGHTS, network, card, registry)
    if place.retrain:
        write_text(folder / HISTORY, (training_folder / HISTORY).read_text(encoding="utf-8"))
        (training_folder / CHECKPOINT).unlink()  # first: without its history it would be of no use
        shutil.rmtree(training_folder)
    (folder / CHECKPOINT).unlink(missing_ok=True)
    return network, {**training, "source": "trained by this run"}


def _kept(
    recipe: Recipe, earlier: Earlier | None, registry: Registry, place: Place, progress: Progress
) -> tuple[Network, dict[str, Any]]:
    """The network with weights of other code, which whoever reads the results is told.

    Raises:
        UserError: there are none, or they don't fit the code of now.
    """
    if earlier is None:
        raise UserError(
            f"--keep-weights: {place.runs} holds no weights of recipe '{recipe.name}', of this code or of other code: "
            f"leave it out, and it is trained"
        )
    try:
        network, training = _loaded(earlier.path, f"kept with --keep-weights, as {earlier}", registry, progress)
    except UserError as error:
        raise UserError(
            f"--keep-weights: {earlier}, and the old weights cannot be used with it: leave --keep-weights out, and it "
            f"is trained again. What is wrong: {error}"
        ) from error
    return network, {
        **training,
        "source": f"those of {earlier.path.parent}",
        "other_code": f"{earlier} (--keep-weights)",
    }


def _loaded(path: Path, source: str, registry: Registry, progress: Progress) -> tuple[Network, dict[str, Any]]:
    """A network with the weights of a file, and what its card says of their training."""
    progress.console.print(f"weights: {source}, {path}", markup=False, soft_wrap=True)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", PcsrWarning)
        network, recipe, card = load_weights(path, registry)
    for one in said:
        progress.console.print(str(one.message), style="yellow", markup=False, soft_wrap=True)
    differs = other_code(recipe, card, registry)
    marked = {} if differs is None else {"other_code": f"{path} was {differs}"}
    training = card.get("training")
    return network, {**(training if isinstance(training, dict) else {}), "source": source, **marked}


def _training(folder: Path, fabric: "Fabric") -> dict[str, Any]:
    """What the history says of a finished training."""
    lines = [json.loads(line) for line in (folder / HISTORY).read_text(encoding="utf-8").splitlines()]
    steps = [line for line in lines if "loss" in line]
    checks = [line["validation"] for line in lines if "validation" in line]
    return {
        "seconds": steps[-1]["seconds"],
        "steps": steps[-1]["step"],
        "device": f"{fabric.world_size} x {fabric.device.type}",
        "threads": steps[-1].get("threads"),
        "validation": checks[-1] if checks else {},
    }


Data = Callable[[str, Progress], Split]
"""Gives a split of the data, which it builds first where it isn't there yet."""


def _data(recipe: Recipe, registry: Registry, place: Place) -> tuple[str, Data]:
    """The fingerprint of a recipe's data, and the way to it."""
    if place.data:
        built = Built.read(place.data)
        return built.fingerprint, lambda split, progress: _checked(built, split, progress)
    if recipe.joined:
        raise UserError(
            f"recipe '{recipe.name}' is on {len(recipe.joined)} data sets that were joined: name their folders, each "
            f"with --data, or remove `joined`"
        )
    plan = Plan.of(recipe, registry)

    def load(split: str, progress: Progress) -> Split:
        names = plan.split(split)
        task = progress.add_task(f"building the {split} data", total=len(names))
        folder = place.runs / "data" / plan.fingerprint[:12]
        with worker_pool(place.jobs) as workers:
            return load_or_build(plan, split, folder, workers, lambda count: progress.advance(task, count))

    return plan.fingerprint, load


def _checked(built: Built, split: str, progress: Progress) -> Split:
    """A split of data that is built already; reading and checking it is shown where it takes longer than a moment."""
    if sum(path.stat().st_size for path in built.shards(split) if path.is_file()) < MOMENT:
        return built.split(split)
    task = progress.add_task(f"checking the {split} data", total=built.objects(split))
    return built.split(split, lambda count: progress.advance(task, count))


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
