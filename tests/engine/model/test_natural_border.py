"""A natural border: nobody stands in rows along it, counts are exact, and densities hold up to it."""

from __future__ import annotations

import math

import esh
import numpy as np
import pytest
from esh.engine.descent.descent import Descent
from esh.engine.model.natural_border import NaturalBorder
from esh.engine.quality.coverage import coverage_error

SIDE = 64.0
ROW, COLUMN = (np.indices((256, 256)) + 0.5) / 256.0 - 0.5
AWAY = np.hypot(COLUMN, ROW)
DISC, LAKE = (AWAY < 0.4).astype(np.float32), (AWAY > 0.2).astype(np.float32)
HILLS = (1.2 + np.sin(9.0 * COLUMN) * np.cos(7.0 * ROW)).astype(np.float32)
UNIFORM = np.ones((1, 1), np.float32)


def problem_of(boundary, image=UNIFORM, count=2048, seed=0, **more):
    size = esh.Size("s", area=0.1, count=count)
    return esh.Problem(
        esh.Domain((SIDE, SIDE), boundary), [esh.BodyClass("a", [size], density=image)], seed=seed, **more
    )


def depth_of(name, position):
    """Distance inwards from the edge [m], and the area within a distance of it as a function [m²]."""
    if name in ("disc", "lake"):
        radius, sign = (0.4 * SIDE, 1.0) if name == "disc" else (0.2 * SIDE, -1.0)
        depth = sign * (radius - np.hypot(*(position - 0.5 * SIDE).T))
        return depth, lambda d: math.pi * np.abs(radius**2 - (radius - sign * d) ** 2)
    return np.minimum(position, SIDE - position).min(axis=1), lambda d: SIDE**2 - (SIDE - 2.0 * d) ** 2


@pytest.mark.parametrize(
    ("name", "image"), [("square", UNIFORM), ("hills", HILLS), ("disc", DISC), ("lake", LAKE)], ids=lambda v: str(v)[:6]
)
def test_no_row_along_the_border(name, image):
    """Number of bodies by their distance from the edge, in tenths of a spacing, over even; and errors beside an open one's."""
    spacing = math.sqrt(SIDE**2 * float((image > 0.0).mean()) / 2048)
    edges = 0.1 * spacing * np.arange(21)
    most, errors = {}, {}
    for boundary in ("open", "natural"):
        found, even = np.zeros(20), np.zeros(20)
        errors[boundary] = []
        for seed in range(3):
            placement = esh.solve(problem_of(boundary, image, seed=seed), device="cpu")
            depth, area_within = depth_of(name, placement.position)
            assert depth.min() > -0.3 * spacing
            found += np.histogram(depth, edges)[0]
            even += np.diff(area_within(edges)) / spacing**2
            domain = esh.Domain((SIDE, SIDE))
            errors[boundary].append(
                [coverage_error(placement.position, np.ones(2048), image, domain, k) for k in (1.0, 2.0)]
            )
        if name == "hills":
            even *= found.sum() / even.sum()
        most[boundary] = (found / even).max()
    assert most["natural"] < 2.0 < most["open"]
    (_, open_at_two), (at_one, at_two) = (np.mean(errors[boundary], axis=0) for boundary in ("open", "natural"))
    assert at_two < 1.5 * open_at_two and at_one < 0.006


@pytest.mark.parametrize(
    ("counts", "areas"), [((255, 681), (0.28, 0.04)), ((20, 60, 150, 300, 600), (2.0, 0.7, 0.25, 0.12, 0.05))]
)
def test_small_ones_fill_no_gap_along_the_border_that_large_ones_leave(counts, areas):
    """What evens out the cut drew small ones onto the border, thirty times as many as even, and large ones away from it."""
    side, seeds = 20.0, range(3)
    classes = [
        esh.BodyClass(f"c{n}", [esh.Size("s", area=a, count=c)])
        for n, (c, a) in enumerate(zip(counts, areas, strict=True))
    ]
    depths = [
        np.minimum(position, side - position).min(axis=1)
        for seed in seeds
        for position in [
            esh.solve(esh.Problem(esh.Domain((side,) * 2, "natural"), classes, seed=seed), device="cpu").position
        ]
    ]
    of_class = np.repeat(np.arange(len(counts)), counts)

    def found_over_even(number, within):
        even = counts[number] * (1.0 - (1.0 - 2.0 * within / side) ** 2)
        return np.mean([(depth[of_class == number] < within).sum() for depth in depths]) / even

    smallest, largest = len(counts) - 1, 0
    assert found_over_even(smallest, 0.05) < 2.5 and 0.6 < found_over_even(smallest, 0.5) < 1.4
    assert found_over_even(largest, 0.35 * side / math.sqrt(counts[largest])) > 0.6


