"""After an edit most bodies are where they were; what changed is followed, by bodies that keep their identities."""

import gc
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from esh import (
    BodyClass,
    Domain,
    FixedBodies,
    Footprint,
    Footprints,
    Line,
    Obstacle,
    Problem,
    ProblemError,
    Size,
    Solver,
    Surface,
    SurfaceMesh,
)
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.edits.edit import EditInPlane
from esh.engine.model.model import Model
from esh.engine.motion.line_rules import length_blocks
from esh.engine.quality.coverage import coverage_error
from esh.engine.quality.measurement import measure
from scipy.spatial import cKDTree

DOMAIN = Domain((64.0, 64.0))
N = 2000
Y, X = np.mgrid[:64, :64] / 64.0
HILLS = (0.3 + np.sin(5 * X) ** 2 * np.cos(4 * Y) ** 2).astype(np.float32)
STROKE = (np.abs(Y - 0.5 - 0.2 * np.sin(6 * X)) < 0.035) & (X > 0.1) & (X < 0.8)
SPACING = 64.0 / np.sqrt(N)


def problem_of(density=HILLS, count=N, **more):
    return Problem(DOMAIN, [BodyClass("k", [Size("a", 0.2, count)], density)], seed=1, **more)


@pytest.fixture(scope="module")
def settled():
    """A solver that has settled, as its state."""
    with Solver(problem_of(), device="cpu") as solver:
        solver.run(150)
        return solver.state.copy()


def solver_at(settled):
    return Solver(problem_of(), device="cpu", state=settled)


def painted(factor):
    return np.where(STROKE, factor * HILLS, HILLS)


def error(placement, density):
    return coverage_error(placement.position, placement.area, density, DOMAIN)


def far(position, least=2.5):
    """Whether positions are so many spacings from the stroke."""
    rows, columns = np.nonzero(STROKE)
    pixels = np.stack([columns + 0.5, 63.5 - rows], axis=1)
    return np.linalg.norm(position[:, None] - pixels, axis=2).min(axis=1) > least * SPACING


def moved(before, after):
    """How far bodies that are in both have moved, in spacings, and where they were."""
    _, i, j = np.intersect1d(before.id, after.id, return_indices=True)
    return np.linalg.norm(after.position[j] - before.position[i], axis=1) / SPACING, before.position[i]


def counts_by_density(factor):
    return round(N * painted(factor).mean() / HILLS.mean())


@pytest.mark.parametrize("factor", [0.2, 3.0])
def test_a_stroke_is_followed_in_five_steps_and_leaves_the_rest_in_place(factor):
    """The count follows the density, as under a brush."""
    density, count = painted(factor), counts_by_density(factor)
    unmoved = []
    for seed in range(1, 5):
        with Solver(replace(problem_of(), seed=seed), device="cpu") as solver:
            solver.run(150)
            before = solver.placement()
            edit = solver.edit(replace(problem_of(density, count), seed=seed))
            after = solver.placement()
            assert edit.steps == 5
            solver.run(150)
            converged = error(solver.placement(), density)
        assert len(after.position) == count
        # Over eight seeds 1.06 to 1.12 where the stroke is thinned, and 1.03 to 1.06 where it is made denser.
        assert error(after, density) < (1.25 if factor < 1.0 else 1.15) * converged
        assert error(before, density) > 5.0 * converged
        way, at = moved(before, after)
        unmoved.append((way[far(at)] < 0.1).mean())
    # From .88 to .97 where the stroke is thinned: defects of the order wander off in some.
    assert np.mean(unmoved) > 0.9 and min(unmoved) > 0.8
    np.testing.assert_array_equal(np.sort(np.setdiff1d(after.id, before.id)), np.sort(edit.added))
    np.testing.assert_array_equal(np.sort(np.setdiff1d(before.id, after.id)), np.sort(edit.removed))
    changed = abs(count - N)
    assert changed <= max(len(edit.added), len(edit.removed)) < changed + 20


