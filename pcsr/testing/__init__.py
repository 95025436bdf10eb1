"""The conformance suite: whether a part, of whatever kind and by whomever, keeps the contract of its kind.

With pytest::

    from pcsr.testing import checks_for

    @pytest.mark.parametrize("check", checks_for(MyFusion), ids=str)
    def test_part(check):
        check()

On the command line: ``pcsr plugins check my-fusion``.

Parts are tried at clouds of 64 points and more, with weights a little off those that they start with, so that a layer
which starts at zero hides nothing; most checks are in double precision, where what differs is no rounding.
"""

from pcsr.testing.check import Check, CheckFailed, Outcome, Skipped
from pcsr.testing.suite import check_part, checks_for

__all__ = ["Check", "CheckFailed", "Outcome", "Skipped", "check_part", "checks_for"]
