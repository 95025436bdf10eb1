"""Values of a recipe that are valid by themselves but contradict each other."""

from pcsr.plugins.registry import Registry
from pcsr.recipe.graft import graft_mistakes
from pcsr.recipe.optimizers import optimizer_mistake
from pcsr.recipe.part_keys import NAMES, PART_LISTS
from pcsr.recipe.schema import MOST_RAYS, MOST_TRUTH, GraftedModel, Patches, Recipe
from pcsr.recipe.source import Mistake, Source
from pcsr.recipe.train_section import Train
from pcsr.results import BOUND

TAKEN = ("input", "truth", "touches", BOUND)
"""Names that results have for other things than the network, which is named as the recipe."""


def contradictions(source: Source, recipe: Recipe, registry: Registry, *, trains: bool) -> list[Mistake]:
    """List the values that are valid by themselves but contradict each other.

    Args:
        source: data of the recipe, with the locations of its values.
        recipe: the recipe.
        registry: installed parts.
        trains: whether the recipe is trained.
    """
    found = []
    if recipe.name in (*TAKEN, *recipe.evaluate.baselines):
        text = f"name: '{recipe.name}' is the name of another cloud or row of the results: take another"
        found.append(Mistake(source.location(("name",)), text))
    low, high = recipe.touch_range
    if low > high:
        text = f"train.touches: the minimum, {low}, is more than the maximum, {high}: swap them"
        found.append(Mistake(source.location(("train", "touches")), text))
    for section, key in (*NAMES, *PART_LISTS, ("train", "augment")):
        names = [getattr(one, "use", one) for one in getattr(getattr(recipe, str(section)), str(key))]
        for index, name in enumerate(names):
            if name in names[:index]:
                text = f"{section}.{key}: '{name}' is listed twice: remove one of the two"
                found.append(Mistake(source.location((section, key, index)), text))
    found += _too_large(source, recipe)
    if trains:
        for key, text in _training(recipe.train):
            found.append(Mistake(source.location(("train", *key.split("."))), f"train.{key}: {text}"))
    if recipe.patches:
        found += _patch_mistakes(source, recipe, recipe.patches)
    if isinstance(recipe.model, GraftedModel):
        return found + graft_mistakes(source, recipe, recipe.model.graft)
    fusion = recipe.model.fusion.use
    if recipe.model.touch_encoder is not None and not registry.get("fusion", fusion).uses_touch_features:
        text = f"fusion '{fusion}' uses no touch features, so a touch_encoder has no effect: remove it"
        found.append(Mistake(source.location(("model", "touch_encoder")), text))
    return found


def _training(train: Train) -> list[tuple[str, str]]:
    """Return the values of a training that contradict each other: for each the key within `train` and a message."""
    found = []
    if train.warmup >= train.epochs:
        found.append(("warmup", f"{train.warmup:g} epochs are not fewer than train.epochs, {train.epochs}: lower it"))
    if train.final_learning_rate > train.learning_rate:
        text = f"{train.final_learning_rate:g} is more than train.learning_rate, {train.learning_rate:g}: lower it"
        found.append(("final_learning_rate", text))
    if train.validate_every is not None and train.validate_every > train.epochs:
        text = f"{train.validate_every} epochs are more than train.epochs, {train.epochs}: lower it"
        found.append(("validate_every", text))
    if train.average is not None:
        start, decay = train.average.start, train.average.decay
        if start is not None and start >= train.epochs:
            found.append(("average.start", f"{start} epochs are not fewer than train.epochs, {train.epochs}: lower it"))
        if train.average.use == "swa" and decay is not None:
            found.append(("average.decay", "swa is a mean and takes no decay: remove it, or name ema"))
    if (refusal := optimizer_mistake(train.optimizer)) is not None:
        found.append(("optimizer", refusal))
    return found


def _too_large(source: Source, recipe: Recipe) -> list[Mistake]:
    """List the sizes of the data whose product exceeds a limit."""
    data, view, found = recipe.data, recipe.data.view, []
    truth, rays = data.points * data.rate, view.cameras * view.pixels**2
    if truth > MOST_TRUTH:
        text = f"data.points × data.rate are {truth} points of an object, more than {MOST_TRUTH}: lower one of them"
        found.append(Mistake(source.location(("data", "points")), text))
    if rays > MOST_RAYS:
        text = (
            f"data.view: {view.cameras} cameras of {view.pixels} × {view.pixels} pixels are {rays} rays, "
            f"more than {MOST_RAYS}: lower cameras or pixels"
        )
        found.append(Mistake(source.location(("data", "view")), text))
    return found


def _patch_mistakes(source: Source, recipe: Recipe, patches: Patches) -> list[Mistake]:
    """List the mistakes in the section `patches`, which depend on the sizes of the data."""
    data = recipe.data
    found = []
    reached = patches.rate
    while reached < data.rate:
        reached *= patches.rate
    if reached != data.rate:
        text = (
            f"patches.rate is {patches.rate}, and no power of it is data.rate, {data.rate}: "
            f"repeated passes of the network cannot reach that rate"
        )
        found.append(Mistake(source.location(("patches", "rate")), text))
    if patches.points * patches.rate > data.points * data.rate:
        text = (
            f"patches.points: a patch of {patches.points} points covers {patches.points * patches.rate} points of the "
            f"truth, which has only {data.points * data.rate}: lower it"
        )
        found.append(Mistake(source.location(("patches", "points")), text))
    return found