@pytest.mark.parametrize("factor", [0.25, 0.5])
def test_who_is_left_of_many_is_spread_evenly_before_any_step(factor):
    """Those that stood nearest to points that are even were half a spacing off them, which takes more than five steps to mend."""
    half = np.where(np.arange(64) < 32, factor, 1.0)[None, :].astype(np.float32)
    with Solver(problem_of(np.ones((1, 1), np.float32)), device="cpu") as solver:
        solver.run(100)
        before = solver.placement()
        edit = solver.edit(problem_of(half, round(N * half.mean())), steps=0)
        after = solver.placement()
    assert np.isin(after.id, before.id).all() and len(edit.added) == 0
    left = after.position[after.position[:, 0] < 28.0]
    near = cKDTree(left).query(left, 2)[0][:, 1] / (SPACING / np.sqrt(factor))
    assert near.std() < 0.08 * near.mean() and near.min() > 0.65
    # The others have stayed where they were.
    way, at = moved(before, after)
    assert way[at[:, 0] > 33.0].max() < 1e-4


@pytest.mark.parametrize("count", [4096, 6000])
def test_what_is_erased_leaves_the_rest_in_place_and_even(count):
    """Of a few that stayed beside the hole some went to a corner of the domain, and errors were four times the later ones."""
    everywhere, hole = np.ones((256, 256), np.float32), np.ones((256, 256), np.float32)
    y, x = (np.mgrid[:256, :256] + 0.5) / 256
    hole[np.hypot(x - 0.4, y - 0.45) < 0.126] = 0.0
    left = round(count * hole.mean())
    for seed in (1, 2, 3):
        with Solver(replace(problem_of(everywhere, count), seed=seed), device="cpu") as solver:
            solver.run(150)
            before = solver.placement()
            solver.edit(replace(problem_of(hole, left), seed=seed))
            after = solver.placement()
            solver.run(100)
            later = solver.placement()
        # At most 1.1.
        assert error(after, hole) < 1.25 * error(later, hole)
        _, i, j = np.intersect1d(before.id, after.id, return_indices=True)
        way = np.linalg.norm(after.position[j] - before.position[i], axis=1)
        assert way.max() < 4.0 * np.sqrt(DOMAIN.area / count)


# Errors over the later ones: over eight seeds at most 1.36, 1.28, 1.25 and 2.07.
@pytest.mark.parametrize(("factor", "over_later"), [(0.2, 1.5), (0.5, 1.4), (1.5, 1.4), (3.0, 2.3)])
def test_a_stroke_that_keeps_the_count_is_followed_as_well(settled, factor, over_later):
    """As many come or go elsewhere as within it, and four fifths of the others stay where they are all the same."""
    density = painted(factor)
    with solver_at(settled) as solver:
        before = solver.placement()
        edit = solver.edit(problem_of(density))
        after = solver.placement()
        solver.run(150)
        converged = error(solver.placement(), density)
    assert len(edit.added) == len(edit.removed) > 20
    assert error(after, density) < over_later * converged
    way, at = moved(before, after)
    assert (way[far(at)] < 0.1).mean() > 0.78


@pytest.mark.parametrize("seed", [0, 3])
def test_who_is_left_of_many_stays_near_a_natural_border(seed):
    """Points for few survivors were held within a tenth of the domain from its border: some strayed there, to its other end."""
    along = np.abs(X - 0.5 - 0.03 * (1 + seed) * np.sin(6 * Y))
    stroke = along < np.quantile(along, 0.05)
    count = 2500
    before, after = np.ones((64, 64)), np.where(stroke, 0.2, 1.0)
    domain = Domain((64.0, 64.0), "natural")

    def problem_with(density, count):
        return Problem(domain, [BodyClass("k", [Size("a", 0.2, count)], density)], seed=seed)

    with Solver(problem_with(before, count), device="cpu") as solver:
        solver.run(40)
        there = solver.placement()
        solver.edit(problem_with(after, round(count * after.mean())))
        shift, _ = moved(there, solver.placement())
    assert shift.max() < 3.0


def test_nothing_changed_changes_nearly_nothing(settled):
    with solver_at(settled) as solver:
        before = solver.placement()
        edit = solver.edit(problem_of())
        assert len(edit.added) == len(edit.removed) == 0
        # What is left to settle: a body or two in a place where several patterns are nearly as good.
        way = moved(before, solver.placement())[0]
        assert way.max() < 0.15 and np.quantile(way, 0.99) < 0.05
        np.testing.assert_array_equal(solver.placement().id, before.id)
        solver.edit(problem_of(), steps=0)
        np.testing.assert_array_equal(solver.placement().id, before.id)


