"""Facets are cut finer where densities change fast, and what that takes is bounded."""

from __future__ import annotations

import esh
import numpy as np
from esh.engine.model import cut_by_detail as cutting
from esh.engine.solver.solver import Solver


def sheet(side: float, cuts: int) -> esh.SurfaceMesh:
    """A square of so many squares along each side, each of two triangles."""
    x, y = np.meshgrid(np.linspace(0.0, side, cuts + 1), np.linspace(0.0, side, cuts + 1))
    corner = np.arange((cuts + 1) ** 2).reshape(cuts + 1, -1)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]))
    position = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return esh.SurfaceMesh(position, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))


def freckled(points: esh.PointsOnSurface) -> np.ndarray:
    return 0.1 + (np.sin(40.0 * points.position[:, 0]) * np.sin(37.0 * points.position[:, 1]) > 0.5)


def solver_of(count: int, cuts: int = 12) -> Solver:
    classes = [esh.BodyClass("a", [esh.Size("s", 1e-6, count)], freckled)]
    return Solver(esh.Problem(esh.Surface([sheet(1.0, cuts)]), classes), device="cpu")


def test_blocks_of_points_make_no_difference(monkeypatch):
    with solver_of(2000) as solver:
        whole = solver.descent.share, solver.descent.facets.cuts
    monkeypatch.setattr(cutting, "POINTS_AT_ONCE", 500)
    with solver_of(2000) as solver:
        np.testing.assert_array_equal(solver.descent.share, whole[0])
        np.testing.assert_array_equal(solver.descent.facets.cuts, whole[1])


def test_points_that_are_looked_at_do_not_grow_with_a_surface_of_detail(monkeypatch):
    """A surface of millions of tiles was looked at at 300,000,000 points at once, which no memory holds."""
    looked: list[int] = []

    def counted(points: esh.PointsOnSurface) -> np.ndarray:
        looked.append(len(points.position))
        return freckled(points)

    monkeypatch.setattr(cutting, "MOST_POINTS", 100_000)
    monkeypatch.setattr(cutting, "POINTS_AT_ONCE", 20_000)
    classes = [esh.BodyClass("a", [esh.Size("s", 1e-6, 2000)], counted)]
    problem = esh.Problem(esh.Surface([sheet(1.0, 12)]), classes)
    looked.clear()
    with Solver(problem, device="cpu") as solver:
        tiles = solver.descent.facets.tile_count
        solver.run(40)
        placement = solver.placement()
    # Whether it is 0 anywhere was looked at before, at a number of points that is always the same.
    assert sorted(looked)[-2] < 40_000 and sum(looked) < 8 * tiles, "64 on each before"
    # A sixth of the sheet, on which it is eleven times as dense.
    x, y = placement.position[:, 0], placement.position[:, 1]
    assert 0.6 < np.mean(np.sin(40.0 * x) * np.sin(37.0 * y) > 0.5) < 0.85
