"""Parts with signatures of pcsr 0.1."""

import pytest

from pcsr import Fusion, Objective, UserError
from pcsr.plugins import renamed


def test_a_fusion_that_takes_the_mask_beside_the_touches_is_refused():
    class Old(Fusion):
        def join(self, points, touches, mask):
            return points

    with pytest.raises(
        UserError, match=r"Old was written for pcsr 0\.1: join\(…, mask\) is now join\(points, touches\)"
    ):
        renamed.check_class(Old)


def test_an_objective_that_takes_the_mask_beside_the_touches_is_refused():
    class Old(Objective):
        def losses(self, network, points, truth, rate, touches=None, mask=None):
            return {}

    with pytest.raises(
        UserError, match=r"Old was written for pcsr 0\.1: losses\(…, mask\) is now losses\(.*, touches\)"
    ):
        renamed.check_class(Old)


def test_a_part_may_hand_through_whatever_it_is_given():
    class Through(Objective):
        def losses(self, *arguments, **keywords):
            return super().losses(*arguments, **keywords)

    class Wider(Fusion):
        def join(self, points, touches, extra=None):
            return points

    renamed.check_class(Through)
    renamed.check_class(Wider)
    assert issubclass(Through, Objective)
    assert issubclass(Wider, Fusion)
