"""Connected components, beside SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from esh.engine.geometry.connected import connected, connected_pixels
from scipy.ndimage import label


def test_things_that_are_joined_by_others_have_one_number():
    np.testing.assert_array_equal(connected(6, np.array([4, 1]), np.array([5, 4])), [0, 1, 2, 3, 1, 1])
    np.testing.assert_array_equal(connected(2, np.zeros(0, int), np.zeros(0, int)), [0, 1])


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 1.0])
def test_parts_of_masks_are_those_of_scipy(share):
    rng = np.random.default_rng(3)
    for shape in ((1, 1), (1, 40), (40, 1), (37, 52)):
        mask = rng.random(shape) < share
        np.testing.assert_array_equal(connected_pixels(mask), label(mask)[0] - 1)


def test_a_spiral_is_one_part():
    y, x = np.mgrid[-40:40, -40:40] + 0.5
    turn = np.hypot(x, y) / 10.0 - np.arctan2(y, x) / (2.0 * np.pi)
    mask = turn % 1.0 < 0.6
    np.testing.assert_array_equal(connected_pixels(mask) >= 0, mask)
    assert connected_pixels(mask).max() == label(mask)[0].max() - 1
