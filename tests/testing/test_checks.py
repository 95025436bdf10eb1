"""The conformance suite: sound parts pass it, and each check fails a part that is broken in just that."""

import numpy as np
import pytest
import torch
from torch import nn

from pcsr import Trait, Upsampler, UserError
from pcsr.testing import Check, CheckFailed, Outcome, Skipped, check_part, checks_for, learning
from pcsr.testing.stop_gradient import slopes
from tests.testing import broken_construction, broken_data, broken_loggers, broken_network, broken_policies
from tests.testing.parts import SOUND, Attend, Boxes, Copy, Join, Lift, Pats, Refine, Squares

BROKEN = [
    *broken_construction.BROKEN,
    *broken_network.BROKEN,
    *broken_data.BROKEN,
    *broken_loggers.BROKEN,
    *broken_policies.BROKEN,
]


class OneBox(Pats):
    def touches(self, item, cloud, count, seed):
        if item.name != "train/0":
            raise UserError(f"{item.name}: there is no recording of it")
        return super().touches(item, cloud, count, seed)


def run(name, part, **given):
    (check,) = [check for check in checks_for(part, **given) if check.name == name]
    check()


@pytest.mark.parametrize("part", [*SOUND.values(), Join], ids=lambda part: part.__name__)
def test_a_sound_part_passes_every_check(part):
    outcomes = check_part(part)
    assert [one for one in outcomes if one.result == "failed"] == []
    skipped = {one.check for one in outcomes if one.result == "skipped"}
    local = {"trait-local"}
    wanted = {
        Attend: {"ragged-join"},
        Join: {"gradcheck", "export"},
        Lift: local,
        Refine: local,
        Copy: {"trait-any-rate", *local},
    }
    assert skipped - {"gradcheck"} == wanted.get(part, set()) - {"gradcheck"}


@pytest.mark.parametrize(("name", "part", "said"), BROKEN, ids=[f"{name}-{part.__name__}" for name, part, _ in BROKEN])
def test_a_broken_part_fails_the_check(name, part, said):
    with pytest.raises(CheckFailed, match=said) as caught:
        run(name, part)
    assert part.__name__ in str(caught.value)
    assert "; expected is " in str(caught.value)


def test_every_check_has_a_part_that_fails_it():
    names = {check.name for part in SOUND.values() for check in checks_for(part)}
    assert names == {name for name, _, _ in BROKEN}


@pytest.mark.parametrize(
    ("name", "part", "said"),
    [
        ("trait-any-rate", Copy, "does not claim 'any-rate', and refuses rate 2"),
        ("ragged-join", Attend, "does not join touches"),
        ("shapes", broken_construction.Trips, "cannot be built: see the check 'builds'"),
        ("items", type("Unbuildable", (Boxes,), {"__init__": lambda self: 1 / 0}), "cannot be built"),
    ],
)
def test_a_check_that_says_nothing_of_a_part_says_why(name, part, said):
    with pytest.raises(Skipped, match=said):
        run(name, part)


def test_a_trait_that_holds_and_is_not_claimed_is_reported():
    class Modest(Attend):
        traits = frozenset({Trait.PERMUTATION_EQUIVARIANT})

    with pytest.raises(Skipped, match="does not claim 'touch-permutation-invariant', though it held here: claim it"):
        run("trait-touch-permutation-invariant", Modest)


def test_a_part_that_computes_outside_of_torch_is_not_exported():
    class Outside(Lift):
        def forward(self, points):
            return super().forward(torch.from_numpy(np.sin(points.numpy())))

    with pytest.raises(Skipped, match="cannot be exported: RuntimeError"):
        run("export", Outside)


def test_a_batch_norm_ties_rows_in_training_alone():
    class LinearNormReLU(Refine):
        def __init__(self, widths) -> None:
            super().__init__(widths)
            self.norm = nn.BatchNorm1d(7)

        def forward(self, points, features):
            made = super().forward(points, features)
            return self.norm(made.flatten(0, 1)).view(made.shape)

    assert [one for one in check_part(LinearNormReLU) if one.result == "failed"] == []


def test_a_layer_that_starts_at_zero_hides_nothing():
    class Zero(Refine):
        def __init__(self, widths) -> None:
            super().__init__(widths)
            self.last = nn.Linear(7, 7)
            nn.init.zeros_(self.last.weight)

        def forward(self, points, features):
            return self.last(super().forward(points, features))

    class ZeroInFileOrder(Zero):
        def forward(self, points, features):
            return super().forward(points, features.cumsum(1))

    run("gradients", Zero)
    with pytest.raises(CheckFailed, match="another order"):
        run("trait-permutation-equivariant", ZeroInFileOrder)


