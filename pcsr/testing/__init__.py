"""The conformance suite: checks that a part keeps the contract of its kind.

With pytest::

    from pcsr.testing import checks_for

    @pytest.mark.parametrize("check", checks_for(MyFusion), ids=str)
    def test_part(check):
        check()

On the command line: ``pcsr plugins check my-fusion``.

Parts are run on clouds of 64 points and more. Their initial weights are perturbed, since a layer of zeros would hide
mistakes before it. Most checks use double precision, so that differences are not due to rounding.
"""

from pcsr.testing.check import Check, CheckFailed, Outcome, Skipped
from pcsr.testing.suite import check_part, checks_for

__all__ = ["Check", "CheckFailed", "Outcome", "Skipped", "check_part", "checks_for"]