def test_parts_that_do_not_meet_have_the_numbers_that_they_ask_for():
    """Who lay deepest anywhere was kept, so that one island had some too many and another too few."""
    islands = (np.hypot(COLUMN + 0.2, ROW) < 0.2) * 1.0 + (np.hypot(COLUMN - 0.28, ROW + 0.1) < 0.13) * 2.0
    # One that asks for less than a body.
    islands[4:6, 4:6] = 0.5
    error = {}
    for boundary in ("open", "natural"):
        placement = esh.solve(problem_of(boundary, islands.astype(np.float32), 1500), device="cpu")
        at = placement.position / SIDE - 0.5
        smaller = np.hypot(at[:, 0] - 0.28, at[:, 1] - 0.1) < 0.14
        asked = 1500 * islands[:, 135:].sum() / islands.sum()
        assert abs(smaller.sum() - asked) < 1.5
        error[boundary] = coverage_error(placement.position, placement.area, islands, placement.problem.domain, 2.0)
    assert error["natural"] < 2.0 * error["open"]


def mixed(boundary):
    """Two classes of several sizes, ranges and listed areas on different densities, with an obstacle, apart from each other."""
    trees = [esh.Size("l", area=3.0, count=50), esh.Size("s", area=(0.2, 1.5), count=200, distribution="uniform")]
    listed = esh.Size("listed", area=(0.1, 2.0), count=30, distribution=np.geomspace(0.1, 2.0, 30))
    box = esh.Footprint.rectangle(1.4, 0.6)
    stones = [listed, esh.Size("boxes", footprint=box, count=40)]
    left = np.linspace(1.0, 0.0, 50, dtype=np.float32)[None]
    return esh.Problem(
        esh.Domain((50.0, 30.0), boundary),
        [esh.BodyClass("tree", trees, density=left), esh.BodyClass("stone", stones, density=LAKE)],
        obstacles=[esh.Obstacle(disc=(12.0, 8.0, 4.0))],
        avoid_overlap=True,
        seed=3,
    )


def test_counts_areas_and_obstacles_are_as_asked():
    placement = esh.solve(mixed("natural"), device="cpu")
    counts = [[size.placed for size in c.sizes] for c in placement.report.classes]
    assert counts == [[50, 200], [30, 40]]
    assert placement.report.overlaps == 0
    np.testing.assert_array_equal(placement.area, mixed("open").body_areas())
    assert (placement.position >= 0.0).all() and (placement.position <= [50.0, 30.0]).all()
    assert np.hypot(*(placement.position - [12.0, 8.0]).T).min() > 4.0
    assert all(c.coverage_error < 0.1 for c in placement.report.classes)
    assert "natural" in repr(placement.problem.domain)


@pytest.mark.parametrize("count", [1, 2, 5, 40])
@pytest.mark.parametrize("image", [UNIFORM, DISC])
def test_a_few_bodies(count, image):
    placement = esh.solve(problem_of("natural", image, count), device="cpu")
    assert placement.position.shape == (count, 2) and np.isfinite(placement.position).all()
    if image is DISC:
        assert (np.hypot(*(placement.position - 0.5 * SIDE).T) < 0.41 * SIDE).all()


def test_whoever_watches_sees_as_many_as_asked_and_can_stop():
    seen = []

    def watch(progress):
        seen.append(progress.position)
        return progress.step < 4

    placement = esh.solve(problem_of("natural", count=300), device="cpu", progress=watch)
    assert [position.shape for position in seen] == [(300, 2)] * 4 and placement.report.steps == 4
    for position in seen:
        assert (position >= 0.0).all() and (position <= SIDE).all()