def test_five_percent_more_bodies_come_down_evenly(settled):
    with solver_at(settled) as solver:
        edit = solver.edit(problem_of(count=N + 100))
        after = solver.placement()
        solver.run(150)
        assert error(after, HILLS) < 2.1 * error(solver.placement(), HILLS)
    assert edit.added.tolist() == list(range(N, N + 100))
    assert len(edit.removed) == 0


def test_fewer_bodies_are_taken_out_evenly(settled):
    with solver_at(settled) as solver:
        edit = solver.edit(problem_of(count=N - 150))
        after = solver.placement()
        solver.run(150)
        assert error(after, HILLS) < 2.0 * error(solver.placement(), HILLS)
    assert len(edit.added) == 0
    assert len(edit.removed) == 150


def test_identities_are_never_used_again(settled):
    with solver_at(settled) as solver:
        seen = set(solver.placement().id.tolist())
        for count in (N + 20, N - 20, N + 20):
            edit = solver.edit(problem_of(count=count), steps=1)
            assert not seen & set(edit.added.tolist())
            seen |= set(edit.added.tolist())
            assert len(set(solver.placement().id.tolist())) == count


def test_an_obstacle_clears_its_place_and_gives_it_back(settled):
    pond = Obstacle(disc=(32.0, 32.0, 8.0), margin=0.5)
    with solver_at(settled) as solver:
        before = solver.placement()
        edit = solver.edit(problem_of(obstacles=[pond]))
        after = solver.placement()
        assert (np.linalg.norm(after.position - 32.0, axis=1) >= 8.5).all()
        inside = np.linalg.norm(before.position - 32.0, axis=1) < 8.5
        gone = np.isin(before.id, edit.removed)
        # Those that stood on it, and hardly any other: one by one they come down elsewhere.
        assert inside.sum() > 60
        assert gone[np.linalg.norm(before.position - 32.0, axis=1) < 7.5].mean() > 0.95
        assert (gone & ~inside).sum() <= 10
        assert len(after.position) == N
        solver.edit(problem_of())
        assert (np.linalg.norm(solver.placement().position - 32.0, axis=1) < 8.5).sum() == pytest.approx(
            inside.sum(), rel=0.15
        )


def test_a_body_is_pinned_where_it_is_and_nothing_else_happens(settled):
    with solver_at(settled) as solver:
        before = solver.placement()
        chosen = np.array([7, 900])
        fixed = FixedBodies.of_placement(before, chosen)
        edit = solver.edit(problem_of(fixed=fixed, include_fixed=True))
        after = solver.placement()
        assert len(edit.added) == len(edit.removed) == 0
        assert after.id[after.fixed].tolist() == chosen.tolist()
        np.testing.assert_array_equal(after.position[after.fixed], before.position[chosen])
        assert np.percentile(moved(before, after)[0], 99) < 0.1
        # And let go again.
        edit = solver.edit(problem_of())
        again = solver.placement()
        assert len(edit.added) == len(edit.removed) == 0
        assert not again.fixed.any()
        assert set(again.id.tolist()) == set(before.id.tolist())


@pytest.mark.parametrize("pins", [True, False])
def test_an_edit_that_moves_nobody_does_not_let_go_of_all(pins):
    """Who was held by edits before is not settled: of several classes two fifths moved when a body was pinned where it was."""
    with Solver(problem_of(), device="cpu") as solver:
        solver.run(6)
        before = solver.placement()
        more = {"fixed": FixedBodies.of_placement(before, [7]), "include_fixed": True} if pins else {}
        edit = solver.edit(problem_of(**more))
        assert len(edit.added) == len(edit.removed) == 0
        assert (moved(before, solver.placement())[0] < 0.1).mean() > 0.79


def test_where_bodies_act_on_each_other_in_another_way_all_are_free():
    with Solver(problem_of(), device="cpu") as solver:
        solver.run(6)
        before = solver.placement()
        solver.edit(problem_of(regularity=0.5))
        assert (moved(before, solver.placement())[0] < 0.1).mean() < 0.75


