"""Solver: step by step like solve(), states that are kept, saved and gone on from, bodies that stay or do not count."""

import gc
import time
import weakref
from contextlib import closing
from dataclasses import replace
from unittest.mock import ANY

import numpy as np
import pytest
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.errors import ProblemError
from esh.engine.model.body_flags import BodyFlags
from esh.engine.model.model import Model
from esh.engine.model.state import State
from esh.engine.motion.direction import Direction
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.fixed_bodies import FixedBodies
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.line import Line
from esh.engine.problem.obstacles import Obstacle
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.quality.measurement import measure
from esh.engine.solve import solve
from esh.engine.solver import solver as solver_module
from esh.engine.solver.placing import Placing
from esh.engine.solver.placing_in_plane import PlacingInPlane
from esh.engine.solver.placing_on_surface import PlacingOnSurface
from esh.engine.solver.solver import Solver


def problem_of(kind, boundary="open"):
    ramp = np.linspace(0.2, 1.0, 32)[None, :]
    line = Line(2.0, "density", straightness=0.2 if kind == "bends" else None) if kind in ("lines", "bends") else None
    classes = [
        BodyClass("a", [Size("s", 0.4, 300, line=line), Size("l", 1.5, 60)], ramp),
        BodyClass("b", [Size("any", (0.3, 1.0), 200)]),
    ]
    return Problem(Domain((30.0, 20.0), boundary), classes, Balance(0.5), avoid_overlap=kind == "contact", seed=3)


@pytest.mark.parametrize("kind", ["dots", "lines", "bends", "contact"])
def test_stepping_by_hand_is_what_solve_does(kind):
    problem = problem_of(kind)
    whole = solve(problem, device="cpu", max_steps=12)
    with Solver(problem, device="cpu") as solver:
        for _ in range(12):
            residual = solver.step()
        assert 0.0 < residual < 1.0 and solver.state.steps.tolist() == [12]
        solver.separate()
        placement = solver.placement()
    for name in ("position", "angle", "length", "width", "class_index", "size_index"):
        np.testing.assert_array_equal(getattr(placement, name), getattr(whole, name), err_msg=name)


@pytest.mark.parametrize("kind", ["dots", "lines", "bends", "contact"])
def test_a_state_that_was_saved_goes_on_as_if_nothing_had_been(kind, tmp_path):
    problem = problem_of(kind, "periodic")
    with Solver(problem, device="cpu") as solver:
        solver.step(5)
        solver.state.save(tmp_path / "state.npz")
        kept = solver.state.copy()
        solver.step(4)
        expected = solver.placement().position
    for state in (State.load(tmp_path / "state.npz"), kept):
        with Solver(problem, device="cpu", state=state) as solver:
            assert solver.state.steps.tolist() == [5]
            solver.step(4)
            np.testing.assert_array_equal(solver.placement().position, expected)
    assert kept.steps.tolist() == [5]


def test_a_state_brings_identities_also_where_bodies_are_fixed_whom_nobody_named(tmp_path):
    def problem(count, fixed):
        return Problem(
            Domain((20.0, 20.0)),
            [BodyClass("a", [Size("s", 0.2, count)])],
            fixed=[FixedBodies(fixed)],
            include_fixed=True,
        )

    places = np.array([[3.0, 3.0], [12.0, 9.0]])
    with Solver(problem(100, places[:1]), device="cpu") as solver:
        solver.run(5)
        start = solver.state.copy()
        solver.edit(problem(130, places))
        placement = solver.placement()
        solver.state.save(tmp_path / "state.npz")
    with Solver(problem(130, places), device="cpu", state=State.load(tmp_path / "state.npz")) as other:
        np.testing.assert_array_equal(other.placement().id, placement.id)
    with Solver(problem(100, places[:1]), device="cpu") as solver:
        given = solver.placement().id
        solver.start_at(solver.placement().position, identity=given[::-1] + 500)
        solver.start_from(start)
        np.testing.assert_array_equal(solver.placement().id, given)


def test_a_state_with_too_few_identities_is_refused():
    with Solver(problem_of("dots"), device="cpu") as solver:
        state = solver.state.copy()
        assert state.identity is None
        state.identity = np.arange(5)
        with pytest.raises(ProblemError, match=r"`identity` must have one number for every body"):
            solver.start_from(state)


def test_a_state_of_another_problem_is_refused():
    with Solver(problem_of("dots"), device="cpu") as solver:
        state = solver.state.copy()
    other = Problem(Domain((30.0, 20.0)), [BodyClass("a", [Size("s", 0.4, 7)])])
    with pytest.raises(ProblemError, match=r"`pose` must have shape.*: this is the state of another problem"):
        Solver(other, device="cpu", state=state)


