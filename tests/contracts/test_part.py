"""Parts with signatures of pcsr 0.1."""

import pytest

from pcsr import Fusion, Objective, UserError


def test_a_fusion_that_takes_the_mask_beside_the_touches_is_refused():
    with pytest.raises(UserError, match=r"Old\.join has the parameter 'mask', as in pcsr 0\.1: remove it, and use"):

        class Old(Fusion):
            def join(self, points, touches, mask):
                return points


def test_an_objective_that_takes_the_mask_beside_the_touches_is_refused():
    with pytest.raises(UserError, match=r"Old\.losses has the parameter 'mask'.*`touches` is now a pcsr\.TouchBatch"):

        class Old(Objective):
            def losses(self, network, points, truth, rate, touches=None, mask=None):
                return {}


def test_a_part_may_hand_through_whatever_it_is_given():
    class Through(Objective):
        def losses(self, *arguments, **keywords):
            return super().losses(*arguments, **keywords)

    class Wider(Fusion):
        def join(self, points, touches, extra=None):
            return points

    assert issubclass(Through, Objective)
    assert issubclass(Wider, Fusion)
