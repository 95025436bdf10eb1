"""The section `train`: optimizers of torch with their options, averages, loggers, and their mistakes."""

import pytest
import torch

from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Entry
from pcsr.recipe import MODEL, RecipeError, check_card, from_resolved, load
from pcsr.recipe.optimizers import OPTIMIZERS, optimizer_options

MISTAKES = {
    "optimizer: SGDD": "there is no optimizer 'SGDD': did you mean 'sgd'?",
    "optimizer: 5": "train.optimizer is a section: write its keys under it, got 5",
    "optimizer: {use: adam, beta: [0.9, 0.99]}": "optimizer 'adam' takes no 'beta': did you mean 'betas'?",
    "optimizer: {use: adam, lr: 0.1}": "optimizer 'adam' takes no 'lr': ",
    "optimizer: {use: adam, fused: true}": "optimizer 'adam' takes no 'fused': ",
    "optimizer: {use: sgd, momentum: heavy}": "optimizer 'sgd'.momentum: it must be a number, got 'heavy'",
    "optimizer: {use: sgd, nesterov: 1}": "optimizer 'sgd'.nesterov: it must be true or false, got 1",
    "optimizer: {use: adam, betas: 0.9}": "optimizer 'adam'.betas: it must be a list, got 0.9",
    "optimizer: {use: sgd, momentum: -1}": "train.optimizer: sgd refuses its options: invalid momentum value: -1.0",
    "optimizer: {use: sgd, nesterov: true}": "train.optimizer: sgd refuses its options: nesterov momentum",
    "optimizer: {use: adam, weight_decay: 1.0e+300}": "train.optimizer: adam refuses its options: value cannot be conv",
    "schedule: cosin": "train.schedule: it must be 'steps', 'cosine' or 'linear', got 'cosin'",
    "final_learning_rate: 1": "train.final_learning_rate: 1 is more than train.learning_rate, 0.001: lower it",
    "warmup: 4": "train.warmup: 4 epochs are not fewer than train.epochs, 4: lower it",
    "warmup: 4.5": "train.warmup: 4.5 epochs are not fewer than train.epochs, 4: lower it",
    "warmup: -1": "train.warmup: it must be 0 or more, got -1",
    "clip_norm: 0": "train.clip_norm: it must be more than 0, got 0",
    "average: emma": "train.average.use: it must be 'ema' or 'swa', got 'emma'",
    "average: {decay: 0.9}": "train.average.use is missing: add it",
    "average: {use: ema, decay: 0}": "train.average.decay: it must be more than 0, got 0",
    "average: {use: ema, decay: 1.0}": "train.average.decay: it must be less than 1, got 1.0",
    "average: {use: swa, decay: 0.9}": "train.average.decay: swa is a mean and takes no decay: remove it, or name ema",
    "average: {use: swa, start: 4}": "train.average.start: 4 epochs are not fewer than train.epochs, 4: lower it",
    "patience: 0": "train.patience: it must be 1 or more, got 0",
    "validate_every: 5": "train.validate_every: 5 epochs are more than train.epochs, 4: lower it",
    "loggers: jsonl": "train.loggers: it must be a list, got 'jsonl'",
    "loggers: [jsnl]": "there is no logger 'jsnl': did you mean 'jsonl'?",
    "loggers: [3]": "train.loggers.0: name the part, as `- jsonl` or with `use:`",
    "loggers: [{use: jsonl, file: x}]": "logger 'jsonl' takes no 'file': none is known",
    "loggers: [jsonl, {use: jsonl}]": "train.loggers: 'jsonl' is listed twice: remove one of the two",
}


@pytest.mark.parametrize("written", MISTAKES)
def test_a_mistake_is_one_line_with_its_place(write, registry, written):
    with pytest.raises(RecipeError) as caught:
        load(write(f"name: a\ntrain:\n  epochs: 4\n  {written}", model=True), registry)
    (mistake,) = caught.value.mistakes
    assert mistake.location.line == 4
    assert mistake.text.startswith(MISTAKES[written])
    assert "\n" not in mistake.text


def train(write, registry, written):
    (recipe,) = load(write(f"name: a\ntrain: {written}", model=True), registry)
    return recipe.train


def test_an_optimizer_has_the_options_that_are_given(write, registry):
    made = train(write, registry, "{optimizer: {use: adam, betas: [0.5, 1e-1], weight_decay: 1}}").optimizer
    assert (made.use, made.options) == ("adam", {"betas": (0.5, 0.1), "weight_decay": 1.0})
    assert train(write, registry, "{optimizer: sgd}").optimizer.options == {}