@pytest.mark.parametrize("kind", ["dots", "lines", "contact"])
def test_pinned_bodies_stay_and_others_make_room(kind):
    problem = problem_of(kind)
    flags = np.zeros(problem.body_count, np.int32)
    pinned = np.random.default_rng(0).random(len(flags)) < 0.2
    flags[pinned] = BodyFlags.PINNED
    with Solver(problem, device="cpu", flags=flags) as solver:
        start = solver.state.pose.numpy().copy()
        solver.step(30)
        solver.separate()
        end = solver.state.pose.numpy()
        np.testing.assert_array_equal(end[pinned], start[pinned])
        assert np.isfinite(end).all()
        assert (np.abs(end[~pinned] - start[~pinned]).max(axis=1) > 0.0).mean() > 0.95
        held = solver.placement()
    if kind == "dots":
        # The others do not come nearer to them than to each other by much: they act.
        from scipy.spatial import cKDTree

        nearest = cKDTree(held.position[~pinned]).query(held.position[pinned])[0]
        assert np.quantile(nearest, 0.1) > 0.2


def test_ghosts_act_and_are_not_part_of_the_placement():
    problem = problem_of("bends")
    flags = np.zeros(problem.body_count, np.int32)
    flags[::7] = BodyFlags.GHOST
    with Solver(problem, device="cpu", flags=flags) as solver:
        solver.step(8)
        placement = solver.placement()
        with pytest.raises(ProblemError, match="without its ghosts has no report"):
            solver.measured(placement)
    whole = solve(problem, device="cpu", max_steps=8)
    shown = flags == 0
    assert len(placement.position) == shown.sum()
    np.testing.assert_array_equal(placement.position, whole.position[shown])
    assert placement.bends is not None and len(placement.bends) == shown.sum()


def test_a_model_is_the_problem_as_flat_tables():
    problem = problem_of("lines")
    model = Model(problem)
    body = model.body
    assert model.body_count == problem.body_count == 560
    assert np.bincount(body.class_index).tolist() == [360, 200]
    assert (body.kind[:300] == 0).all() and (body.kind[300:] == -1).all()
    assert (body.longest[:300] == 2.0).all() and not body.longest[300:].any()
    assert model.charge_count == 300 * model.kinds[0].line.charges + 260
    np.testing.assert_allclose(body.area, problem.body_areas())
    assert model.group_charge.sum() == pytest.approx(model.charge_count)
    # Charges have a mean number density of 1.
    assert model.size[0] * model.size[1] == pytest.approx(model.charge_count)
    assert body.identity.tolist() == list(range(560)) and not body.flags.any()


def test_a_closed_solver_is_let_go_at_once():
    with Solver(problem_of("contact"), device="cpu") as solver:
        solver.step()
        seen = weakref.ref(solver.descent)
    gc.disable()
    try:
        del solver
        assert seen() is None, "a circle of references holds the solver's arrays until the collector comes by"
    finally:
        gc.enable()


USES = {
    "step": lambda solver, _: solver.step(),
    "run": lambda solver, _: solver.run(3),
    "edit": lambda solver, _: solver.edit(solver.model.problem),
    "separate": lambda solver, _: solver.separate(),
    "choose_start": lambda solver, _: solver.choose_start(3),
    "state": lambda solver, _: solver.state,
    "placement": lambda solver, _: solver.placement(),
    "last_placement": lambda solver, _: solver.last_placement(),
    "measured": lambda solver, kept: solver.measured(kept["placement"]),
    "bookmark": lambda solver, _: solver.bookmark(),
    "start_from": lambda solver, kept: solver.start_from(kept["state"]),
    "start_at": lambda solver, kept: solver.start_at(kept["position"]),
    "go_back": lambda solver, kept: solver.go_back(kept["bookmark"]),
    "drop": lambda solver, kept: solver.drop(kept["bookmark"]),
}


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize("shared", [False, True], ids=["own threads", "other threads"])
@pytest.mark.parametrize("boundary", ["open", "natural"])
def test_a_solver_that_was_closed_says_so(use, shared, boundary):
    with closing(Launcher(resolve_device("cpu"))) as launcher:
        with Solver(problem_of("contact", boundary), **({"launcher": launcher} if shared else {})) as solver:
            placement = solver.placement()
            kept = {"state": solver.state.copy(), "position": placement.position, "placement": placement}
            kept["bookmark"] = solver.bookmark()
            solver.step()
        solver.close()
        with pytest.raises(ProblemError, match="was closed; make another one"):
            USES[use](solver, kept)


