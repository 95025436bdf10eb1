"""Settings for every test, and a small world to build data from: balls, caps of them, objects that fail."""

import os

import pytest
from hypothesis import settings

# Two processes of two threads each on two cores wait for one another most of the time. Here and in what tests start.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# Where a test is about more threads, they sleep while they wait, as those of commands do.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

# How long an example takes depends on who else uses the machine, so no example fails for being slow.
# Where changes are judged (CI), all are by the same examples; elsewhere each run looks at new ones.
settings.register_profile("pcsr", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("pcsr")


def pytest_report_header():
    """The instruction set that torch computes by: the Makefile's PROCESSOR, or the best that there is."""
    import torch

    return f"torch {torch.__version__} computes by {torch.backends.cpu.get_cpu_capability()}"


def pytest_runtest_setup(item):
    if item.get_closest_marker("gpu"):
        import torch

        if not torch.cuda.is_available():
            pytest.skip("it needs a GPU, and CUDA is not available")


WORLD = """
import os
import numpy as np
import trimesh
from pcsr import ShapeItem, ShapeSource, Touch, TouchSource, UserError, hookimpl


class Balls(ShapeSource):
    def __init__(self, *, count: int = 10, held_out: int = 0, bad: tuple[int, ...] = (), mark: str = "") -> None:
        self.counts = {"train": count, "validation": held_out, "test": held_out}
        self.bad, self.mark = bad, mark

    def names(self, split):
        return [f"{split}/{i:03d}" for i in range(self.counts[split])]

    def item(self, name):
        number = int(name[-3:])
        if self.mark:  # so that a test sees who was made
            with open(self.mark, "a") as file:
                file.write(name + "\\n")
        if number in self.bad:
            raise UserError(f"{name}: a bad ball")
        return ShapeItem(name, "ball", trimesh.creation.icosphere(subdivisions=1, radius=1.0 + number))

    def digest(self, name):
        return ""


class Caps(TouchSource):
    version = 1

    def __init__(self, *, points: int = 20, fault: str = "", uneven: bool = False) -> None:
        self.points, self.fault, self.uneven = points, fault, uneven

    def touches(self, item, cloud, count, seed):
        if item.name == self.fault and not os.path.exists(self.fault.replace("/", "-")):
            raise ZeroDivisionError("a slip of the plugin")
        rng = np.random.default_rng(seed)
        vertices = item.mesh.vertices
        near = [vertices[np.linalg.norm(vertices - vertices[i], axis=1).argsort()[:12]] for i in range(count)]
        points = self.points + self.uneven * int(item.name[-1])
        return [Touch.single(cap, np.eye(4), 1.0, "cap").resampled(points, rng) for cap in near]


@hookimpl
def pcsr_register(register):
    register.shapes("balls", Balls)
    register.touch("caps", Caps)
"""


@pytest.fixture(scope="session")
def world(tmp_path_factory):
    path = tmp_path_factory.mktemp("world") / "world.py"
    path.write_text(WORLD)
    return path
