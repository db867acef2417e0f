"""Small bodies are placed around much larger ones as around obstacles, at first and after edits."""

import math

import numpy as np
import pytest
from esh import (
    Balance,
    BodyClass,
    BodyFlags,
    Domain,
    FixedBodies,
    Footprint,
    Footprints,
    Line,
    Placement,
    Problem,
    Size,
    Solver,
    solve,
)
from esh.engine.problem.ground_of_large import LARGE
from esh.engine.solver.small_among_large import least_large_area, small_among_large
from scipy import spatial

SIDE = 40.0
BOULDER, TUFT = 8.0, 0.05
BAR = Footprint.polygon([[-2.5, -0.4], [2.5, -0.4], [2.5, 0.4], [-2.5, 0.4]])
LEAF = Footprint.polygon([[-0.2, 0.0], [0.0, -0.08], [0.2, 0.0], [0.0, 0.08]])


def scene(
    boulders=30, tufts=2500, *, density=None, boundary="open", boulder=None, tuft=None, seed=1, **changed
) -> Problem:
    """Boulders among tufts, of a class each."""
    follows = {} if density is None else {"density": density}
    classes = [
        BodyClass("boulder", [boulder or Size("boulder", BOULDER, boulders)]),
        BodyClass("tuft", [tuft or Size("tuft", TUFT, tufts)], **follows),
    ]
    return Problem(Domain((SIDE, SIDE), boundary), classes, **({"seed": seed, "avoid_overlap": True} | changed))


def ramp() -> np.ndarray:
    """A density that rises tenfold from left to right."""
    return np.broadcast_to(np.linspace(0.1, 1.0, 64), (64, 64)).copy()


def crescent() -> np.ndarray:
    """A density of a crescent, 0 around it."""
    y, x = (np.mgrid[:256, :256] + 0.5) / 256 * SIDE
    return ((np.hypot(x - 20.0, y - 20.0) < 16.0) & (np.hypot(x - 27.5, y - 20.0) > 11.0)).astype(float)


def nearest(position: np.ndarray) -> np.ndarray:
    """Distance of every body to the next one [m]."""
    return spatial.cKDTree(position).query(position, 2)[0][:, 1]


def largest_hole(placement: Placement) -> float:
    """Radius of the largest empty disc farther than a meter within the border [m]."""
    points = np.random.default_rng(0).uniform(1.0, SIDE - 1.0, (100_000, 2))
    empty = np.full(len(points), math.inf)
    for number in range(len(placement.problem.classes)):
        own = placement.class_index == number
        radius = math.sqrt(placement.area[own].max() / math.pi)
        empty = np.minimum(empty, spatial.cKDTree(placement.position[own]).query(points)[0] - radius)
    return float(empty.max())


def error_of_tufts(placement: Placement) -> float:
    return placement.report.classes[1].coverage_error


def test_a_density_is_followed_beside_large_bodies_as_anywhere():
    """One push for all of the ground left rows of tufts where they are dense, and moats where they are sparse: errors of .09."""
    errors = [error_of_tufts(solve(scene(20, density=ramp(), seed=seed), device="cpu")) for seed in (1, 2, 3)]
    assert np.mean(errors) < 0.02


@pytest.mark.parametrize("boundary", ["natural", "periodic", "mirror"])
def test_small_ones_are_even_at_every_border(boundary):
    placement = solve(scene(boundary=boundary), device="cpu")
    tufts = placement.position[placement.class_index == 1]
    spacing = math.sqrt((SIDE**2 - 30 * BOULDER) / len(tufts))
    # Where those of all classes moved together along a natural border they were pressed to .3 of it.
    assert np.quantile(nearest(tufts), 0.01) > 0.75 * spacing
    assert error_of_tufts(placement) < 0.02 and placement.report.overlaps == 0
    assert len(placement.position) == 2530


@pytest.mark.parametrize(
    ("boulders", "tufts", "least"), [(25, 40, 0.85), (60, 60, 0.8), (60, 20, 0.7), (25, 100, 0.82), (25, 400, 0.82)]
)
def test_few_small_ones_among_large_ones_are_even(boulders, tufts, least):
    """Where they kept as far off large ones as many do, 20 among 60 stood in clusters: at .07."""
    found = []
    for seed in (1, 2, 3):
        classes = [BodyClass("boulder", [Size("s", 4.0, boulders)]), BodyClass("tuft", [Size("s", 0.04, tufts)])]
        placement = solve(Problem(Domain((20.0, 20.0)), classes, seed=seed, avoid_overlap=True), device="cpu")
        found.append(nearest(placement.position[placement.class_index == 1]).mean() / math.sqrt(400.0 / tufts))
    assert np.mean(found) > least


