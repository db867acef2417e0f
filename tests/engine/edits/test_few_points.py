"""A few points over a density."""

import esh
import numpy as np
import pytest
from esh.engine.device.launcher import launcher_of_process
from esh.engine.edits.few_points import few_points, with_strays_back
from esh.engine.edits.spread import FEW, MANY, spread_points
from esh.engine.problem.domain import Domain
from esh.engine.space.density import sample_density
from scipy.spatial import cKDTree

Y, X = (np.mgrid[:64, :64] + 0.5) / 64
FROM_SPOT = np.hypot(X - 0.4, Y - 0.45)
DENSITIES = {
    "rim": np.abs(FROM_SPOT - 0.126) < 0.012,
    "disc": FROM_SPOT < 0.126,
    "line": (np.abs(Y - 0.5 - 0.3 * np.sin(6.0 * (X - 0.2))) < 0.012) & (X > 0.12) & (X < 0.85),
    "two spots": (np.hypot(X - 0.2, Y - 0.2) < 0.03) | (np.hypot(X - 0.8, Y - 0.7) < 0.05),
    "one cell": (np.arange(64) == 30) & (np.arange(64) == 50)[:, None],
}
SIZE = (100.0, 50.0)


def of_cells(density, point):
    """Values where points are, as the solver reads images: of two cells that share an edge the lower one has it."""
    return sample_density(density[::-1], point, SIZE)


@pytest.mark.parametrize("count", [1, 2, 4, 9, 30, 149])
@pytest.mark.parametrize("name", DENSITIES)
def test_they_are_where_a_density_is(name, count):
    """Of those that a descent spreads over a rim or a line half end in a corner of the domain."""
    density = DENSITIES[name]
    for seed in range(3):
        point = few_points(density, count, SIZE, seed)
        assert point.shape == (count, 2) and of_cells(density, point).all()
        assert len(np.unique(point, axis=0)) == count


def test_they_are_even_and_follow_a_density():
    for count in (12, 60, 149):
        nearest = []
        for seed in range(4):
            point = few_points(np.ones((64, 64)), count, (100.0, 100.0), seed)
            nearest.append(cKDTree(point).query(point, 2)[0][:, 1] / np.sqrt(1e4 / count))
        # Of a lattice 1.07, of random points 0.5.
        assert np.mean(nearest) > 0.8 and np.min(nearest) > 0.5
        left = few_points(np.where(X < 0.5, 3.0, 1.0), count, SIZE, 0)[:, 0] < 50.0
        assert abs(left.sum() - 0.75 * count) <= 1.0 + 0.03 * count


def test_they_are_the_same_for_a_seed_and_others_for_another_and_anywhere_where_nothing_is_asked_for():
    one, again, other = (few_points(DENSITIES["disc"], 9, SIZE, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert not np.allclose(one, other)
    anywhere = few_points(np.zeros((4, 4)), 40, SIZE, 0)
    assert np.ptp(anywhere, axis=0).min() > 30.0


def test_strays_come_back_to_where_most_room_is():
    density = DENSITIES["rim"].astype(float)
    even = few_points(density, 12, SIZE, 0)
    away = even.copy()
    away[[2, 7]] = [0.0, 0.0], [99.0, 49.0]
    back = with_strays_back(density, away, SIZE)
    np.testing.assert_array_equal(np.delete(back, [2, 7], axis=0), np.delete(even, [2, 7], axis=0))
    # Into the gaps that they have left, in any order.
    way = np.linalg.norm(back[[2, 7]][:, None] - even[[2, 7]], axis=2)
    assert way.min(axis=0).max() < 3.0
    assert with_strays_back(density, even, SIZE) is even


@pytest.mark.parametrize("count", [FEW - 1, FEW, 40, 120, MANY])
def test_no_point_is_spread_to_where_nothing_is_asked_for(count):
    density = [one.astype(np.float32) for one in DENSITIES.values()]
    for seed in range(2):
        points = spread_points(launcher_of_process("cpu"), Domain(SIZE), density, [count, 0, count, 5, 0], seed)()
        assert [len(one) for one in points] == [count, 0, count, 5, 0]
        for one, own in zip(points, density, strict=True):
            wide = np.pad(own, 2).astype(bool)
            near = np.logical_or.reduce([wide[a : a + 64, b : b + 64] for a in range(5) for b in range(5)])
            assert not len(one) or of_cells(near, one.numpy()).all()


@pytest.mark.parametrize("boundary", ["open", "natural", "mirror"])
def test_edits_keep_bodies_inside_where_they_are_to_lie_inside(boundary):
    """Points that are spread for them have no outlines, and an inner problem was refused for that."""
    falls = np.ones((32, 32))
    falls[:, :16] = 0.2

    def problem(density, count):
        sizes = [esh.Size("s", 0.3, count)]
        domain = esh.Domain((20.0, 20.0), boundary, inset=True)
        return esh.Problem(domain, [esh.BodyClass("a", sizes, density)], avoid_overlap=True)

    with esh.Solver(problem(1.0, 100), device="cpu") as solver:
        solver.run(30)
        for density, count in ((falls, 100), (falls, 120), (falls, 90)):
            solver.edit(problem(density, count))
            position = solver.placement().position
            assert len(position) == count
            assert (position > 0.3).all() and (position < 19.7).all()
