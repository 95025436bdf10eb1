"""Network of a run, with weights that the recipe names, that a run folder holds, or that are trained."""

import shutil
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.progress import Progress

import pcsr
from pcsr.counted import counted
from pcsr.data.built import BuiltData
from pcsr.data.loading import LOADERS
from pcsr.data.source import Data
from pcsr.errors import PcsrWarning, UserError
from pcsr.experiments.environment import record, write_environment
from pcsr.experiments.finished_runs import EarlierWeights, of_other_code, of_recipe
from pcsr.experiments.recorder import checkpoint_step
from pcsr.experiments.run_options import RunOptions, run_folder
from pcsr.experiments.train import train
from pcsr.grafting.description import described
from pcsr.grafting.grafted_network import GraftedNetwork
from pcsr.network.card import other_code
from pcsr.network.kinds import AnyNetwork
from pcsr.network.load import load_weights
from pcsr.network.save import save_weights
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe
from pcsr.recipe.pretrained import check_weights
from pcsr.run_files import CHECKPOINT, ENVIRONMENT, read_environment, snapshot_file
from pcsr.weights import WEIGHTS
from pcsr.weights.file import read_card

if TYPE_CHECKING:
    from lightning_fabric import Fabric

RETRAINING = "retraining"
"""Folder within a run folder for the checkpoint and the history of `--retrain`, until training is finished."""