def test_three_sizes_in_a_crescent_leave_no_holes():
    density = crescent()
    sizes = (("rock", 16.0, 5), ("shrub", 1.0, 70), ("pebble", 0.035, 1500))
    classes = [BodyClass(name, [Size(name, area, count)], density=density) for name, area, count in sizes]
    placement = solve(Problem(Domain((SIDE, SIDE), "natural"), classes, seed=1, avoid_overlap=True), device="cpu")
    # .19 where all moved together.
    assert placement.report.classes[2].coverage_error < 0.05
    assert np.bincount(placement.class_index).tolist() == [5, 70, 1500] and placement.report.overlaps == 0


@pytest.mark.parametrize(
    "boulder", [Size("bar", 4.0, 30, footprint=BAR), Size("log", 4.0, 20, line=Line(length=6.0))], ids=["bars", "logs"]
)
def test_long_bodies_are_obstacles_as_they_lie(boulder):
    placement = solve(scene(boulder=boulder), device="cpu")
    assert error_of_tufts(placement) < 0.03 and placement.report.overlaps == 0


def test_bodies_keep_areas_outlines_and_places_that_are_theirs():
    fixed = [
        FixedBodies(np.array([[10.0, 10.0], [30.0, 12.0]]), "boulder", "boulder"),
        FixedBodies(np.array([[20.0, 20.0], [5.0, 25.0], [33.0, 33.0]]), "tuft", "leaf"),
    ]
    tuft = Size("leaf", None, 1500, footprint=Footprints([LEAF, LEAF.scaled(1.5)], scale_jitter=0.3))
    problem = scene(25, tuft=tuft, fixed=fixed)
    with Solver(problem, device="cpu") as solver:
        before = solver.descent.placement()
        solver.run(60)
        assert solver.separate()
        after = solver.placement()
    for name in ("area", "variant", "scale", "id", "class_index", "size_index", "fixed"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    np.testing.assert_array_equal(after.position[after.fixed], before.position[before.fixed])
    assert np.bincount(after.class_index).tolist() == [27, 1503]


def test_a_range_of_small_areas_is_as_even_as_alone():
    tuft = Size("tuft", (0.03, 0.1), 2000)
    among = solve(scene(25, tuft=tuft), device="cpu")
    alone = solve(Problem(Domain((SIDE, SIDE)), [BodyClass("tuft", [tuft])], seed=1, avoid_overlap=True), device="cpu")
    ground = [1.0 - 25 * BOULDER / SIDE**2, 1.0]
    spacings = [
        nearest(placement.position[placement.area < 1.0]).mean() / math.sqrt(share)
        for placement, share in zip((among, alone), ground, strict=True)
    ]
    assert spacings[0] > 0.93 * spacings[1]


def after_edit(before: Problem, after: Problem) -> tuple[Placement, Placement, Placement]:
    """What there was, what an edit of five steps made of it, and a fresh run."""
    with Solver(before, device="cpu") as solver:
        solver.run(60)
        solver.separate()
        first = solver.placement()
        solver.edit(after, steps=5)
        return first, solver.placement(report=True), solve(after, device="cpu")


def unmoved(first: Placement, second: Placement) -> float:
    """Share of the bodies that are in both that moved by less than a tenth of a spacing."""
    place = dict(zip(first.id.tolist(), first.position, strict=True))
    moved = [
        np.hypot(*(place[number] - position))
        for number, position in zip(second.id.tolist(), second.position, strict=True)
        if number in place
    ]
    return float((np.array(moved) < 0.1 * math.sqrt(SIDE**2 / len(second.position))).mean())


@pytest.mark.parametrize("boundary", ["open", "natural"])
@pytest.mark.parametrize("boulders", [27, 31])
def test_the_ground_of_boulders_that_go_and_come_is_filled_and_left(boulders, boundary):
    first, edited, fresh = after_edit(scene(boundary=boundary), scene(boulders, boundary=boundary))
    assert edited.report.overlaps == 0
    # Bare discs of 1.6 m and errors of .05 to .08 where small ones knew boulders by their forces only.
    assert error_of_tufts(edited) < max(1.25 * error_of_tufts(fresh), 0.015)
    assert largest_hole(edited) < 0.75
    assert unmoved(first, edited) > 0.6


def test_a_stroke_moves_few_and_errors_stay_those_of_a_fresh_run():
    y, x = (np.mgrid[:64, :64] + 0.5) / 64
    stroke = np.where(np.hypot(x - 0.6, y - 0.4) < 0.13, 0.4, 1.0)
    first, edited, fresh = after_edit(scene(density=np.ones((64, 64))), scene(density=stroke))
    assert error_of_tufts(edited) < max(1.25 * error_of_tufts(fresh), 0.01)
    assert unmoved(first, edited) > 0.7
    # Boulders follow nothing that has changed.
    one, other = (placement.position[placement.class_index == 0] for placement in (first, edited))
    assert np.hypot(*(one - other).T).max() < 0.3


@pytest.mark.parametrize(
    "changed", [{"boulders": 27}, {"tufts": 2700}, {"tufts": 2000}], ids=["fewer boulders", "more tufts", "fewer tufts"]
)
def test_numbers_stay_with_bodies_and_edits_tell_who_came_and_went(changed):
    with Solver(scene(), device="cpu") as solver:
        solver.run(60)
        solver.separate()
        first = solver.placement()
        edit = solver.edit(scene(**changed), steps=5)
        second = solver.placement()
    assert len(np.unique(second.id)) == len(second.id)
    np.testing.assert_array_equal(edit.added, np.setdiff1d(second.id, first.id))
    np.testing.assert_array_equal(edit.removed, np.setdiff1d(first.id, second.id))
    place = dict(zip(first.id.tolist(), zip(first.position, first.class_index, strict=True), strict=True))
    spacing = math.sqrt(SIDE**2 / 2500)
    for number, position, class_index in zip(second.id.tolist(), second.position, second.class_index, strict=True):
        if number in place:
            before, class_before = place[number]
            assert class_before == class_index
            # Nobody goes farther under one number.
            assert class_index == 0 or np.hypot(*(position - before)) < 5.0 * spacing


def test_outlines_go_with_their_bodies_in_an_edit():
    tuft = Size("leaf", None, 1500, footprint=Footprints([LEAF, LEAF.scaled(1.5)], scale_jitter=0.3))
    with Solver(scene(25, tuft=tuft), device="cpu") as solver:
        solver.run(60)
        solver.separate()
        first = solver.placement()
        solver.edit(scene(23, tuft=tuft), steps=5)
        second = solver.placement(report=True)
    assert second.report.overlaps == 0
    kept = np.intersect1d(first.id, second.id)
    assert len(kept) > 1400
    one, other = (
        placement_of[np.argsort(ids)[np.searchsorted(np.sort(ids), kept)]]
        for placement_of, ids in ((first.area, first.id), (second.area, second.id))
    )
    np.testing.assert_allclose(one, other, rtol=1e-6)


def test_a_pin_that_changes_hands_stands_alone_where_it_is():
    pins = [FixedBodies(np.array([[12.0, 12.0]]), "tuft", "tuft", id=np.array([100]))]
    with Solver(scene(tufts=600, fixed=pins), device="cpu") as solver:
        solver.run(40)
        solver.separate()
        again = [FixedBodies(np.array([[12.0, 12.0]]), "tuft", "tuft", id=np.array([200]))]
        solver.edit(scene(tufts=620, fixed=again), steps=5)
        placement = solver.placement(report=True)
        # In the state, too, not only where a placement says so.
        in_state = solver.descent.positions()
    (pinned,) = np.flatnonzero(placement.fixed)
    assert placement.id[pinned] == 200
    np.testing.assert_allclose(in_state[pinned], [12.0, 12.0], atol=1e-4)
    assert placement.report.overlaps == 0 and len(np.unique(placement.id)) == len(placement.id)


def test_a_look_in_between_and_further_runs_leave_small_ones_even():
    with Solver(scene(20, density=ramp()), device="cpu") as solver:
        solver.run(60)
        solver.placement()
        solver.run(60)
        solver.separate()
        assert error_of_tufts(solver.placement(report=True)) < 0.045


def test_bodies_that_are_put_somewhere_after_a_run_stay_there():
    with Solver(scene(density=ramp()), device="cpu") as solver:
        solver.run(20)
        first = solver.placement()
        bookmark = solver.bookmark()
        solver.edit(scene(28, density=ramp()), steps=5)
        solver.run(20)
        solver.go_back(bookmark)
        np.testing.assert_array_equal(solver.placement().position, first.position)
        solver.run(20)
        solver.start_at(first.position)
        np.testing.assert_allclose(solver.placement().position, first.position, atol=1e-4)


def test_a_class_without_a_place_beside_large_bodies_is_no_error():
    y, x = (np.mgrid[:400, :400] + 0.5) / 400 * SIDE
    around = (np.hypot(x - 10.0, SIDE - y - 10.0) < 1.73).astype(float)
    boulder = BodyClass("boulder", [Size("boulder", BOULDER, 6)])
    classes = [
        boulder,
        BodyClass("tuft", [Size("tuft", TUFT, 600)]),
        BodyClass("clover", [Size("c", 0.02, 5)], density=around),
    ]
    fixed = [FixedBodies(np.array([[10.0, 10.0]]), "boulder", "boulder")]
    domain = Domain((SIDE, SIDE))
    before = Problem(domain, classes[:2], fixed=fixed, avoid_overlap=True)
    with Solver(before, device="cpu") as solver:
        solver.run(40)
        solver.placement()
        solver.edit(Problem(domain, classes, fixed=fixed, avoid_overlap=True), steps=5)
        assert len(solver.placement().position) == 7 + 600 + 5


def test_ghosts_stay_out_of_it():
    fixed = [FixedBodies(np.array([[10.0, 10.0], [12.0, 10.0]]), "tuft", "tuft")]
    problem = scene(8, 300, fixed=fixed)
    flags = np.where(problem.body_is_fixed(), int(BodyFlags.GHOST), 0)
    with Solver(problem, device="cpu", flags=flags) as solver:
        solver.run(20)
        solver.edit(scene(8, 310, fixed=fixed), steps=5)
        assert len(solver.descent.positions()) == 320


def test_a_run_that_is_stopped_is_not_improved_after_that():
    with Solver(scene(density=ramp()), device="cpu") as solver:
        solver.run(60, lambda progress: progress.step < 20)
        stopped = solver.descent.placement().position
        np.testing.assert_array_equal(solver.placement().position, stopped)
    with Solver(scene(density=ramp()), device="cpu") as solver:
        solver.run(20)
        before = solver.descent.placement().position
        solver.separate(lambda: False)
        moved = np.hypot(*(solver.placement().position - before).T)
        assert np.median(moved) < 0.05, "they stay where they were, but for those who overlap"


def test_which_sizes_are_large():
    assert least_large_area(scene()) == BOULDER
    assert least_large_area(scene(boulder=Size("a", LARGE * TUFT, 30))) == LARGE * TUFT
    none = [
        scene(boulder=Size("a", 0.99 * LARGE * TUFT, 30)),
        scene(boulder=Size("a", (0.9 * LARGE * TUFT, 20.0), 30)),
        scene(tuft=Size("blade", TUFT, 2500, line=Line(length=0.3))),
        scene(30, 359),
        scene(avoid_overlap=False),
        scene(balance=Balance(rare_emphasis=0.0)),
        scene(balance=Balance(non_overlap=np.eye(2))),
    ]
    assert [least_large_area(problem) for problem in none] == [math.inf] * len(none)


def test_emphases_of_the_sizes_that_are_left_are_kept():
    sizes = [Size("boulder", 40.0, 5), Size("stone", 0.4, 60), Size("gravel", 0.2, 600)]
    problem = Problem(
        Domain((SIDE, SIDE)), [BodyClass("a", sizes)], Balance(size_emphasis=(2.0, 3.0)), avoid_overlap=True
    )
    with Solver(problem, device="cpu") as solver:
        small = small_among_large(solver.placement())
    assert small.problem.balance.size_emphasis == (2.0,)
    assert [size.name for size in small.problem.classes[0].sizes] == ["stone", "gravel"]
    assert len(small.problem.obstacles) == 5 and small.rows.tolist() == list(range(5, 665))