def test_steps_edits_and_states_go_on_from_what_was_cut():
    problem = problem_of("natural", HILLS, 600)
    with esh.Solver(problem, device="cpu") as solver:
        solver.step(30)
        before = solver.placement()
        assert len(before.position) == 600 and solver.state.steps == 30
        again = solver.placement()
        np.testing.assert_array_equal(before.position, again.position)
        solver.step(2)
        after = solver.placement()
        assert solver.state.steps == 32
        moved = np.hypot(*(after.position - before.position).T)
        assert 0.0 < moved.mean() < 0.5 * SIDE / math.sqrt(600)
        state = solver.state.copy()
        solver.edit(problem_of("natural", HILLS, 650))
        edited = solver.placement()
        assert len(edited.position) == 650 and np.isin(after.id, edited.id).all()
    with esh.Solver(problem, device="cpu", state=state) as other:
        np.testing.assert_array_equal(other.placement().position, after.position)


def test_rare_classes_are_kept_even():
    sizes = [[esh.Size("s", area=0.1, count=count)] for count in (2000, 100)]
    classes = [esh.BodyClass(name, own) for name, own in zip("ab", sizes, strict=True)]
    placement = esh.solve(esh.Problem(esh.Domain((SIDE, SIDE), "natural"), classes), device="cpu")
    assert [c.sizes[0].placed for c in placement.report.classes] == [2000, 100]
    assert placement.report.classes[1].smallest_spacing > 0.5 and placement.report.classes[1].coverage_error < 0.05