def test_a_pinned_body_that_is_moved_makes_the_others_move(settled):
    with solver_at(settled) as solver:
        before = solver.placement()
        one = int(np.linalg.norm(before.position - [20.0, 20.0], axis=1).argmin())
        to = before.position[one] + [0.5 * SPACING, 0.1]
        fixed = FixedBodies([to], id=[one])
        solver.edit(problem_of(fixed=fixed, include_fixed=True))
        after = solver.placement()
    assert after.position[after.id == one].tolist() == [to.tolist()]
    near = np.linalg.norm(after.position - to, axis=1)
    assert np.sort(near)[1] > 0.4 * SPACING
    way, at = moved(before, after)
    assert (way[np.linalg.norm(at - to, axis=1) > 6 * SPACING] < 0.1).mean() > 0.97


def test_classes_and_sizes_come_and_go_by_name(settled):
    both = [Size("a", 0.2, 500), Size("b", 0.4, 100)]
    other = BodyClass("other", [Size("a", 0.3, 300)])
    with solver_at(settled) as solver:
        edit = solver.edit(Problem(DOMAIN, [other, BodyClass("k", both, HILLS)], seed=1))
        placement = solver.placement()
        assert len(edit.removed) == N - 500
        assert len(edit.added) == 400
        kept = placement.id < N
        assert (placement.class_index[kept] == 1).all()
        assert (placement.size_index[kept] == 0).all()
        assert placement.report is None
        edit = solver.edit(Problem(DOMAIN, [other]))
        assert len(edit.removed) == 600
        assert len(edit.added) == 0


def test_bodies_of_a_range_keep_their_ranks():
    def of(count):
        return Problem(DOMAIN, [BodyClass("k", [Size("a", (0.1, 0.9), count)])])

    with Solver(of(200), device="cpu") as solver:
        solver.run(20)
        before = solver.placement()
        solver.edit(of(220), steps=0)
        after = solver.placement()
    _, i, j = np.intersect1d(before.id, after.id, return_indices=True)
    assert len(i) == 200
    np.testing.assert_array_equal(np.argsort(before.area[i]), np.argsort(after.area[j]))
    np.testing.assert_allclose(after.area[j], before.area[i], atol=0.03)
    new = ~np.isin(after.id, before.id)
    np.testing.assert_allclose(np.sort(after.area[new]), np.linspace(0.12, 0.88, 20), atol=0.03)


def test_lines_keep_angle_length_and_bend():
    def of(count):
        line = Line(3.0, "none", straightness=0.2)
        return Problem(DOMAIN, [BodyClass("k", [Size("a", 0.5, count, line=line), Size("dot", 0.1, 50)])])

    with Solver(of(150), device="cpu") as solver:
        solver.run(40)
        before = solver.placement()
        solver.edit(of(170), steps=0)
        after = solver.placement()
    _, i, j = np.intersect1d(before.id, after.id, return_indices=True)
    assert len(i) == 200
    np.testing.assert_allclose(after.position[j], before.position[i], atol=1e-4)
    np.testing.assert_allclose(after.angle[j], before.angle[i], atol=1e-5)
    np.testing.assert_allclose(after.length[j], before.length[i], atol=1e-4)
    np.testing.assert_allclose(after.bends[j], before.bends[i], atol=1e-3)
    assert np.nanmax(np.abs(np.diff(before.bends[i], 2, axis=1))) > 1e-2
    new = ~np.isin(after.id, before.id)
    np.testing.assert_allclose(after.length[new], 3.0, rtol=1e-5)


def test_footprints_do_not_overlap_after_an_edit():
    def of(count):
        return Problem(DOMAIN, [BodyClass("k", [Size("a", 1.2, count)], HILLS)], avoid_overlap=True)

    from esh.engine.quality.overlaps import overlaps_of

    with Solver(of(1500), device="cpu") as solver:
        solver.run(40)
        solver.separate()
        solver.edit(of(1600))
        placement = solver.placement()
        assert overlaps_of(placement, solver.launcher).count == 0


def test_edits_give_the_same_bytes_on_any_number_of_threads(monkeypatch):
    found = []
    for threads in ("1", "3"):
        monkeypatch.setenv("ESH_THREADS", threads)
        with Solver(problem_of(count=6000), device="cpu") as solver:
            solver.run(3)
            solver.edit(problem_of(painted(3.0), 6000))
            solver.edit(problem_of(painted(3.0), 6300, obstacles=[Obstacle(disc=(9, 9, 5))]))
            found.append(solver.placement())
    np.testing.assert_array_equal(found[0].position, found[1].position)
    np.testing.assert_array_equal(found[0].id, found[1].id)