@pytest.mark.parametrize("use", ["step", "run", "edit", "separate", "state", "placement"])
def test_a_solver_at_its_end_says_so(use):
    with Solver(problem_of("contact"), device="cpu") as solver:
        solver.last_placement()
        with pytest.raises(ProblemError, match="make another one"):
            USES[use](solver, {})


@pytest.mark.parametrize("watched", [False, True])
@pytest.mark.parametrize(
    ("last", "expected"), [((0.002, 0.003, 0.009), True), ((0.002, 0.009, 0.003), True), ((0.002, 0.009, 0.009), False)]
)
def test_one_of_the_last_steps_alone_does_not_tell_whether_bodies_have_settled(last, expected, watched, monkeypatch):
    """Of so many steps one stands out now and then, as some body goes round an edge or takes another's place in it."""
    answers = iter([0.1] * 60)
    with Solver(problem_of("dots"), device="cpu") as solver:

        def residual(_):
            left = 20 - int(solver.descent.state.steps.max())
            return last[-1 - left] if left < 3 else next(answers)

        monkeypatch.setattr(Direction, "residual", residual)
        assert solver.run(20, (lambda _: None) if watched else None) == (20, expected)


@pytest.mark.parametrize("kind", ["dots", "lines", "contact"])
@pytest.mark.parametrize("steps", [4, 150])
def test_a_solver_reports_what_solve_does(kind, steps):
    problem = problem_of(kind)
    whole = solve(problem, device="cpu", max_steps=steps).report
    with Solver(problem, device="cpu") as solver:
        solver.choose_start(steps)
        solver.run(steps)
        solver.separate()
        report = solver.placement(report=True).report
        assert solver.placement().report is None
        assert solver.last_placement().report == replace(report, seconds=ANY)
    assert report == replace(whole, seconds=report.seconds) and 0.0 < report.seconds < 600.0
    assert whole.steps > 1 and (steps > 4 or not whole.converged)


@pytest.mark.parametrize("flat", [True, False])
def test_a_report_after_an_edit_tells_of_the_edit(flat, monkeypatch):
    sheet = SurfaceMesh([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [9.0, 6.0, 0.0], [0.0, 6.0, 0.0]], [[0, 1, 2], [0, 2, 3]])
    domain = Domain((9.0, 6.0)) if flat else Surface([sheet])

    def asked(count):
        return Problem(domain, [BodyClass("a", [Size("s", 0.1, count)])], avoid_overlap=True, seed=2)

    made = []
    monkeypatch.setattr(solver_module, "measure", lambda *given: made.append(given) or measure(*given))
    with Solver(asked(100), device="cpu") as solver:
        solver.run(60)
        start = solver.bookmark()
        solver.edit(asked(120), steps=0)
        assert not made, "a report that nobody asked for takes time"
        assert not solver.placement(report=True).report.converged, "bodies have had no steps to settle in"
        solver.edit(asked(120), steps=7)
        placement = solver.placement()
        report = solver.measured(placement).report
        assert (report.steps, report.overlaps) == (7, 0)
        assert report.classes[0].sizes[0].placed == 120 and placement.report is None
        assert report.coverage_error == measure(placement, solver.launcher).coverage_error
        solver.run(200)
        assert solver.placement(report=True).report.converged
        solver.go_back(start)
        assert 7 < solver.placement(report=True).report.steps <= 60
        solver.step(3)
        assert solver.placement(report=True).report.steps > 10


def test_waiting_between_steps_is_no_time_of_a_solver():
    with Solver(problem_of("dots"), device="cpu") as solver:
        solver.step(2)
        before = solver.placement(report=True).report.seconds
        time.sleep(0.5)
        assert solver.placement(report=True).report.seconds < before + 0.45


def test_one_step_does_not_tell_that_bodies_have_settled():
    """Nothing pushes a single body, but only a second step shows that what moved is at rest."""
    alone = Problem(Domain((4.0, 3.0), "periodic"), [BodyClass("a", [Size("s", 0.5, 1)])])
    assert not solve(alone, device="cpu", max_steps=1).report.converged
    assert solve(alone, device="cpu").report.converged


def test_bodies_that_begin_where_their_density_is_0_by_now_come_to_where_it_is_not():
    def asked(mask):
        classes = [
            BodyClass("pine", [Size("s", 0.28, 200)], mask),
            BodyClass("bush", [Size("s", 0.125, 334)]),
        ]
        return Problem(Domain((20.0, 20.0)), classes, avoid_overlap=True)

    before = solve(asked(1.0), device="cpu")
    mask = np.zeros((64, 64), np.float32)
    mask[22:42, 7:57] = 1.0
    with Solver(asked(mask), device="cpu") as solver:
        solver.start_at(before.position)
        solver.run(100)
        assert solver.separate(again=True)
        after = solver.placement()
        report = measure(after, solver.launcher)
    assert report.overlaps == 0 and report.coverage_error < 0.02
    pines = after.position[after.class_index == 0]
    assert (np.abs(pines[:, 1] - 10.0) < 3.3).all() and (np.abs(pines[:, 0] - 10.0) < 8.0).all()