def test_margins_are_whole_pixels_of_all_images():
    """The density within the border is what was asked for, pixel by pixel, and beyond it that of the nearest pixel."""
    from esh.engine.device.devices import resolve_device
    from esh.engine.device.launcher import Launcher

    rng = np.random.default_rng(5)
    images = [rng.random((7, 12)).astype(np.float32) + 0.1, rng.random((21, 5)).astype(np.float32) + 0.1, UNIFORM]
    classes = [
        esh.BodyClass(name, [esh.Size("s", area=0.1, count=100)], density=image)
        for name, image in zip("abc", images, strict=True)
    ]
    launcher = Launcher(resolve_device("cpu"))
    problem = esh.Problem(esh.Domain((20.0, 30.0), "natural"), classes)
    larger = NaturalBorder(launcher, problem).problem
    launcher.close()
    margin = 0.5 * (np.array(larger.domain.size) - [20.0, 30.0])
    assert (margin >= 5.0 * math.sqrt(600.0 / 300)).all()
    for asked, made in zip(problem.classes, larger.classes, strict=True):
        height, width = made.density_image.shape
        inner = [
            round(float(many) * m / whole, 6)
            for many, m, whole in zip((width, height), margin, larger.domain.size, strict=True)
        ]
        assert all(number == int(number) for number in inner)
        columns, rows = (slice(int(number), -int(number)) for number in inner)
        within = made.density_image[rows, columns]
        times = [n // own for n, own in zip(within.shape, asked.density_image.shape, strict=True)]
        np.testing.assert_array_equal(within, np.kron(asked.density_image, np.ones(times, np.float32)))
        assert made.density_image[rows.start - 1, columns.start - 1] == asked.density_image[0, 0]
        ratio = made.density_image.sum() / within.sum()
        assert made.body_count == round(100 * float(ratio))


def test_images_whose_pixels_do_not_fit_each_other_stay_small():
    """384 and 408 pixels have no margin of whole ones in common but for 17 times as many."""
    from esh.engine.device.devices import resolve_device
    from esh.engine.device.launcher import Launcher
    from esh.engine.space.images_beyond import AxisBeyond, density_beyond

    image = np.random.default_rng(2).random((384, 360)).astype(np.float32) + 0.2
    image[100:150, 40:90] = 0.0
    along = [AxisBeyond(20.0 * 120 / 408, 408, 120), AxisBeyond(20.0 * 124 / 372, 372, 124)]
    assert [axis.finer(count) for axis, count in zip(along, image.shape, strict=True)] == [17, 1]
    size = 20.0 + 2.0 * along[1].margin, 20.0 + 2.0 * along[0].margin
    launcher = Launcher(resolve_device("cpu"))
    made = density_beyond(launcher, image, along, 4.0, size, {})
    launcher.close()
    rows, columns = (
        axis.beyond * n // (axis.pixels + 2 * axis.beyond) for axis, n in zip(along, made.image.shape, strict=True)
    )
    within = made.image[rows:-rows, columns:-columns]
    assert max(within.shape) <= 3 * 408
    at = [((np.arange(n) + 0.5) * own / n).astype(int) for n, own in zip(within.shape, image.shape, strict=True)]
    there = image[np.ix_(*at)] > 0.0
    np.testing.assert_array_equal(made.depth[rows:-rows, columns:-columns] > 0.0, there)
    assert within[there].mean() == pytest.approx(image[image > 0.0].mean(), rel=2e-3)


def with_lines(boundary, **more):
    """Sticks along a direction and sticks as they like, on a uniform density, with dots between them."""
    classes = [
        esh.BodyClass("along", [esh.Size("s", area=0.2, count=150, line=esh.Line(1.6, direction=0.5))]),
        esh.BodyClass(
            "any", [esh.Size("s", area=0.2, count=150, line=esh.Line(1.2, direction="none", straightness=0.3))]
        ),
        esh.BodyClass("dot", [esh.Size("s", area=0.1, count=200)], density=more.pop("density", UNIFORM)),
    ]
    return esh.Problem(esh.Domain((40.0, 30.0), boundary), classes, **{"seed": 2, **more})


@pytest.mark.parametrize("density", [UNIFORM, LAKE], ids=["turned", "straight"])
def test_lines_keep_their_directions_and_lengths(density):
    placement = esh.solve(with_lines("natural", density=density), device="cpu")
    along, bent = placement.class_index == 0, placement.class_index == 1
    away = np.abs((placement.angle[along] - 0.5 + 0.5 * math.pi) % math.pi - 0.5 * math.pi)
    assert np.median(away) < 0.1
    # From seed to seed, the mean of 150 differs by a twentieth.
    others = [esh.solve(with_lines("natural", density=density, seed=seed), device="cpu") for seed in (0, 1, 3)]
    lengths = [one.length[one.class_index == 0].mean() for one in (placement, *others)]
    assert np.mean(lengths) == pytest.approx(1.6, rel=0.1)
    assert np.abs(placement.bends[bent]).max() > 1e-3
    way = 0.5 * placement.length[:, None] * np.stack([np.cos(placement.angle), np.sin(placement.angle)], axis=1)
    for end in (placement.position[along] - way[along], placement.position[along] + way[along]):
        assert (end > -1e-3).all() and (end < np.array([40.0, 30.0]) + 1e-3).all()


@pytest.mark.parametrize(("count", "length"), [(30, 2.0), (400, 0.8)])
@pytest.mark.parametrize("others", [0, 500])
def test_lines_far_apart_keep_their_lengths(count, length, others):
    """What holds against their own charges, which is many times their length, made nothing of them once others were gone."""
    classes = [esh.BodyClass("log", [esh.Size("s", area=0.1, count=count, line=esh.Line(length, direction=0.7))])]
    if others:
        classes.append(esh.BodyClass("dot", [esh.Size("s", area=0.1, count=others)]))
    problem = esh.Problem(esh.Domain((40.0, 30.0), "natural"), classes, seed=1)
    with esh.Solver(problem, device="cpu") as solver:
        solver.run(100)
        for _ in range(2):
            placement = solver.placement()
            assert placement.length[placement.class_index == 0] == pytest.approx(np.full(count, length), rel=0.1)
            solver.edit(problem)


def test_lines_of_images_of_directions_and_lengths():
    """What is kept lies as the images say where it is, not where it was in the larger domain."""
    row, column = (np.indices((30, 40)) + 0.5) / [[[30]], [[40]]]
    size = esh.Size("s", area=0.05, count=500, line=esh.Line(0.4 + column, direction=math.pi * row))
    placement = esh.solve(
        esh.Problem(esh.Domain((40.0, 30.0), "natural"), [esh.BodyClass("a", [size])], seed=1), device="cpu"
    )
    asked = math.pi * (1.0 - placement.position[:, 1] / 30.0)
    assert np.median(np.abs((placement.angle - asked + 0.5 * math.pi) % math.pi - 0.5 * math.pi)) < 0.15
    assert np.corrcoef(placement.length, placement.position[:, 0])[0, 1] > 0.8


def test_fixed_bodies_stay_and_the_others_make_room():
    wall = np.stack([np.full(12, 20.0), np.linspace(4.0, 26.0, 12)], axis=1)
    classes = [esh.BodyClass("a", [esh.Size("s", area=1.0, count=300)])]
    fixed = esh.FixedBodies(wall, "a", "s", id=np.arange(100, 112))
    problem = esh.Problem(
        esh.Domain((40.0, 30.0), "natural"), classes, fixed=[fixed], include_fixed=True, avoid_overlap=True, seed=5
    )
    placement = esh.solve(problem, device="cpu")
    assert len(placement.position) == 300 and placement.report.overlaps == 0
    np.testing.assert_array_equal(placement.position[placement.fixed], wall)
    np.testing.assert_array_equal(placement.id[placement.fixed], np.arange(100, 112))
    others = placement.position[~placement.fixed]
    assert np.linalg.norm(others[:, None] - wall[None], axis=2).min() > 1.1


def test_outlines_of_every_body_are_those_that_were_asked_for():
    n = 120
    rng = np.random.default_rng(3)
    outlines = esh.Footprints(
        [esh.Footprint.rectangle(2.0, 0.6), esh.Footprint.disc(0.5)],
        variant=rng.integers(0, 2, n),
        scale=rng.uniform(0.7, 1.3, n),
        turn=rng.uniform(-3.0, 3.0, n),
    )
    classes = [esh.BodyClass("a", [esh.Size("s", footprint=outlines, count=n)])]
    placement = esh.solve(
        esh.Problem(esh.Domain((30.0, 20.0), "natural"), classes, avoid_overlap=True, seed=1), device="cpu"
    )
    np.testing.assert_array_equal(placement.variant, outlines.variant)
    np.testing.assert_allclose(placement.scale, outlines.scale)
    np.testing.assert_allclose(np.cos(placement.angle), np.cos(outlines.turn), atol=1e-5)
    assert placement.report.overlaps == 0


def test_bodies_that_start_somewhere_stay_beside_the_border(monkeypatch):
    """No descent is made of what is given up at once, and steps do not draw who stands beside the border into a row."""
    made = []
    create = Descent.__init__

    def counted(self, *args, **named):
        made.append(self)
        create(self, *args, **named)

    problem = problem_of("natural", HILLS, 600)
    placement = esh.solve(problem, device="cpu")
    with esh.Solver(problem, device="cpu") as solver:
        monkeypatch.setattr(Descent, "__init__", counted)
        solver.start_at(placement.position, identity=placement.id)
        assert len(made) == 1
        np.testing.assert_allclose(solver.placement().position, placement.position, atol=1e-4)
        solver.step(30)
        after = solver.placement().position
    depth, _ = depth_of("hills", placement.position)
    moved = np.hypot(*(after - placement.position).T)
    assert moved[depth < 0.5].max() < 0.05 < moved.max()


def test_lines_start_where_they_are_put():
    problem = with_lines("natural")
    placement = esh.solve(problem, device="cpu", max_steps=20)
    for length in (placement.length, None):
        with esh.Solver(problem, device="cpu") as solver:
            solver.start_at(placement.position, angle=placement.angle, length=length)
            after = solver.placement()
        np.testing.assert_allclose(after.position, placement.position, atol=1e-4)
        lines = placement.class_index < 2
        np.testing.assert_allclose(np.cos(2.0 * after.angle[lines]), np.cos(2.0 * placement.angle[lines]), atol=1e-4)


def test_an_edit_keeps_who_stands_beside_the_border():
    """Strokes within, one after the other: whoever stands at the border stays, and nobody joins them in a row."""
    row, column = np.indices((64, 64)) / 64.0
    with esh.Solver(problem_of("natural", count=2048), device="cpu") as solver:
        solver.run(60)
        before = solver.placement()
        for k in range(6):
            near = np.hypot(column - 0.3 - 0.08 * k, row - 0.5) < 0.12
            solver.edit(problem_of("natural", np.where(near, 2.0, 1.0).astype(np.float32), 2048 + 40))
        after = solver.placement()
    _, i, j = np.intersect1d(before.id, after.id, return_indices=True)
    depth, _ = depth_of("square", before.position[i])
    spacing = SIDE / math.sqrt(2048)
    moved = np.hypot(*(after.position[j] - before.position[i]).T)
    assert (moved[depth < spacing] < 0.1 * spacing).mean() > 0.98
    assert (moved < 0.25 * spacing).mean() > 0.7


def test_strokes_across_the_border_leave_no_close_pairs_there():
    """Whoever is set down beside the border moves, too."""
    row, column = np.indices((128, 128)) / 128.0
    density = np.ones((128, 128), np.float32)
    with esh.Solver(problem_of("natural", density, 1500), device="cpu") as solver:
        solver.run(40)
        for k in range(4):
            density = np.where(np.hypot(column - 0.2 - 0.15 * k, row - 0.05) < 0.12, 3.0, density).astype(np.float32)
            solver.edit(problem_of("natural", density, round(1500 * float(density.mean()))))
        position = solver.placement().position
    spacing = SIDE / math.sqrt(3.0 * 1500)
    painted = position[(position[:, 1] > SIDE - spacing) & (np.abs(position[:, 0] - 0.42 * SIDE) < 0.25 * SIDE)]
    away = np.linalg.norm(painted[:, None] - position[None], axis=2)
    nearest = np.sort(away, axis=1)[:, 1] / spacing
    assert len(painted) > 15
    assert nearest.min() > 0.35
    assert (nearest < 0.6).mean() < 0.1


def test_around_a_small_spot_there_are_not_millions_of_bodies():
    y, x = np.mgrid[:200, :200]
    spot = (np.hypot(x - 60, y - 100) < 4.0).astype(float)
    size = esh.Size("s", 1e-6, 400)
    problem = esh.Problem(esh.Domain((10.0, 10.0), "natural"), [esh.BodyClass("a", [size], spot)])
    with esh.Solver(problem, device="cpu") as solver:
        assert solver.descent.model.body_count < 20 * 400
        solver.run(60)
        placement = solver.placement()
    assert len(placement.position) == 400
    away = np.hypot(*(placement.position - (3.025, 4.975)).T)
    assert away.max() < 0.23
    apart = np.linalg.norm(placement.position[:, None] - placement.position[None], axis=2) + 9.0 * np.eye(400)
    assert apart.min() > 0.4 * np.sqrt(100.0 * spot.mean() / 400)


def test_along_a_long_strip_there_are_not_hundreds_of_thousands_of_bodies(monkeypatch):
    """The strip was turned, and bodies were placed in the rectangle around it: 351 were among 900,000."""
    placed = []
    made = Descent.__init__

    def counted(self, model, *arguments, **more):
        placed.append(model.body_count)
        made(self, model, *arguments, **more)

    monkeypatch.setattr(Descent, "__init__", counted)
    body_class = esh.BodyClass("a", [esh.Size("s", area=1.0, count=351)])
    problem = esh.Problem(esh.Domain((10_000.0, 1.0), "natural"), [body_class])
    placement = esh.solve(problem, device="cpu", max_steps=20)
    assert max(placed) < 100 * 351 and len(placement.position) == 351
    assert (placement.position >= 0.0).all() and (placement.position <= problem.domain.size).all()


@pytest.mark.parametrize("seed", range(3))
def test_halves_that_an_isthmus_joins_have_as_many_as_they_ask_for(seed):
    """A border that keeps those that lie deepest left three or four bodies too many in one of them, for good."""
    x, y = (COLUMN + 0.5) * SIDE, (0.5 - ROW) * SIDE
    image = ((abs(x - 32.0) < 1.0) | (abs(y - 32.0) > 2.0)).astype(np.float32)
    errors = {}
    for boundary in ("open", "natural"):
        placement = esh.solve(problem_of(boundary, image, 3000, seed), device="cpu")
        errors[boundary] = coverage_error(placement.position, np.ones(3000), image, esh.Domain((SIDE, SIDE)), 2.0)
    below = int((placement.position[:, 1] < 0.5 * SIDE).sum())
    assert len(placement.position) == 3000 and abs(below - 1500) <= 2
    assert errors["natural"] < 2.0 * errors["open"]


def test_no_step_along_a_held_border_is_as_long_as_the_limit_for_all():
    """One of the last steps moved all bodies, by half a spacing: forces that are held have no energy, and no curvature to go by."""
    away, angle = np.hypot(COLUMN, ROW), np.arctan2(ROW, COLUMN)
    star = (away < 0.25 + 0.15 * np.cos(5.0 * angle)).astype(np.float32)
    placement = esh.solve(problem_of("natural", star, 700, 23), device="cpu")
    assert placement.report.coverage_error < 0.003
