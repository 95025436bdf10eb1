import numpy as np

from pcsr.sensors.integration import integrated


def waves(h=40, w=56):
    """An analytic surface with its slopes."""
    v, u = np.mgrid[:h, :w].astype(float)
    a, b = 2 * np.pi / 30, 2 * np.pi / 25
    surface = 3 * np.cos(a * u) * np.sin(b * v) + 0.05 * u
    slopes = np.stack([-3 * a * np.sin(a * u) * np.sin(b * v) + 0.05, 3 * b * np.cos(a * u) * np.cos(b * v)], axis=-1)
    return surface, slopes


def test_integration_finds_an_analytic_surface():
    surface, slopes = waves()
    found = integrated(slopes)
    assert abs(found.mean()) < 1e-12
    assert np.abs(found - (surface - surface.mean())).max() < 0.02 * np.ptp(surface)


def test_planes_and_parabolas_are_found_exactly():
    # The step of a parabola between two pixels is exactly the mean of its slopes.
    v, u = np.mgrid[:7, :11].astype(float)
    surface = 0.3 * u - 0.2 * v + 0.05 * u**2 - 0.01 * v**2
    found = integrated(np.stack([0.3 + 0.1 * u, -0.2 - 0.02 * v], axis=-1))
    np.testing.assert_allclose(found, surface - surface.mean(), atol=1e-12)


def test_integration_is_least_squares():
    rng = np.random.default_rng(0)
    slopes = rng.normal(size=(4, 5, 2))
    rows, steps = [], []
    for v in range(4):
        for u in range(5):
            for dv, du, axis in ((0, 1, 0), (1, 0, 1)):
                if v + dv < 4 and u + du < 5:
                    row = np.zeros((4, 5))
                    row[v + dv, u + du], row[v, u] = 1, -1
                    rows.append(row.ravel())
                    steps.append((slopes[v, u, axis] + slopes[v + dv, u + du, axis]) / 2)
    slow = np.linalg.lstsq(np.array(rows), np.array(steps), rcond=None)[0].reshape(4, 5)  # of least norm: mean 0
    np.testing.assert_allclose(integrated(slopes), slow, atol=1e-12)


def test_a_single_pixel_has_no_height():
    assert integrated(np.ones((1, 1, 2))).tolist() == [[0]]
