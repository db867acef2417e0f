"""The start: inside, off empty pixels, far more even than independent draws."""

import numpy as np
import pytest
from esh.engine.descent.initial_placement import initial_placement
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.quality.coverage import coverage_error
from esh.engine.space.density import sample_density


def test_bodies_in_order_walk_the_plane_without_jumps():
    """A uniform density: the next body is a neighbor, however long the way; so no cell is left out or visited twice."""
    problem = Problem(Domain((1.0, 1.0)), [BodyClass("a", [Size("s", 1e-6, 4096)])])
    position = initial_placement(problem)
    assert np.hypot(*np.diff(position, axis=0).T).max() < 4.0 / 64
    taken = (position * 16).astype(int)
    assert np.bincount(taken[:, 1] * 16 + taken[:, 0], minlength=256).tolist() == pytest.approx([16] * 256, abs=1)


def test_follows_its_density():
    image = np.zeros((2, 2))
    image[0, 0], image[0, 1], image[1, 1] = 1.0, 2.0, 5.0
    problem = Problem(Domain((2.0, 2.0)), [BodyClass("a", [Size("s", 1e-6, 800)], image)])
    position = initial_placement(problem)
    quarter = (position[:, 1] >= 1.0) * 2 + (position[:, 0] >= 1.0)
    assert np.bincount(quarter, minlength=4).tolist() == pytest.approx([0, 500, 100, 200], abs=1)


def test_a_seed_gives_one_placement():
    def place(seed):
        problem = Problem(Domain((1.0, 1.0)), [BodyClass("a", [Size("s", 1e-6, 500)])], seed=seed)
        return initial_placement(problem)

    np.testing.assert_array_equal(place(1), place(1))
    assert (place(1) != place(2)).any(axis=1).all()


def test_is_several_times_more_even_than_independent_draws():
    domain = Domain((2.0, 2.0))
    problem = Problem(domain, [BodyClass("a", [Size("s", 1e-4, 4000)])])
    position = initial_placement(problem)
    independent = np.random.default_rng(0).random((4000, 2)) * 2.0
    ones = np.ones(4000)
    error = coverage_error(position, ones, np.ones((1, 1)), domain)
    assert error < 0.5 * coverage_error(independent, ones, np.ones((1, 1)), domain)


def test_stands_in_the_support_even_where_it_is_thin():
    image = np.zeros((300, 300))
    image[137, 20:280] = 1.0
    image[5, 5] = 0.001
    problem = Problem(Domain((3.0, 1.0)), [BodyClass("a", [Size("s", 1e-4, 500), Size("t", 1e-3, 7)], image)])
    position = initial_placement(problem)
    assert len(position) == 507
    assert (sample_density(image, position, (3.0, 1.0)) > 0).all()
