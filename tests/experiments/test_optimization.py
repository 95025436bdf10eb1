"""The learning rate of each step, against the schedulers of torch; the optimizers by name."""

import warnings

import pytest
import torch
from torch.optim import lr_scheduler as schedulers

from pcsr.contracts import Objective
from pcsr.experiments.optimization import learning_rate, optimizer_of, set_learning_rate
from pcsr.recipe.optimizers import OPTIMIZERS
from pcsr.recipe.section import PartSpec
from pcsr.recipe.train_section import Train

PER_EPOCH = 5


def settings(**changes):
    return Train(objective=PartSpec(use="chamfer"), **{"learning_rate": 0.1, "epochs": 8, **changes})


def rates(train):
    return [learning_rate(train, step, PER_EPOCH) for step in range(train.epochs * PER_EPOCH)]


def torch_rates(make, steps, unit=1):
    """The rates that a scheduler of torch sets, which is stepped after every `unit` steps."""
    optimizer = torch.optim.SGD([torch.zeros(1, requires_grad=True)], lr=0.1)
    scheduler, found = make(optimizer), []
    for step in range(steps):
        found.append(optimizer.param_groups[0]["lr"])
        optimizer.step()
        if (step + 1) % unit == 0:
            scheduler.step()
    return found


@pytest.mark.parametrize(
    ("epochs", "decay_every", "epoch", "falls"),
    [(300, None, 29, 0), (300, None, 30, 1), (300, None, 299, 9), (5, None, 3, 3), (300, 50, 149, 2)],
)
def test_by_default_it_falls_in_steps(epochs, decay_every, epoch, falls):
    train = settings(epochs=epochs, decay_every=decay_every)
    assert learning_rate(train, epoch * PER_EPOCH + 4, PER_EPOCH) == pytest.approx(0.1 * 0.7**falls)


def test_steps_are_those_of_torch():
    train = settings(decay=0.5, decay_every=3)
    expected = torch_rates(lambda o: schedulers.StepLR(o, 3, gamma=0.5), 40, unit=PER_EPOCH)
    assert rates(train) == pytest.approx(expected)


@pytest.mark.parametrize("warmup", [0.0, 0.2, 2.0])
@pytest.mark.parametrize("final", [0.0, 0.01])
def test_cosine_after_warm_up_is_that_of_torch(warmup, final):
    train = settings(schedule="cosine", warmup=warmup, final_learning_rate=final)
    count = int(warmup * PER_EPOCH)

    def make(optimizer):
        rise = schedulers.LinearLR(optimizer, 1 / (count + 1), 1.0, total_iters=count) if count else None
        fall = schedulers.CosineAnnealingLR(optimizer, 40 - count, eta_min=final)
        return schedulers.SequentialLR(optimizer, [rise, fall], [count]) if rise else fall

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # some versions of torch warn of how SequentialLR calls its own schedulers
        expected = torch_rates(make, 40)
    assert rates(train) == pytest.approx(expected)


def test_a_straight_line_is_that_of_torch():
    expected = torch_rates(lambda o: schedulers.LinearLR(o, 1.0, 0.2, total_iters=40), 40)
    assert rates(settings(schedule="linear", final_learning_rate=0.02)) == pytest.approx(expected)


def test_warm_up_rises_from_almost_nothing_to_the_rate_and_falls_afterwards():
    found = rates(settings(warmup=1.0, decay=1.0))
    assert found[:6] == pytest.approx([0.1 * k / 6 for k in (1, 2, 3, 4, 5, 6)])
    assert set(found[6:]) == {0.1}


class Judge(Objective):
    lr_multiplier = 0.5

    def __init__(self):
        super().__init__()
        self.own = torch.nn.Parameter(torch.ones(1))


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_each_optimizer_is_that_of_torch_with_its_options_and_two_groups(name):
    options = {"weight_decay": 0.25} if name != "rprop" else {"etas": (0.25, 1.5)}
    train = settings(optimizer=PartSpec(use=name, options=options))
    network = torch.nn.Linear(2, 3)
    optimizer = optimizer_of(train, network, Judge())
    set_learning_rate(optimizer, 0.125)
    assert type(optimizer).__name__.lower() == name
    assert [group["lr"] for group in optimizer.param_groups] == [0.125, 0.0625]
    assert all(group[key] == value for group in optimizer.param_groups for key, value in options.items())
    network(torch.ones(2)).sum().backward()
    before = network.weight.clone()
    optimizer.step()
    assert not torch.equal(network.weight, before)
