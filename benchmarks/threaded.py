"""One kind of work again and again, each time a line comes in; prints the seconds that it took.

python benchmarks/threaded.py upsample|inference|tapsr|smoke as-pcsr|as-torch

as-pcsr: with the threads that pcsr gives it, in trainings and evaluations waiting as commands do;
as-torch: with all threads that torch has, as if pcsr had no say.
"""

import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pcsr.threads

POINTS = 8_000


@contextmanager
def unlimited(_count: int) -> Iterator[int]:
    """In place of `pcsr.threads.threads`."""
    import torch

    yield torch.get_num_threads()


def upsample() -> Callable[[], object]:
    """The default weights on a cloud of a person's own, from Python."""
    import numpy as np

    cloud = np.random.default_rng(0).normal(size=(POINTS, 3))
    cloud /= np.linalg.norm(cloud, axis=1, keepdims=True)
    model = pcsr.load()
    return lambda: model.upsample(cloud)


def inference() -> Callable[[], object]:
    """TAPSR on ten clouds of 512 points with four touches, as validation and evaluation do it."""
    from training import recipe, split

    from pcsr.experiments.recorder import validate

    network, clouds = pcsr.load("tapsr").network, split(10)
    return lambda: validate(network, clouds, recipe())


def tapsr() -> Callable[[], object]:
    """Two steps of TAPSR's training, eight clouds each, with their validations."""
    from training import BATCH, recipe, split

    return training(recipe("train.epochs=2"), split(BATCH), split(1))


def smoke() -> Callable[[], object]:
    """The training of pcsr/recipes/smoke.yaml: eight steps of eight clouds of 128 points."""
    from training import RECIPE, split

    from pcsr.plugins.loading import load_plugins
    from pcsr.recipe import load

    (recipe,) = load(RECIPE.with_name("smoke.yaml"), load_plugins())
    return training(recipe, split(32, 128, 4, 64), split(8, 128, 4, 64))


def training(recipe: object, data: object, validation: object) -> Callable[[], object]:
    """All of it, from the first weights on."""
    from lightning_fabric import Fabric

    from pcsr.experiments.train import train
    from pcsr.plugins.loading import load_plugins

    def run() -> None:
        with tempfile.TemporaryDirectory() as folder:
            fabric = Fabric(accelerator="cpu", devices=1)
            train(recipe, load_plugins(), data, validation, Path(folder), fabric)

    return run


WORK = {"upsample": upsample, "inference": inference, "tapsr": tapsr, "smoke": smoke}


def main(work: str, how: str) -> None:
    """Once to warm up, then once for each line."""
    if how == "as-torch":
        pcsr.threads.threads = unlimited  # before anybody imports it
    elif work != "upsample":
        pcsr.threads.wait_passively()
    out, sys.stdout = sys.stdout, open(os.devnull, "w")  # noqa: SIM115
    run = WORK[work]()
    run()
    print("ready", file=out, flush=True)
    for _ in sys.stdin:
        start = time.perf_counter()
        run()
        print(time.perf_counter() - start, file=out, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