def test_the_domain_stays(settled):
    with solver_at(settled) as solver, pytest.raises(ProblemError, match="`domain` must stay what it was in an edit"):
        solver.edit(Problem(Domain((64.0, 65.0)), [BodyClass("k", [Size("a", 1.0, 3)])]))


def test_a_body_goes_where_no_points_are_spread():
    """Bodies without a place go, whatever else is asked for; others only to make room."""
    old = Model(problem_of(np.ones((1, 1)), 100))
    position = np.random.default_rng(0).random((100, 2)) * [32.0, 64.0]
    position[45:, 0] += 32.0
    half = np.zeros((1, 2))
    half[0, 1] = 1.0
    asked = []

    def spread(densities, counts, _part):
        asked.append(counts)
        return lambda: [wp.array(np.tile([[48.0, 32.0]], (count, 1)), dtype=wp.vec2d, device="cpu") for count in counts]

    pose = np.zeros((100, 4), np.float32)
    pose[:, :2] = position / old.unit
    model = Model(problem_of(half, 100))
    with closing(Launcher(resolve_device("cpu"))) as launcher:
        carried = EditInPlane(launcher, old, launcher.array(pose, wp.vec4), model, spread).finish(100)
    left = position[:, 0] < 32.0
    assert len(carried.new) == len(carried.came) == len(carried.went) == 50
    assert (carried.pose.numpy()[:, 0] * model.unit >= 32.0).all()
    # Fifty are to come, so that five of those that could stay make room for them.
    assert asked == [[5, 0, 50]]
    kept = carried.source[carried.source >= 0]
    assert not left[kept].any()
    assert len(np.unique(kept)) == 50


def test_a_body_beside_its_density_by_rounding_stays_where_nothing_changes():
    """It was taken out and set down somewhere else: one to three of some hundred bodies, in 6 of 330 edits."""
    half = np.zeros((1, 2))
    half[0, 1] = 1.0
    old, model = (Model(problem_of(half, 100)) for _ in range(2))
    position = np.random.default_rng(0).random((100, 2)) * [32.0, 64.0] + [32.0, 0.0]
    position[7, 0] = 32.0 - 1e-4
    pose = np.zeros((100, 4), np.float32)
    pose[:, :2] = position / old.unit
    with closing(Launcher(resolve_device("cpu"))) as launcher:

        def spread(densities, counts, _part):
            assert counts == [0, 0, 0]
            return lambda: [np.zeros((0, 2))] * 3

        carried = EditInPlane(launcher, old, launcher.array(pose, wp.vec4), model, spread).finish(100)
    assert len(carried.came) == len(carried.went) == 0
    np.testing.assert_array_equal(carried.source, np.arange(100))
    assert carried.pose.numpy()[7, 0] * model.unit >= 32.0


def test_fixed_bodies_of_a_problem_that_is_replaced_are_still_told_apart(settled):
    with solver_at(settled) as solver:
        fixed = FixedBodies([[1.0, 1.0]], id=[50_000])
        solver.edit(problem_of(fixed=fixed), steps=1)
        assert solver.placement().id.max() == 50_000
        edit = solver.edit(replace(problem_of(count=N + 5), seed=3), steps=1)
        # It was let go and stays, so that four more are enough.
        assert 50_000 in solver.placement().id
        assert len(edit.added) == 4
        assert edit.added.min() > 50_000


def outlined_problem(count: int = 60, angle: str | float = "none") -> Problem:
    triangle = Footprint.polygon([(-0.5, -0.3), (0.6, -0.3), (0.0, 0.7)])
    long = Line(1.5, angle, width=0.3)
    sizes = [
        Size("dot", 0.5, count),
        Size("triangle", None, count, footprint=triangle),
        Size("rod", 0.6, count, line=long),
    ]
    return Problem(Domain((30.0, 20.0)), [BodyClass("a", sizes)], seed=3, avoid_overlap=True)


