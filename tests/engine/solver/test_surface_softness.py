"""Whose charges are soft on a surface, and what the dial of regularity does there."""

import numpy as np
import pytest
import trimesh
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.line import Line
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.solve import solve
from esh.engine.solver.model import Model
from esh.engine.solver.surface_softness import REACH_AMONG_CLASSES, softness_of
from scipy.spatial import cKDTree

BALL = trimesh.creation.icosphere(subdivisions=3)


def on_ball(*classes, **settings):
    return Problem(Surface(SurfaceMesh(np.array(BALL.vertices), np.array(BALL.faces))), classes, **settings)


def sized(*areas, count=100, **settings):
    return [Size(str(number), area, count, **settings) for number, area in enumerate(areas)]


@pytest.mark.parametrize(
    "sizes, density, soft",
    [
        (sized(1e-4), 1.0, True),
        (sized(1e-4, 1e-4), 0.5, True),
        (sized(1e-4, 3e-4), 1.0, False),
        (sized(1e-4, line=Line(2.0)), 1.0, False),
        (sized(1e-4), lambda points: 1.1 + points.position[:, 2], False),
    ],
)
def test_bodies_that_are_all_alike_are_soft(sizes, density, soft):
    assert (softness_of(Model(on_ball(BodyClass("a", sizes, density)))) is not None) == soft


def test_cores_of_classes_that_keep_apart_are_short():
    two = BodyClass("a", sized(1e-4)), BodyClass("b", sized(1e-4))
    alone, mixed, ignored = (
        softness_of(Model(problem))
        for problem in (on_ball(two[0]), on_ball(*two), on_ball(*two, balance=Balance(class_separation=0.0)))
    )
    assert alone == ignored
    assert mixed.blur == alone.blur
    assert mixed.reach == REACH_AMONG_CLASSES < alone.reach
    assert mixed.core > alone.core


def test_the_less_regular_the_closer_neighbors_come_and_coverage_stays():
    smallest, errors = [], []
    for regularity in (1.0, 0.6, 0.2):
        placement = solve(on_ball(BodyClass("a", sized(1e-5, count=800)), regularity=regularity), device="cpu")
        distance = cKDTree(placement.position).query(placement.position, k=2)[0][:, 1]
        # Over that of a hexagonal lattice.
        smallest.append(distance.min() / np.sqrt(2.0 / np.sqrt(3.0) * BALL.area / 800))
        errors.append(placement.report.coverage_error)
    assert min(smallest[:2]) > 0.8
    assert 0.5 < smallest[2] < 0.78
    assert max(errors) < 0.005