def test_what_is_kept_out_of_the_gradient_on_purpose_is_not_called_wrong():
    class Weighted(Refine):
        def forward(self, points, features):
            with torch.no_grad():
                weights = torch.softmax(features, -1).square().add_(1)
                top = weights.topk(3, dim=-1)
            made = super().forward(points, features * weights + features.detach())
            return made * top.values.sum(-1, keepdim=True) * features.detach().numpy().shape[-1]

    run("gradcheck", Weighted)


def test_a_result_that_jumps_here_and_there_is_not_called_wrong(monkeypatch):
    class Jumps(Refine):
        def forward(self, points, features):
            return super().forward(points, features + (30_000 * features).floor() / 30_000)

    class JumpsWrongly(Jumps):
        def forward(self, points, features):
            return super().forward(points, broken_network._Wrong.apply(features))

    run("gradcheck", Jumps)
    with pytest.raises(CheckFailed, match="derivative is wrong"):
        run("gradcheck", JumpsWrongly)
    monkeypatch.setattr(learning, "STEPS", (1e-6,))  # what one difference alone would say
    with pytest.raises(CheckFailed, match="derivative is wrong"):
        run("gradcheck", Jumps)


def test_slopes_are_those_of_calculus():
    x = torch.tensor([0.5, -1.0], dtype=torch.float64, requires_grad=True)
    direction = {"x": torch.tensor([0.6, 0.8], dtype=torch.float64)}
    slope, difference, number = slopes(lambda: (x**3).sum() * x.detach().sum(), {"x": x}, direction, 1e-6)
    by_hand = float((3 * x.detach() ** 2 * direction["x"]).sum() * x.detach().sum())
    assert slope == pytest.approx(by_hand, rel=1e-12)
    assert difference == pytest.approx(by_hand, rel=1e-8)
    assert number == pytest.approx(0.4375)
    assert x.tolist() == [0.5, -1.0]
    wrong, right, _ = slopes(lambda: broken_network._Wrong.apply(x).sum(), {"x": x}, direction, 1e-6)
    assert wrong == pytest.approx(2.1 * 1.4)
    assert right == pytest.approx(2 * 1.4)


def test_an_objective_made_for_one_upsampler_is_handed_it():
    class Own(Copy):
        def __init__(self, widths) -> None:
            super().__init__(widths)
            self.special = True

    class Picky(Squares):
        def losses(self, network, points, truth, rate, touches=None):
            if not hasattr(network.upsampler, "special"):
                raise UserError("objective 'picky' wants the upsampler 'own'")
            return super().losses(network, points, truth, rate, touches)

    with pytest.raises(CheckFailed, match="refuses the suite's network"):
        run("gradients", Picky)
    assert issubclass(Own, Upsampler)
    assert [one for one in check_part(Picky, upsampler=Own) if one.result != "passed"] == []


def test_a_touch_source_is_handed_the_object_that_it_can_touch():
    assert [one.result for one in check_part(OneBox, points=4)].count("failed") == 4
    outcomes = check_part(OneBox, points=4, item=Boxes().item("train/0"))
    assert [one for one in outcomes if one.result != "passed"] == []


def test_options_are_given_to_the_part_in_every_check():
    class Needy(Lift):
        def __init__(self, widths, *, channels: int) -> None:
            super().__init__(widths, channels=channels)

    assert [one for one in check_part(Needy, channels=4) if one.result != "passed" and one.check != "trait-local"] == []


def test_checks_leave_torchs_random_numbers_as_they_were():
    torch.manual_seed(3)
    expected = torch.rand(4)
    torch.manual_seed(3)
    check_part(Lift)
    assert torch.equal(torch.rand(4), expected)


def test_a_check_is_called_has_a_name_and_tells_its_outcome():
    def fail():
        raise CheckFailed("no")

    def skip():
        raise Skipped("not here")

    def trip():
        raise KeyError("a fault of the suite")

    assert str(Check("one", fail)) == "one"
    assert Check("one", lambda: None).outcome() == Outcome("one", "passed")
    assert Check("one", fail).outcome() == Outcome("one", "failed", "no")
    assert Check("one", skip).outcome() == Outcome("one", "skipped", "not here")
    with pytest.raises(KeyError):
        Check("one", trip).outcome()
    with pytest.raises(CheckFailed):
        Check("one", fail)()


def test_what_is_of_no_kind_is_refused():
    for thing in (nn.Linear, int):
        with pytest.raises(UserError, match=r"is no part: give a class derived from one of pcsr\.Encoder, "):
            checks_for(thing)


def test_nothing_of_a_part_runs_before_a_check_is_called():
    class Loud(Lift):
        def __init__(self, widths) -> None:
            raise AssertionError("too early")

    assert len(checks_for(Loud)) == len(checks_for(Lift))
