"""What leads bodies while their outlines are parted."""

import math

import numpy as np
import pytest
import warp as wp
from esh.engine.contact.guidance import BLUR_OVER_SPACING, Guidance, needs_guidance
from esh.engine.contact.plane_separation import PlaneSeparation
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.problem.line import Line
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.quality.coverage import coverage_error
from esh.engine.solve import solve
from esh.engine.solver.solver import Solver

PLANK = Footprint.rectangle(2.0, 0.3)


def problem_of(sizes, domain, density=1.0, **more):
    return Problem(domain, [BodyClass("a", sizes, density)], avoid_overlap=True, **{"seed": 3, **more})


def ways(problem, position=None):
    """Where bodies are, in the model's unit, how far they are sent, and the model."""
    with Solver(problem, device="cpu") as solver:
        if position is not None:
            solver.start_at(position)
        contact, state, model = solver.descent.contact, solver.state, solver.model
        bodies, images = contact._bodies, contact._images
        parting = PlaneSeparation(model, solver.launcher, bodies, images, state.pose, state.turn, state.bend)
        home = wp.clone(parting._crowd_pose)
        guidance = Guidance(model, solver.launcher, bodies, state.bend)
        guidance.lead(parting._crowd_pose, parting._outlines, home)
        first = home.numpy().copy()
        guidance.lead(parting._crowd_pose, parting._outlines, home)
        np.testing.assert_array_equal(first, home.numpy())
        guidance.close()
        place = parting._crowd_pose.numpy()
        assert (first[:, :2] >= 0.0).all() and (first[:, :2] <= np.array(model.size, np.float32)).all()
        way = (first - place)[:, :2].astype(np.float64)
        if problem.domain.periodic:
            way -= np.array(model.size) * np.round(way / model.size)
        return place[:, :2].astype(np.float64), way, model


def sent_by_waves(position, size, blur, waves=24):
    """The way that evens out what is too many of charges on a torus, both blurred: a sum over waves, in float64."""
    k = np.arange(-waves, waves + 1)
    number = np.stack(np.meshgrid(k, k), axis=-1).reshape(-1, 2)
    number = 2.0 * np.pi * number[number.any(axis=1)] / size
    square = (number**2).sum(axis=1)
    phase = position @ number.T
    wave = np.exp(-1j * phase).sum(axis=0) * np.exp(-0.5 * square * blur**2) / square
    force = np.real((-1j * np.exp(1j * phase) * wave) @ number)
    return force / len(position)


def test_bodies_are_sent_where_waves_would_send_them():
    domain = Domain((18.0, 15.0), "periodic")
    position = np.random.default_rng(5).random((220, 2)) * domain.size
    at, way, model = ways(problem_of([Size("s", count=220, footprint=PLANK)], domain), position)
    expected = sent_by_waves(at, model.size, BLUR_OVER_SPACING)
    assert np.hypot(*expected.T).max() < 0.95
    assert np.abs(way - expected).max() < 0.02 * np.abs(expected).max()


@pytest.mark.parametrize("boundary", ["open", "mirror", "periodic"])
def test_they_follow_the_density_that_is_asked_for(boundary):
    """All on the left, where a third of them belongs: to the right with them."""
    ramp = np.array([[1.0, 1.0, 1.0, 2.0, 2.0, 2.0]])
    domain = Domain((18.0, 15.0), boundary)
    position = np.random.default_rng(5).random((200, 2)) * [9.0, 15.0]
    at, way, model = ways(problem_of([Size("s", count=200, footprint=PLANK)], domain, ramp), position)
    near_middle = at[:, 0] > 0.25 * model.size[0]
    assert way[near_middle, 0].mean() > 0.2
    # No farther than is good for them.
    assert np.hypot(*way.T).max() <= 1.0 + 1e-4


def test_lines_are_led_by_the_sum_of_their_charges():
    line = Line(2.0, width=0.3, straightness=0.1)
    sizes = [Size("line", 0.6, 60, line=line), Size("s", count=100, footprint=PLANK)]
    at, way, _model = ways(problem_of(sizes, Domain((14.0, 14.0))))
    assert len(at) == 160 and np.isfinite(way).all()
    assert 1e-3 < np.abs(way).mean() < 1.0


def test_only_crowds_that_are_not_round_need_it():
    box, disc = Footprint.rectangle(0.8, 0.7), Footprint.disc(0.4)
    planks = ((PLANK, 10.0, True), (PLANK, 20.0, False), (PLANK, 6.0, False))
    for footprint, side, needed in (*planks, (box, 9.0, True), (box, 11.0, False), (disc, 8.0, False)):
        problem = problem_of([Size("s", count=100, footprint=footprint)], Domain((side, side)))
        with Solver(problem, device="cpu") as solver:
            assert needs_guidance(solver.model) is needed
    # What is a disc, or a line without an outline, is not asked.
    with Solver(problem_of([Size("s", 0.6, 100)], Domain((10.0, 10.0))), device="cpu") as solver:
        assert not needs_guidance(solver.model)


def test_classes_keep_their_own_densities():
    """Planks of two classes on opposite ramps, as crowded as they can well be parted."""
    ramp = np.linspace(0.2, 1.8, 64)[None, :]
    side = math.sqrt(240 * PLANK.area / 0.65)
    classes = [
        BodyClass(name, [Size("s", count=120, footprint=Footprints(PLANK))], density)
        for name, density in (("a", ramp), ("b", ramp[:, ::-1]))
    ]
    placement = solve(Problem(Domain((side, side)), classes, seed=2, avoid_overlap=True), device="cpu")
    assert placement.report.overlaps == 0 and placement.report.converged
    for index, c in enumerate(placement.problem.classes):
        own = placement.position[placement.class_index == index]
        assert coverage_error(own, np.ones(len(own)), c.density_image, placement.problem.domain) < 0.06