@pytest.mark.parametrize("placing", [PlacingInPlane, PlacingOnSurface])
def test_the_plane_and_surfaces_have_one_interface(placing):
    """What only one of them had, the solver would have to ask for."""
    common = {*dir(Placing), *Placing.__annotations__}
    assert {name for name in dir(placing) if name[0] != "_"} == {name for name in common if name[0] != "_"}
    assert not placing.__abstractmethods__


def test_a_file_that_holds_no_state_is_named(tmp_path):
    """NumPy spoke of pickled data, of a zip file, or of a key."""
    text, other, table = (tmp_path / name for name in ("a.npz", "b.npz", "c.npy"))
    text.write_text("no state")
    np.savez(other, pose=np.zeros((3, 4)))
    np.save(table, np.zeros(3))
    for path in (text, other, table):
        with pytest.raises(ProblemError, match=f"{path.name} holds no State"):
            State.load(path)


CALL_IT = "bodies were not parted after the last step: call `separate()` of the Solver"


@pytest.mark.parametrize("domain", ["plane", "surface"])
def test_a_report_says_that_bodies_were_not_parted_yet_and_what_does_it(domain):
    """Fewer bodies would be no help where nobody has parted them."""
    flat = SurfaceMesh([[0.0, 0.0, 0.0], [20.0, 0.0, 0.0], [20.0, 20.0, 0.0], [0.0, 20.0, 0.0]], [[0, 1, 2], [0, 2, 3]])
    on = Surface([flat]) if domain == "surface" else Domain((20.0, 20.0), inset=True)
    hole = Obstacle(polygon=[(5.0, 5.0), (10.0, 5.0), (10.0, 10.0), (5.0, 10.0)])
    boxes = BodyClass("box", [Size("s", count=420, footprint=Footprint.rectangle(1.0, 0.5))])
    problem = Problem(on, [boxes], avoid_overlap=True, obstacles=[hole] if domain == "plane" else [])
    with Solver(problem, device="cpu") as solver:
        solver.run(20)
        report = solver.placement(report=True).report
        assert report.overlaps and report.notes[-1] == CALL_IT
        assert not any("lower the counts" in note or "still" in note for note in report.notes)
        assert solver.separate()
        assert not solver.placement(report=True).report.notes
        solver.step(3)
        assert solver.placement(report=True).report.notes[-1] == CALL_IT, "steps make bodies overlap again"
    stopped = solve(problem, device="cpu", progress=lambda progress: progress.step < 10).report
    assert stopped.notes[-1] == "the run was stopped before bodies were parted"


@pytest.mark.parametrize("edited", [False, True])
def test_a_placement_of_other_bodies_is_not_measured(edited):
    """It would have the steps and seconds of a run that did not make it."""
    side = Domain((20.0, 10.0))

    def problem(name="pine", count=120, domain=side):
        return Problem(domain, [BodyClass(name, [Size("any", 0.2, count)]), BodyClass("beech", [Size("any", 0.2, 30)])])

    others = [problem(count=121), problem("fir"), problem(domain=Domain((20.0, 11.0)))]
    with Solver(problem(), device="cpu") as solver:
        solver.run(2)
        mine = solver.placement()
        for other in others:
            with pytest.raises(
                ProblemError, match=r'`placement` must be .* with 120 of "pine" and 30 of "beech", in the same'
            ) as said:
                solver.measured(solve(other, device="cpu", max_steps=1))
        assert str(said.value).endswith('; got one with 120 of "pine" and 30 of "beech"')
        if edited:
            solver.edit(problem(count=90))
            with pytest.raises(ProblemError, match=r'with 90 of "pine" .*; got one with 120 of "pine"'):
                solver.measured(mine)
            mine = solver.placement()
        assert solver.measured(mine).report is not None


def test_reading_the_result_back_counts_as_time_of_a_run(monkeypatch):
    with Solver(problem_of("dots"), device="cpu") as solver:
        solver.run(2)
        read, before = solver.descent.placement, solver.placement(report=True).report.seconds
        monkeypatch.setattr(solver.descent, "placement", lambda: time.sleep(0.5) or read())
        assert solver.placement(report=True).report.seconds > before + 0.5