def test_a_solver_starts_where_a_placement_was():
    problem = outlined_problem()
    with Solver(problem, device="cpu") as solver:
        solver.run(20)
        solver.separate()
        kept = solver.placement()
    identity = kept.id[::-1] + 1000
    with Solver(problem, device="cpu") as solver:
        solver.start_at(kept.position, angle=kept.angle, length=kept.length, identity=identity)
        again = solver.placement()
        np.testing.assert_allclose(again.position, kept.position, atol=1e-4)
        turned = np.mod(again.angle - kept.angle + 1.0, np.pi) - 1.0
        assert np.abs(turned).max() < 1e-4
        np.testing.assert_allclose(again.length, kept.length, rtol=1e-5)
        np.testing.assert_array_equal(again.id, identity)
        edit = solver.edit(outlined_problem(66))
        assert len(edit.added) == 18 and len(edit.removed) == 0 and edit.added.min() > identity.max()
        moved = solver.placement()
    _, i, j = np.intersect1d(identity, moved.id, return_indices=True)
    assert len(i) == 180
    way = np.linalg.norm(moved.position[j] - kept.position[i], axis=1)
    assert np.median(way) < 0.4


def test_a_solver_starts_with_the_outlines_that_bodies_had():
    """After edits these are not those that a problem draws for the rows that bodies are in."""
    triangle = Footprint.polygon([(-0.5, -0.3), (0.6, -0.3), (0.0, 0.7)])
    several = Footprints([triangle, triangle.scaled(0.5)], variant=np.arange(30) % 2, scale=1.0)
    problem = Problem(
        Domain((30.0, 20.0)), [BodyClass("a", [Size("s", None, 30, footprint=several)])], avoid_overlap=True
    )
    variant, scale = np.repeat([1, 0], 15), np.linspace(0.5, 1.5, 30)
    with Solver(problem, device="cpu") as solver:
        position = solver.placement().position
        solver.start_at(position, variant=variant, scale=scale)
        again = solver.placement()
        np.testing.assert_array_equal(again.variant, variant)
        np.testing.assert_allclose(again.scale, scale)
        # Each has the area of its outline, also in the report.
        np.testing.assert_allclose(again.area, triangle.area * scale**2 / 4.0**variant)
        image = problem.classes[0].density_image
        measured = coverage_error(position, again.area, image, problem.rectangle)
        assert measure(again, solver.launcher).coverage_error == pytest.approx(measured, rel=1e-3)
        # There is no seventh variant.
        solver.start_at(position, variant=np.full(30, 7))
        np.testing.assert_array_equal(solver.placement().variant, variant)


@pytest.mark.parametrize(
    ("position", "identity", "named"),
    [
        (np.zeros((3, 2)), None, "180 bodies"),
        (np.full((180, 2), np.nan), None, "all finite"),
        (np.zeros((180, 2)), np.zeros(180, int), "`identity`"),
    ],
)
def test_places_that_fit_no_body_are_refused(position, identity, named):
    with Solver(outlined_problem(), device="cpu") as solver, pytest.raises(ProblemError, match=named):
        solver.start_at(position, identity=identity)


def test_edits_leave_nothing_behind():
    """Neither recordings nor what they hold: a scene may be edited all day."""

    def kept():
        gc.collect()
        objects = gc.get_objects()
        return sum(type(o) is wp.array for o in objects), sum(type(o) is wp.Launch for o in objects)

    with Solver(replace(problem_of(count=300), avoid_overlap=True), device="cpu") as solver:
        counts = []
        for k in range(36):
            # Counts change, so that points are spread, too. What is kept for the next edit has come together after 24.
            solver.edit(replace(problem_of(painted(0.2 + 0.1 * (k % 3)), 300 + 5 * (k % 4)), avoid_overlap=True))
            if k % 12 == 11:
                counts.append(kept())
        tables = len(solver.launcher._team._tables)
    print(counts, tables)
    assert counts[1] == counts[-1]
    assert tables < 10


def test_lines_keep_their_lengths_where_a_class_of_lines_comes():
    """What holds against their own charges was forgotten: lines of 0.8 m were 1.02 m long."""
    logs = BodyClass("log", [Size("a", 0.05, 100, line=Line(0.8, direction=0.7))])
    sticks = BodyClass("stick", [Size("a", 0.05, 40, line=Line(0.8, direction="none"))])
    domain = Domain((40.0, 30.0))
    with Solver(Problem(domain, [logs], seed=1), device="cpu") as solver:
        solver.run(100)
        solver.edit(Problem(domain, [sticks, logs], seed=1))
        placement = solver.placement()
    assert np.median(placement.length[placement.class_index == 1]) == pytest.approx(0.8, rel=0.1)