def test_every_optimizer_of_torch_is_offered_or_named_as_unsuitable():
    kinds = {name for name, thing in vars(torch.optim).items() if isinstance(thing, type)}
    offered = {kind.__name__ for kind in OPTIMIZERS.values()}
    assert offered <= kinds <= offered | {"Optimizer", "LBFGS", "Muon", "SparseAdam"}


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_the_defaults_of_an_optimizer_are_valid_options(name):
    model = optimizer_options(name)
    defaults = {option: field.default for option, field in model.model_fields.items()}
    model.model_validate(defaults)
    OPTIMIZERS[name]([torch.zeros(1, requires_grad=True)], lr=0.1, **defaults)


def test_another_optimizer_drops_the_options_of_the_parents_and_the_same_keeps_them(write, registry):
    write(
        "name: p\ntrain: {optimizer: {use: sgd, momentum: 0.9}, average: {use: ema, decay: 0.5}}", "p.yaml", model=True
    )

    def child(written):
        (recipe,) = load(write(f"extends: p.yaml\nname: c\ntrain: {written}"), registry)
        return recipe.train

    assert child("{optimizer: adamw}").optimizer.options == {}
    kept = child("{optimizer: {nesterov: true}, average: {start: 2}}")
    assert kept.optimizer.options == {"momentum": 0.9, "nesterov": True}
    assert (kept.average.use, kept.average.decay, kept.average.start) == ("ema", 0.5, 2)
    assert child("{average: swa}").average.decay is None


def test_the_resolved_form_comes_back(write, registry):
    written = "{optimizer: {use: sgd, momentum: 0.9}, average: ema, loggers: [], warmup: 0.5}"
    (recipe,) = load(write(f"name: a\ntrain: {written}", model=True), registry)
    plain = recipe.resolved()
    assert plain["train"]["optimizer"] == {"use": "sgd", "momentum": 0.9}
    assert plain["train"]["average"] == {"use": "ema", "decay": None, "start": None}
    assert from_resolved(plain, registry) == recipe
    assert from_resolved(plain, registry).fingerprint == recipe.fingerprint


def test_settings_of_training_decide_the_fingerprint_and_loggers_do_not(write, registry):
    def fingerprint(written):
        (recipe,) = load(write(f"name: a\ntrain: {written}", model=True), registry)
        return recipe.fingerprint

    usual = fingerprint("{}")
    assert (
        fingerprint("{loggers: []}") == fingerprint("{optimizer: {use: adam}}") == fingerprint("{warmup: 0}") == usual
    )
    others = ["optimizer: sgd", "optimizer: {use: adam, eps: 0.1}", "schedule: cosine", "warmup: 1", "clip_norm: 1"]
    others += ["average: ema", "average: swa", "average: {use: ema, decay: 0.5}", "patience: 3", "validate_every: 2"]
    assert len({usual, *(fingerprint(f"{{{other}}}") for other in others)}) == 1 + len(others)


def test_a_card_may_name_optimizers_and_loggers_that_are_not_here(write, registry):
    (recipe,) = load(write("name: a", model=True), registry)
    plain = recipe.resolved()
    plain["train"] |= {"optimizer": {"use": "lion", "beta": 0.5}, "loggers": [{"use": "wandb", "project": "x"}]}
    made = check_card(plain, registry, "the card")
    assert (made.train.optimizer.use, made.train.loggers[0].options) == ("lion", {"project": "x"})
    assert made.resolved()["train"] == plain["train"]
    plain["train"]["optimizer"] = "adamw"  # as cards of pcsr 0.2 have it
    assert check_card(plain, registry, "the card").train.optimizer.use == "adamw"
    assert ("train", "objective") not in MODEL


def test_options_of_a_logger_are_those_of_its_constructor(write, registry):
    from pcsr import Logger

    class Project(Logger):
        def __init__(self, *, project: str, every: int = 5) -> None: ...

    registry = load_plugins()
    registry.add(Entry("logger", "project", Project, "tests", "1"))
    (recipe,) = load(write("extends: smoke\nname: a\ntrain: {loggers: [jsonl, {use: project, project: x}]}"), registry)
    assert [one.options for one in recipe.train.loggers] == [{}, {"project": "x", "every": 5}]
    (none,) = load(write("extends: smoke\nname: a"), registry, ["train.loggers=[]"])
    assert none.train.loggers == ()
