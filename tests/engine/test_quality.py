"""The measures themselves, on arrangements whose values are known."""

import numpy as np
import pytest
from esh.engine.device import Launcher, resolve_device
from esh.engine.problem import Domain
from esh.engine.quality import coverage_error, smallest_spacing

UNIFORM = np.ones((1, 1))


@pytest.fixture(scope="module")
def launcher():
    return Launcher(resolve_device("cpu"))


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_independent_points_score_as_they_should(boundary):
    """White noise through a Gaussian of one spacing leaves 1 / sqrt(4 pi) = 0.28 (periodic), a little more at open edges."""
    domain = Domain((64.0, 64.0), boundary)
    scores = [
        coverage_error(np.random.default_rng(seed).random((4096, 2)) * 64.0, np.ones(4096), UNIFORM, domain)
        for seed in range(5)
    ]
    assert np.mean(scores) == pytest.approx(0.282 if boundary == "periodic" else 0.29, rel=0.12)


def test_blur_equals_scipys():
    ndimage = pytest.importorskip("scipy.ndimage")
    from esh.engine.quality import _blur

    grid = np.random.default_rng(0).random((60, 90))
    for periodic, mode in ((False, "constant"), (True, "wrap")):
        expected = ndimage.gaussian_filter(grid, (3.0, 4.5), mode=mode, truncate=8.0)
        np.testing.assert_allclose(_blur(grid, 4.5, 3.0, periodic), expected, atol=1e-6)


def test_a_lattice_covers_better_than_random_points():
    domain = Domain((8.0, 8.0), "periodic")
    lattice = np.stack(np.meshgrid(np.arange(64) + 0.5, np.arange(64) + 0.5), -1).reshape(-1, 2) / 8.0
    assert coverage_error(lattice, np.ones(4096), UNIFORM, domain) < 1e-4


def test_spacing_of_a_hexagonal_lattice_is_one(launcher):
    rows, columns = 20, 24
    x = np.arange(columns) + 0.5 * (np.arange(rows)[:, None] % 2)
    y = np.repeat(np.arange(rows)[:, None] * np.sqrt(3.0) / 2.0, columns, axis=1)
    domain = Domain((columns, rows * np.sqrt(3.0) / 2.0), "periodic")
    position = np.stack([x.ravel(), y.ravel()], axis=1)
    density = np.full(len(position), len(position) / domain.area)
    assert smallest_spacing(position, density, domain, launcher) == pytest.approx(1.0, abs=1e-4)
    assert smallest_spacing(position[:1], density[:1], domain, launcher) is None