def test_what_lengths_were_pressed_by_is_known_after_an_edit():
    """Block by block, also where there are more blocks than before, and where there were none: a number in an even density."""
    wanted = np.tile(np.linspace(1.0, 3.0, 40), (30, 1))
    ramp = np.tile(np.linspace(1.0, 0.2, 40), (30, 1))

    def problem_of(count, length, density=ramp):
        return Problem(DOMAIN, [BodyClass("k", [Size("a", 0.3, count, line=Line(length, "none"))], density)])

    def by_halves(solver):
        factor = solver.state.length_factor.numpy()
        ((rows, columns),) = length_blocks(solver.model)
        return factor[1:].reshape(rows, columns)[:, [0, -1]].mean(axis=0)

    with Solver(problem_of(600, wanted), device="cpu") as solver:
        solver.run(60)
        before = by_halves(solver)
        assert abs(before[0] - before[1]) > 0.02
        solver.edit(problem_of(800, wanted), steps=0)
        np.testing.assert_allclose(by_halves(solver), before, atol=0.3 * abs(before[0] - before[1]))
        solver.edit(problem_of(800, 2.0, 1.0), steps=5)
        one = float(solver.state.length_factor.numpy()[0])
        solver.edit(problem_of(800, wanted), steps=0)
        np.testing.assert_allclose(by_halves(solver), one, rtol=1e-6)


def test_fixed_bodies_without_identities_get_free_ones_and_keep_them():
    place = np.random.default_rng(0).uniform(1.0, 9.0, (20, 2))

    def problem(count, extra=0):
        fixed = FixedBodies(place[: 20 - extra], body_class="a", size="s")
        return Problem(Domain((10.0, 10.0)), [BodyClass("a", [Size("s", 0.05, count)])], fixed=fixed)

    free = Problem(Domain((10.0, 10.0)), [BodyClass("a", [Size("s", 0.05, 30)])])
    with Solver(free, device="cpu") as solver:
        solver.step(5)
        before = solver.placement()
        solver.edit(problem(50))
        first = solver.placement()
        assert len(set(first.id.tolist())) == len(first.id)
        # Nobody who is fixed is one of those that there were.
        assert not set(first.id[first.fixed].tolist()) & set(before.id.tolist())
        solver.edit(problem(60, extra=5))
        then = solver.placement()
        assert len(set(then.id.tolist())) == len(then.id)
        was = dict(zip(map(tuple, first.position[first.fixed]), first.id[first.fixed].tolist(), strict=True))
        for at, identity in zip(then.position[then.fixed], then.id[then.fixed].tolist(), strict=True):
            assert was[tuple(at)] == identity


def test_bodies_that_are_moved_into_a_small_density_are_not_in_one_place():
    row, column = np.mgrid[:192, :256]
    everywhere = BodyClass("a", [Size("s", 0.02, 300)])
    for middle in ((60.0, 100.0), (93.0, 150.0), (120.0, 70.0)):
        dab = ((column - middle[1]) ** 2 + (row - middle[0]) ** 2 < 12.5**2).astype(float)
        small = BodyClass("b", [Size("s", 0.02, 50)], dab)
        with Solver(Problem(Domain((20.0, 15.0)), [everywhere], seed=5), device="cpu") as solver:
            solver.step(20)
            solver.edit(Problem(Domain((20.0, 15.0)), [everywhere, small], seed=5))
            position = solver.placement().position
        assert len(np.unique(position, axis=0)) == len(position)


def test_fixed_bodies_in_one_place_keep_different_identities():
    def problem(place):
        fixed = FixedBodies(np.array(place), body_class="a", size="s")
        return Problem(Domain((10.0, 10.0)), [BodyClass("a", [Size("s", 0.05, 10)])], fixed=fixed)

    with Solver(problem([[1.0, 1.0], [5.0, 5.0], [1.0, 1.0]]), device="cpu") as solver:
        before = solver.placement()
        solver.edit(problem([[1.0, 1.0], [1.0, 1.0], [1.0, 1.0], [2.0, 2.0]]))
        then = solver.placement()
    assert len(set(then.id.tolist())) == len(then.id)
    twice = before.id[before.fixed][[0, 2]].tolist()
    assert then.id[then.fixed][:2].tolist() == twice
    assert not set(then.id[then.fixed][2:].tolist()) & set(before.id.tolist())


