"""`grad-pu`: the error of the distances that `descent` predicts."""

import pytest
import torch

from pcsr import UserError, Widths
from pcsr_plugins.objectives.grad_pu import GradPU as Objective
from pcsr_plugins.upsamplers.shuffle import Shuffle
from tests.plugins.published import lively, small_grad_pu


def test_the_objective_is_the_error_of_the_distances_of_noisy_midpoints():
    network, objective = lively(small_grad_pu()).eval(), Objective(sigma=0.1)
    points, truth = torch.randn(2, 20, 3), torch.randn(2, 50, 3)
    torch.manual_seed(11)  # of no consequence
    with torch.no_grad():
        (name, loss), *others = objective.losses(network, points, truth, 4).items()
    noise = 0.1 * torch.randn(2, 80, 3, generator=torch.Generator().manual_seed(0))
    start = network.upsampler.prepare(points, 4)
    candidates = start + noise
    with torch.no_grad():
        predicted = network.upsampler.distance(candidates, *network.refine(start))
    expected = 0.0
    for b in range(2):
        for i in range(80):
            true = min(float((candidates[b, i] - point).norm()) for point in truth[b])
            expected += abs(float(predicted[b, i]) - true) / 2
    assert name == "distance"
    assert not others
    assert float(loss) == pytest.approx(expected, rel=1e-4)


def test_its_noise_changes_from_batch_to_batch_and_goes_on_where_a_checkpoint_left_it():
    network, objective = small_grad_pu().eval(), Objective()
    clouds = torch.randn(2, 20, 3), torch.randn(2, 50, 3)
    with torch.no_grad():
        before = [float(objective.losses(network, *clouds, 4)["distance"]) for _ in range(2)]
        resumed = Objective()
        resumed.load_state_dict(objective.state_dict())
        after = [float(one.losses(network, *clouds, 4)["distance"]) for one in (objective, resumed)]
        assert len({*before, after[0]}) == 3
        assert after[0] == after[1]
        still = [float(objective.eval().losses(network, *clouds, 4)["distance"]) for _ in range(2)]
        assert still[0] == still[1]


def test_an_upsampler_without_distances_is_refused():
    network = small_grad_pu()
    network.upsampler = Shuffle(Widths(refined=24, rate=4))
    with pytest.raises(UserError, match=r"upsampler Shuffle predicts none: set model\.upsampler to descent"):
        Objective().losses(network, torch.randn(1, 20, 3), torch.randn(1, 50, 3), 4)
