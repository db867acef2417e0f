"""Noise has no order, no preferred values, and the size that was asked for."""

import numpy as np
import pytest
from esh.engine.surface.noise import noise_at


def grid(count, width, z=0.0):
    along = (np.arange(count) + 0.5) * width / count
    x, y = np.meshgrid(along, along)
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)])


@pytest.mark.parametrize("detail", [1, 4])
def test_all_values_are_about_equally_frequent_on_flat_ground(detail):
    values = noise_at(grid(500, 300.0), 3.0, detail, 1)
    frequency = np.histogram(values, 5, (0.0, 1.0))[0] / len(values)
    np.testing.assert_allclose(frequency, 0.2, atol=0.05)
    assert values.min() >= 0.0 and values.max() <= 1.0 and values.mean() == pytest.approx(0.5, abs=0.01)


def test_patches_have_the_size_that_was_asked_for():
    """Values change little within a tenth of the scale, and know nothing of each other at three times of it."""
    here = np.random.default_rng(0).uniform(0.0, 2000.0, (20000, 3))
    values = noise_at(here, 8.0, 1, 2)
    for way, expected in ((0.8, 0.95), (24.0, 0.0)):
        there = noise_at(here + [way, 0.0, 0.0], 8.0, 1, 2)
        assert np.corrcoef(values, there)[0, 1] == pytest.approx(expected, abs=0.05)
    assert noise_at(here[:1] * 0.5, 4.0, 1, 2) == pytest.approx(values[:1])


def test_seeds_make_different_noise_and_places_keep_theirs():
    points = grid(100, 50.0)
    first = noise_at(points, 5.0, 3, 7)
    assert np.abs(np.corrcoef(first, noise_at(points, 5.0, 3, 8))[0, 1]) < 0.2
    np.testing.assert_array_equal(noise_at(points[::7], 5.0, 3, 7), first[::7])
    # Also far from the origin, where float32 has steps of decimeters.
    far = noise_at(points + 1e6, 5.0, 1, 7).reshape(100, 100)
    assert np.abs(np.diff(far)).max() < 0.35 and far.std() > 0.1


def test_more_detail_is_rougher():
    steps = [np.abs(np.diff(noise_at(grid(200, 20.0), 10.0, detail, 3))).mean() for detail in (1, 3, 6)]
    assert steps[0] < steps[1] < steps[2]