def flat_surface():
    corners = np.array([(0.0, 0.0, 0.0), (64.0, 0.0, 0.0), (64.0, 64.0, 0.0), (0.0, 64.0, 0.0)])
    return Surface(SurfaceMesh(corners, [[0, 1, 2], [0, 2, 3]]))


@pytest.mark.parametrize(
    "domain", [DOMAIN, Domain((64.0, 64.0), "natural"), flat_surface()], ids=["open", "natural", "surface"]
)
def test_a_solver_goes_back_to_a_bookmark_at_once(domain):
    def asked(count):
        return Problem(domain, [BodyClass("k", [Size("a", 0.2, count)])], seed=1, avoid_overlap=True)

    with Solver(asked(300), device="cpu") as solver, Solver(asked(300), device="cpu") as other:
        solver.run(20)
        first = solver.bookmark()
        before = solver.placement()
        solver.edit(asked(360))
        second, after = solver.bookmark(), solver.placement()
        solver.edit(asked(200))
        for bookmark, there in ((first, before), (second, after), (second, after), (first, before)):
            solver.go_back(bookmark)
            now = solver.placement()
            np.testing.assert_array_equal(now.position, there.position)
            np.testing.assert_array_equal(now.id, there.id)
        # From there it goes on, and whoever comes has an identity that nobody had.
        solver.edit(asked(310))
        came = np.setdiff1d(solver.placement().id, before.id)
        assert len(came) == 10 and came.min() > after.id.max()
        assert len(solver.placement().position) == 310
        solver.drop(second)
        for wrong in (second, other.bookmark()):
            with pytest.raises(ProblemError, match="`bookmark` must be one of this Solver that was not dropped"):
                solver.go_back(wrong)
        solver.go_back(first)
        solver.drop(first)
        np.testing.assert_array_equal(solver.placement().position, before.position)
        solver.step(2)


@pytest.mark.parametrize(
    "domain", [DOMAIN, Domain((64.0, 64.0), "natural"), flat_surface()], ids=["open", "natural", "surface"]
)
def test_a_solver_is_made_where_bodies_are(domain):
    problem = Problem(domain, [BodyClass("k", [Size("a", 0.2, 300)])], seed=1)
    with Solver(problem, device="cpu") as solver:
        solver.run(20)
        position = solver.placement().position
    with Solver(problem, device="cpu") as asked, Solver(problem, device="cpu", at={"position": position}) as made:
        asked.start_at(position)
        np.testing.assert_array_equal(made.placement().position, asked.placement().position)
        np.testing.assert_allclose(made.placement().position, position, atol=1e-4)
        made.step(3)
        asked.step(3)
        np.testing.assert_array_equal(made.placement().position, asked.placement().position)
    with pytest.raises(ProblemError, match="`position` must hold"):
        Solver(problem, device="cpu", at={"position": position[1:]})


def test_those_who_come_to_one_corner_part_again():
    """Steps keep dots within the domain; two that went beyond a corner stood in it, and in one place for good."""
    place = np.random.default_rng(0).uniform(10.0, 54.0, (60, 2))
    place[:3], place[3:5] = 0.0, 64.0
    with Solver(problem_of(np.ones((1, 1), np.float32), 60), device="cpu") as solver:
        solver.start_at(place)
        solver.edit(problem_of(np.ones((1, 1), np.float32), 61))
        position = solver.placement().position
    apart, _ = cKDTree(position).query(position, 2)
    assert apart[:, 1].min() > 0.1


def test_what_an_edit_reads_does_not_grow_with_bodies_or_meshes(monkeypatch):
    """A GPU is waited for wherever its numbers are read."""
    read, numpy = [], wp.array.numpy
    everywhere = np.where(STROKE, 1.0, 0.7 * HILLS).astype(np.float32)
    with Solver(problem_of(HILLS, 20_000), device="cpu") as solver:
        monkeypatch.setattr(wp.array, "numpy", lambda array: (read.append(array.size), numpy(array))[1])
        change = solver.edit(problem_of(everywhere, 20_000))
    assert 500 < len(change.removed) < 5000
    # The densities of those that go and come, in cells; all else is sums, and who went.
    assert max(read) <= max(64**2, len(change.removed))
    assert len(read) < 15
