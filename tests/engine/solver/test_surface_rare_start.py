"""Rare classes on surfaces are spread before the others are there."""

import numpy as np
import pytest
import trimesh
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.fixed_bodies import FixedBody
from esh.engine.problem.obstacles import Obstacle
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.solve import solve
from esh.engine.solver.solver import Solver
from esh.engine.solver.surface_rare_start import rare_start_on_surface
from scipy.spatial import cKDTree

BALL = trimesh.creation.icosphere(subdivisions=3)


def on_ball(classes, *settings, **more):
    return Problem(Surface(SurfaceMesh(np.array(BALL.vertices), np.array(BALL.faces))), classes, *settings, **more)


def test_few_bodies_among_many_are_even_before_the_first_step_that_all_take():
    classes = [BodyClass(str(count), [Size("s", 1e-6, count)]) for count in (800, 50, 6)]
    with Solver(on_ball(classes), device="cpu") as solver:
        start = solver.placement()
    for number, count in ((1, 50), (2, 6)):
        own = start.position[start.class_index == number]
        nearest = cKDTree(own).query(own, k=2)[0][:, 1].min() / np.sqrt(2.0 / np.sqrt(3.0) * BALL.area / count)
        # Along a curve: .1 to .4.
        assert nearest > 0.75


def test_they_start_where_they_may_be_and_are_placed_exactly():
    classes = [
        BodyClass("many", [Size("s", 1e-4, 600)]),
        BodyClass("few", [Size("s", 1e-3, 60), Size("l", 0.02, 9)], lambda points: (points.position[:, 2] > 0.0) + 0.0),
        BodyClass("fixed", [Size("s", 1e-3, 20)]),
        BodyClass("rare", [Size("s", 1e-3, 7)]),
    ]
    problem = on_ball(
        classes,
        fixed=[FixedBody((0.0, 0.0, -1.0), "fixed")],
        obstacles=[Obstacle(ball=(0.0, 0.0, 1.0, 0.3))],
        avoid_overlap=True,
    )
    placement = solve(problem, device="cpu")
    assert [s.placed for c in placement.report.classes for s in c.sizes] == [600, 60, 9, 21, 7]
    few = placement.position[placement.class_index == 1]
    # To within a tile.
    assert few[:, 2].min() > -0.1
    free = ~placement.fixed
    assert np.linalg.norm(placement.position[free] - (0.0, 0.0, 1.0), axis=1).min() >= 0.3
    assert placement.report.overlaps == 0


@pytest.mark.parametrize(
    "counts, balance",
    [((100, 30), Balance()), ((100, 10), Balance(1.0)), ((100, 10), Balance(rare_emphasis=0.0))],
)
def test_nothing_is_spread_before_where_no_class_is_rare(counts, balance):
    launcher = Launcher(resolve_device("cpu"))
    try:
        classes = [BodyClass(str(count), [Size("s", 1e-4, count)]) for count in counts]
        assert rare_start_on_surface(launcher, on_ball(classes, balance)) is None
    finally:
        launcher.close()
