"""The start: inside, off empty pixels, far more even than independent draws."""

import numpy as np
from esh.engine.density import sample_density
from esh.engine.initial_placement import _hilbert_curve, initial_placement
from esh.engine.interaction import group_bodies
from esh.engine.problem import BodyClass, Domain, Problem, Size
from esh.engine.quality import coverage_error


def test_hilbert_curve_visits_every_cell_once_and_never_jumps():
    column, row = _hilbert_curve(5)
    assert len({(c, r) for c, r in zip(column.tolist(), row.tolist(), strict=True)}) == 32 * 32
    assert set(np.abs(np.diff(column)) + np.abs(np.diff(row))) == {1}


def test_is_several_times_more_even_than_independent_draws():
    domain = Domain((2.0, 2.0))
    problem = Problem(domain, [BodyClass("a", [Size("s", 1e-4, 4000)])])
    position = initial_placement(problem, group_bodies(problem))
    independent = np.random.default_rng(0).random((4000, 2)) * 2.0
    ones = np.ones(4000)
    error = coverage_error(position, ones, np.ones((1, 1)), domain)
    assert error < 0.5 * coverage_error(independent, ones, np.ones((1, 1)), domain)


def test_stands_on_full_pixels_even_where_they_are_thin():
    image = np.zeros((300, 300))
    image[137, 20:280] = 1.0
    image[5, 5] = 0.001
    problem = Problem(Domain((3.0, 1.0)), [BodyClass("a", [Size("s", 1e-4, 500), Size("t", 1e-3, 7)], image)])
    position = initial_placement(problem, group_bodies(problem))
    assert len(position) == 507
    assert (sample_density(image, position, (3.0, 1.0)) > 0).all()
