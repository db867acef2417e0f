"""Levels of size: how bodies of all sizes find each other."""

import numpy as np
import pytest
from esh.engine.space.size_levels import coarse_cells, levels_of


@pytest.mark.parametrize(("count", "least"), [(300, 1), (100_000, 2)])
def test_a_few_bodies_of_very_different_sizes_do_not_look_through_more_cells_than_there_are_bodies(count, least):
    """A body that is 30 times as large as another one saw 30,000 cells: 300 bodies took 36 s instead of 2."""
    reach = np.random.default_rng(1).uniform(0.03, 1.0, count)
    level, farthest = levels_of(reach)
    np.testing.assert_array_equal(np.unique(level), np.arange(len(farthest)))
    cells = 0.0
    for m, most in enumerate(farthest):
        assert most == reach[level == m].max()
        cells += (((reach[level < m] + most) / most + 1.0) ** 3).sum()
    assert cells < 100.0 * count
    assert len(farthest) >= least, "many small ones have cells of their own"


def test_many_small_bodies_do_not_lie_in_the_cells_of_a_few_large_ones():
    """20 trees among 30,000 tufts of grass on a hill took 150 s of processors, and take 13."""
    reach = np.concatenate([np.full(20, 4.0), np.full(30_000, 0.056)])
    level, farthest = levels_of(reach, coarse=True)
    assert list(farthest) == [4.0, 0.056] and (level[:20] == 0).all() and (level[20:] == 1).all()
    assert list(coarse_cells(farthest)) == [4.0, 4.0]
