"""Policies that break their contract, by the check that must fail."""

import numpy as np

from tests.testing.parts import Far


class OneScore(Far):
    def scores(self, candidates, cloud, touched):
        return super().scores(candidates, cloud, touched)[:1]


class Draws(Far):
    def scores(self, candidates, cloud, touched):
        return np.random.default_rng().random(len(candidates))


class NeedsMany(Far):
    def scores(self, candidates, cloud, touched):
        return np.full(len(candidates), np.nan if len(cloud) < 20 else 1.0)


class Hopes(Far):
    def error(self, candidates, cloud, touched):
        return "little"


class Loses(Far):
    def scores(self, candidates, cloud, touched):
        return -super().scores(candidates, cloud, touched)

    def error(self, candidates, cloud, touched):
        return 1.0


class Centres(Far):
    def scores(self, candidates, cloud, touched):
        cloud -= cloud.mean(0)
        return super().scores(candidates, cloud, touched)


BROKEN = [
    ("scores", OneScore, r"gave scores of shape \(1,\)"),
    ("repeatable", Draws, "gives other scores"),
    ("few-points", NeedsMany, "one finite number"),
    ("expects-gains", Hopes, "the expected error is 'little'"),
    ("expects-gains", Loses, "scores down to -"),
    ("leaves-clouds", Centres, "it changes what it is given"),
]
