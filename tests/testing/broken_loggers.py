"""Loggers that break their contract, by the check that must fail."""

import numpy as np
import torch

from tests.testing.parts import Notes


class WantsMore(Notes):
    def log(self, step, values):
        super().log(step, {"accuracy": values["accuracy"]})


class BeginsOnce(Notes):
    def start(self, folder, recipe, step):
        (folder / "notes").mkdir()
        super().start(folder / "notes", recipe, step)


class NeedsAStep(Notes):
    def finish(self, completed):
        self.path.read_text()


class Pops(Notes):
    def log(self, step, values):
        values.pop("seconds", None)
        super().log(step, values)


class DrawsItsName(Notes):
    def start(self, folder, recipe, step):
        super().start(folder, recipe, step)
        self.name = np.random.rand()  # noqa: NPY002


class DrawsFromTorch(Notes):
    def log(self, step, values):
        super().log(step, {"noise": float(torch.rand(()))})


BROKEN = [
    ("logs", WantsMore, "it raised KeyError: 'accuracy'"),
    ("resumes", BeginsOnce, "it raised FileExistsError"),
    ("interrupted", NeedsAStep, "it raised FileNotFoundError"),
    ("leaves-values", Pops, "it changes what it is given"),
    ("leaves-random-numbers", DrawsItsName, "it draws random numbers"),
    ("leaves-random-numbers", DrawsFromTorch, "it draws random numbers"),
]
