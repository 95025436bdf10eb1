"""Touch on every network of Table 2: recipes/graft, each beside the recipe that it extends."""

from pathlib import Path

import pytest
import torch

import pcsr
from pcsr import TouchBatch
from pcsr.network.build import build
from pcsr.network.load import load_weights
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load

FOLDER = Path(pcsr.__file__).parent / "recipes"
GRAFTS = sorted(path.stem for path in (FOLDER / "graft").glob("*.yaml"))
POINTS, RATE, TOUCHES, TOUCHED = 64, 4, 2, 32
SMALL = ["data.points=256", f"data.rate={RATE}", f"data.touch.points={TOUCHED}"]
REGISTRY = load_plugins()


def recipe(path):
    (made,) = load(path, REGISTRY, SMALL)
    return made


def network(path):
    """As trained a little: where weights begin at zero, touch has no way to the output."""
    made = build(recipe(path), REGISTRY)
    torch.manual_seed(0)
    for weight in made.parameters():
        if weight.dim() and not weight.any():
            torch.nn.init.normal_(weight, std=0.05)
    return made.eval()


@pytest.fixture(params=GRAFTS)
def name(request):
    return request.param


def clouds(batch=2):
    truth = torch.nn.functional.normalize(torch.randn(batch, POINTS * RATE, 3), dim=-1)
    touched = torch.stack([truth[:, k::TOUCHES][:, :TOUCHED] for k in range(TOUCHES)], dim=1)
    return truth[:, ::RATE].contiguous(), truth, TouchBatch.of(touched)


def test_each_network_of_table_2_has_a_graft():
    ungrafted = {
        path.stem
        for path in FOLDER.glob("*.yaml")
        if not path.stem.startswith(("table", "tapsr", "smoke", "field", "frames", "pretrained"))
    }
    assert ungrafted == set(GRAFTS)


def test_without_touches_it_is_the_ungrafted_network_bit_for_bit(name):
    grafted, plain = network(FOLDER / "graft" / f"{name}.yaml"), network(FOLDER / f"{name}.yaml")
    weights = grafted.state_dict()
    plain.load_state_dict({key: weights[key] for key in plain.state_dict()})
    points, _, touched = clouds()
    expected = plain(points, RATE)
    assert torch.equal(grafted(points, RATE), expected)
    assert torch.equal(
        grafted(points, RATE, TouchBatch.of(touched.points, torch.zeros(2, TOUCHES, dtype=torch.bool))), expected
    )


def test_gradients_reach_the_touch_encoder_and_a_moved_touch_moves_the_output(name):
    grafted, (points, truth, touched) = network(FOLDER / "graft" / f"{name}.yaml"), clouds()
    objective = recipe(FOLDER / "graft" / f"{name}.yaml").train.objective.build(REGISTRY, "objective")
    sum(objective.losses(grafted, points, truth, RATE, touched).values()).backward()
    assert grafted.touch_encoder is not None
    assert all(weight.grad is not None and weight.grad.any() for weight in grafted.touch_encoder.parameters())
    with torch.no_grad():
        assert not torch.equal(
            grafted(points, RATE, touched), grafted(points, RATE, TouchBatch.of(touched.points * 0.5))
        )


@pytest.mark.slow
def test_a_short_training_lowers_the_loss(name):
    made = recipe(FOLDER / "graft" / f"{name}.yaml")
    grafted, objective = build(made, REGISTRY).train(), made.train.objective.build(REGISTRY, "objective")
    points, truth, touched = clouds()
    optimizer = torch.optim.Adam(grafted.parameters(), lr=1e-3)
    losses = []
    for _ in range(15):
        optimizer.zero_grad()
        # What the discriminator learns is no loss of the network.
        terms = objective.losses(grafted, points, truth, RATE, touched)
        loss = sum(value for key, value in terms.items() if key != "discriminator")
        loss.backward()
        optimizer.step()
        losses.append(float(loss.detach()))
    assert sum(losses[-3:]) < 0.97 * sum(losses[:3])


def test_weights_survive_a_round_trip(name, tmp_path):
    made, grafted = recipe(FOLDER / "graft" / f"{name}.yaml"), network(FOLDER / "graft" / f"{name}.yaml")
    card = {"name": made.name, "fingerprint": "", "data_fingerprint": "", "recipe": made.resolved(), "training": {}}
    save_weights(tmp_path / "w.safetensors", grafted, card, REGISTRY)
    again, _, _ = load_weights(tmp_path / "w.safetensors", REGISTRY)
    points, _, touched = clouds()
    assert torch.equal(again.eval()(points, RATE, touched), grafted(points, RATE, touched))
