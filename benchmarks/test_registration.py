"""Registration of four touches of 512 points. Asked for: under 50 ms a touch, whatever the size of the cloud.

make bench ARGS="benchmarks/test_registration.py --save=registration"
"""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pcsr import register
from pcsr.geometry.sampling import surface_points
from pcsr_plugins.shapes.cad_parts import CadParts
from pcsr_plugins.touch.digit import Digit
from pcsr_plugins.touch.digit.noise import Noise

SIZES = (512, 20_000, 500_000)
TOUCHES = 4


@pytest.fixture(scope="module")
def item():
    shapes = CadParts(held_out=24)
    return shapes.item(shapes.names("test")[0])


@pytest.fixture(scope="module")
def touches(item):
    source = Digit(object_size=30.0, noise=Noise(position_noise=1.0, rotation_noise=2.0))
    return source.touches(item, np.zeros((1, 3)), TOUCHES, 0)


def cloud_of(item, count):
    return surface_points(item.mesh, count, np.random.default_rng(0))


@pytest.mark.parametrize("count", SIZES)
def test_registration(benchmark, line, item, touches, count):
    line(f"{TOUCHES} touches, cloud of {count:,}", "ours", "≤ 50 ms a touch")
    registered = benchmark(register, touches, cloud_of(item, count))
    assert len(registered.touches) == TOUCHES
    benchmark.extra_info["says"] = f"{1e3 * benchmark.stats['min'] / TOUCHES:.0f} ms a touch"


@pytest.mark.parametrize("count", SIZES)
def test_the_nearest_points_alone(benchmark, line, item, touches, count):
    """A tree of the cloud, and the point nearest to each touched one, as in one step of ICP."""
    line(f"{TOUCHES} touches, cloud of {count:,}", "limit")
    cloud = cloud_of(item, count)

    def search():
        tree = cKDTree(cloud)
        return [tree.query(touch.points) for touch in touches]

    benchmark(search)