def trained(
    recipe: Recipe,
    registry: Registry,
    fingerprint: str,
    data: Data,
    fabric: "Fabric",
    options: RunOptions,
    progress: Progress,
) -> tuple[AnyNetwork, dict[str, Any]]:
    """Return the network of a recipe with finished weights, and the origin of the weights.

    Weights that the recipe names are loaded, or else finished weights of exactly this recipe, its data and the code of
    its parts, or, with `options.keep_weights`, weights of other code. Otherwise the network is trained.

    Args:
        recipe: recipe of the run.
        registry: installed parts.
        fingerprint: fingerprint of the data.
        data: function that returns a split of the data.
        fabric: launched Fabric, with the device and the processes of training.
        options: folder of the runs, and the treatment of existing weights.
        progress: progress bars and console for messages.

    Returns:
        The network, and the fields of `pcsr.results.Training`. After training only the first process has the fields.

    Raises:
        UserError: the weights that the recipe or the options ask for do not exist or cannot be used.
    """
    named = check_weights(recipe, registry)
    folder = run_folder(recipe, options)
    if named is not None and options.retrain:
        raise UserError(f"recipe '{recipe.name}' names weights, so that nothing is trained: leave out --retrain")
    if named is not None:
        source = f"{named.path.stem} of recipe '{named.recipe.name}', sha256 {named.sha256[:12]}"
        loaded = _loaded(named.path, source, registry, progress)
        named.check_unchanged()
        return loaded
    exact = None if options.retrain else of_recipe(recipe, fingerprint, options.runs, folder)
    if exact is not None:
        return _loaded(*exact, registry, progress)
    earlier = None if options.retrain else of_other_code(recipe, fingerprint, options.runs, registry)
    if options.keep_weights:
        return _kept(recipe, earlier, registry, options, progress)
    # Existing weights and their history are replaced only when the new weights are finished.
    training_folder = folder / RETRAINING if options.retrain else folder
    # One process writes the recipe and builds the data. The others wait and then read it.
    with fabric.rank_zero_first():
        train_data, validation = data("train", progress), data("validation", progress)
        if fabric.is_global_zero:
            data("test", progress)  # report missing or damaged data before hours of training
            record(training_folder, "training", recipe, registry, options.command)
    if fabric.is_global_zero:
        if earlier is not None:
            remedy = "training again; --keep-weights measures the old weights with the new code"
            progress.console.print(f"{earlier}: {remedy}", markup=False, soft_wrap=True)
        why = "--retrain" if options.retrain else "no weights of exactly this recipe yet"
        step = checkpoint_step(training_folder, fingerprint)
        epochs = counted(recipe.train.epochs, "epoch")
        doing = f"training goes on after step {step}, {epochs} in all" if step else f"training, {epochs}"
        progress.console.print(f"{why}: {doing}")
    card = _card(recipe, fingerprint, options)

    def save(file: Path, network: AnyNetwork, training: dict[str, Any]) -> None:
        graft = {"graft": described(network)} if isinstance(network, GraftedNetwork) else {}
        save_weights(file, network, {**card, **graft, "training": training}, registry)

    task = progress.add_task("training", total=None)
    network, training = train(
        recipe,
        registry,
        train_data,
        validation,
        training_folder,
        fabric,
        shown=lambda p: progress.update(
            task, total=p.steps, completed=p.step, description=f"training, loss {1e3 * p.loss:.3f} ×10⁻³"
        ),
        kept=lambda network, step, so_far: save(training_folder / snapshot_file(step), network, so_far),
        loaders=max(1, options.jobs // fabric.world_size) if options.jobs else LOADERS,
        data_fingerprint=fingerprint,
    )
    if not fabric.is_global_zero:  # the first process writes the history, and may still be writing
        return network, {}
    if "best_step" in training:
        text = f"training ended after step {training['steps']}; the weights kept are those of step"
        progress.console.print(f"{text} {training['best_step']}, with the lowest validation error")
    save(folder / WEIGHTS, network, training)
    training["weights"] = read_card(folder / WEIGHTS)["sha256"]
    if options.retrain:
        write_environment(folder, "training", read_environment(training_folder)["training"])
        (training_folder / ENVIRONMENT).unlink()
        (training_folder / CHECKPOINT).unlink()  # first: a checkpoint without its history is useless
        for path in training_folder.iterdir():
            target = folder / path.name
            if target.is_dir():
                shutil.rmtree(target)
            path.replace(target)
        training_folder.rmdir()
    (folder / CHECKPOINT).unlink(missing_ok=True)
    return network, {**training, "source": "trained by this run"}


def _card(recipe: Recipe, fingerprint: str, options: RunOptions) -> dict[str, Any]:
    """Return the card of weights without its fields `training` and `graft`."""
    card: dict[str, Any] = {
        "name": recipe.name,
        "fingerprint": recipe.fingerprint,
        "data_fingerprint": fingerprint,
        "recipe": recipe.resolved(),
        "version": pcsr.__version__,
    }
    if recipe.code:
        card["settings_fingerprint"] = recipe.settings_fingerprint
    if options.data:
        card["data"] = BuiltData.read(options.data).card()
    return card


def _kept(
    recipe: Recipe, earlier: EarlierWeights | None, registry: Registry, options: RunOptions, progress: Progress
) -> tuple[AnyNetwork, dict[str, Any]]:
    """Load weights that were trained with other code of a part; the results record it.

    Raises:
        UserError: there are no such weights, or they do not fit the current code.
    """
    if earlier is None:
        raise UserError(
            f"--keep-weights: {options.runs} holds no weights of recipe '{recipe.name}', of this code or of other "
            f"code: leave it out, and it is trained"
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


def _loaded(path: Path, source: str, registry: Registry, progress: Progress) -> tuple[AnyNetwork, dict[str, Any]]:
    """Load a network from a weights file, with the fields of `pcsr.results.Training` from its card."""
    progress.console.print(f"weights: {source}, {path}", markup=False, soft_wrap=True)
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always", PcsrWarning)
        network, recipe, card = load_weights(path, registry)
    for one in warned:
        progress.console.print(str(one.message), style="yellow", markup=False, soft_wrap=True)
    differs = other_code(recipe, card, registry)
    marked = {} if differs is None else {"other_code": f"{path} was {differs}"}
    training = card.get("training")
    about = training if isinstance(training, dict) else {}
    return network, {**about, "source": source, "weights": card.get("sha256"), **marked}
