"""Fixed bodies take part and do not move; obstacles keep bodies off; density beside both is as asked."""

from dataclasses import replace

import numpy as np
import pytest
from esh import (
    BodyClass,
    Domain,
    FixedBodies,
    Footprint,
    Line,
    Obstacle,
    Problem,
    ProblemError,
    Size,
    Solver,
    Surface,
    SurfaceMesh,
    solve,
)

WIDE = Domain((40.0, 20.0))


def solved(problem, steps=60):
    return solve(problem, device="cpu", max_steps=steps)


def counts_in_cells(position, size=5.0):
    return np.histogram2d(*position.T, bins=[8, 4], range=[[0, 40], [0, 20]])[0]


@pytest.fixture(scope="module")
def crowded():
    """200 bodies where 125 are asked for, at random, and 800 new ones."""
    at = np.random.default_rng(0).random((200, 2)) * 10.0
    problem = Problem(WIDE, [BodyClass("k", [Size("a", 0.5, 800)])], fixed=FixedBodies(at, angle=0.3), seed=3)
    return at, solved(problem)


def test_fixed_bodies_are_exactly_where_they_were(crowded):
    at, placement = crowded
    np.testing.assert_array_equal(placement.position[placement.fixed], at)
    assert (placement.angle[placement.fixed] == 0.3).all()
    assert placement.fixed.sum() == 200
    assert placement.id[placement.fixed].tolist() == list(range(200))
    size = placement.report.classes[0].sizes[0]
    assert (size.asked, size.placed, size.fixed) == (1000, 1000, 200)


def test_where_too_many_are_fixed_no_more_are_placed_and_others_do_not_shun_them(crowded):
    _, placement = crowded
    new = counts_in_cells(placement.position[~placement.fixed])
    assert new[:2, :2].max() == 0
    # 800 bodies on the 700 m² that are left, right up to the crowd.
    elsewhere = np.concatenate([new[2:].ravel(), new[:2, 2:].ravel()])
    assert abs(elsewhere - 800 / 28).max() <= 8
    assert elsewhere.std() < 3.0


def test_new_bodies_keep_away_from_fixed_ones():
    """As evenly as if all of them had been placed at once: where there are few, the density of both is that asked for."""
    at = np.random.default_rng(1).random((40, 2)) * [40.0, 20.0]
    near = np.linalg.norm(at[:, None] - at, axis=2) + 9.0 * np.eye(40)
    at = at[near.min(axis=1) > 1.5]
    problem = Problem(WIDE, [BodyClass("k", [Size("a", 0.5, 1000 - len(at))])], fixed=FixedBodies(at))
    placement = solved(problem)
    assert placement.report.smallest_spacing > 0.6
    assert placement.report.coverage_error < 0.02
    assert abs(counts_in_cells(placement.position) - 1000 / 32).max() <= 5


def test_classes_keep_away_from_fixed_bodies_of_others():
    """As far as new ones of both classes do, and not at all where they may overlap."""
    rock = BodyClass("rock", [Size("a", 0.5, 0)])
    moss = BodyClass("moss", [Size("a", 0.5, 960)])
    at = np.stack(np.meshgrid(np.arange(2.5, 40.0, 5.0), np.arange(2.5, 20.0, 4.0)), axis=2).reshape(-1, 2)
    spacing = np.sqrt(800.0 / 1000.0)

    def nearest(**more):
        placement = solved(Problem(WIDE, [rock, moss], fixed=FixedBodies(at, "rock"), **more))
        new = placement.position[~placement.fixed]
        return np.linalg.norm(at[:, None] - new, axis=2).min(axis=1) / spacing

    assert nearest().min() > 0.5
    from esh import Balance

    assert nearest(balance=Balance(non_overlap=np.eye(2))).min() < 0.3


def test_footprints_are_pushed_off_fixed_ones_which_may_overlap_each_other():
    at = np.array([[10.0, 10.0], [10.5, 10.0], [30.0, 5.0]])
    sizes = [Size("small", 0.5, 700), Size("large", 20.0, 1)]
    problem = Problem(WIDE, [BodyClass("k", sizes)], fixed=FixedBodies(at, "k", "large"), avoid_overlap=True, seed=2)
    placement = solved(problem)
    assert placement.report.overlaps == 0
    radius = np.sqrt(20.0 / np.pi) + np.sqrt(0.5 / np.pi)
    small = placement.position[placement.size_index == 0]
    assert np.linalg.norm(small[:, None] - at, axis=2).min() > radius * (1 - 2e-4)
    np.testing.assert_array_equal(placement.position[placement.fixed], at)


def test_fixed_lines_keep_angle_and_length():
    size = Size("stick", 0.3, 60, line=Line(2.0, "none"))
    fixed = FixedBodies([[5.0, 5.0], [20.0, 10.0]], angle=[0.4, -0.2], length=[3.0, np.nan])
    placement = solved(Problem(WIDE, [BodyClass("k", [size])], fixed=fixed), 30)
    assert placement.angle[placement.fixed].tolist() == [0.4, -0.2]
    np.testing.assert_allclose(placement.length[placement.fixed], [3.0, 2.0], rtol=1e-6)
    np.testing.assert_array_equal(placement.position[placement.fixed], fixed.position)
    assert np.ptp(placement.length[~placement.fixed]) > 0.0


def test_fixed_lines_do_not_make_others_longer():
    fixed = FixedBodies(np.stack(np.meshgrid(np.arange(1.0, 20.0, 2.0), np.arange(1.0, 12.0, 2.0)), -1).reshape(-1, 2))
    size = Size("line", area=0.4, count=240, line=Line(length=1.0, direction=0.0))
    placement = solve(Problem(Domain((20.0, 12.0)), [BodyClass("a", [size])], fixed=fixed), device="cpu")
    # A fifth of all lines keep their lengths; the mean of the others is as asked.
    assert placement.fixed.sum() == 60
    assert placement.length[~placement.fixed].mean() == pytest.approx(1.0, rel=0.02)


def test_fixed_bodies_stay_where_their_class_has_no_density():
    """There they are neither moved nor attract others' share: the rest follows its density as it would without them."""
    density = np.zeros((20, 40))
    density[:, 20:] = 1.0
    at = np.random.default_rng(4).random((150, 2)) * [15.0, 20.0]
    problem = Problem(WIDE, [BodyClass("k", [Size("a", 0.5, 600)], density)], fixed=FixedBodies(at))
    placement = solved(problem)
    np.testing.assert_array_equal(placement.position[placement.fixed], at)
    new = placement.position[~placement.fixed]
    assert new[:, 0].min() >= 20.0
    assert abs(counts_in_cells(new)[4:] - 600 / 16).max() <= 8


def test_problems_with_fixed_bodies_give_the_same_bytes_on_any_number_of_threads(monkeypatch):
    at = np.random.default_rng(5).random((300, 2)) * [40.0, 20.0]
    problem = Problem(
        WIDE,
        [BodyClass("k", [Size("a", (0.2, 0.5), 700)])],
        fixed=FixedBodies(at),
        obstacles=[Obstacle(disc=(20, 10, 4))],
        avoid_overlap=True,
    )
    positions = []
    for threads in ("1", "3"):
        monkeypatch.setenv("ESH_THREADS", threads)
        positions.append(solved(problem, 10).position)
    np.testing.assert_array_equal(*positions)


POND = Obstacle(disc=(12.0, 10.0, 5.0), margin=0.5)
HOUSE = Obstacle(polygon=[[22, 3], [38, 3], [38, 9], [30, 9], [30, 17], [22, 17]])


@pytest.fixture(scope="module")
def around():
    problem = Problem(WIDE, [BodyClass("k", [Size("a", 0.2, 900)])], obstacles=[POND, HOUSE])
    return solved(problem, 100)


def from_house(position):
    """Distance from the L of two boxes, 0 inside."""
    boxes = [((22, 3), (38, 9)), ((22, 3), (30, 17))]
    return np.min(
        [np.linalg.norm(np.maximum(np.maximum(a - position, position - b), 0), axis=1) for a, b in np.array(boxes)],
        axis=0,
    )


def test_no_body_is_on_an_obstacle_or_in_its_margin(around):
    assert (np.linalg.norm(around.position - [12.0, 10.0], axis=1) >= 5.5).all()
    assert (from_house(around.position) > 0.0).all()


def test_density_beside_obstacles_is_as_asked(around):
    """No hedge: what the obstacles take is spread over all of the rest."""
    free = 800.0 - np.pi * 5.5**2 - (16 * 6 + 8 * 8)
    density = 900.0 / free
    away = np.linalg.norm(around.position - [12.0, 10.0], axis=1) - 5.5
    for low, high in ((0.0, 1.0), (0.0, 2.0), (1.0, 3.0)):
        ring = np.pi * ((5.5 + high) ** 2 - (5.5 + low) ** 2)
        count = ((away >= low) & (away < high)).sum()
        assert count / ring == pytest.approx(density, rel=0.15)
    # As even as in an open field.
    assert around.report.coverage_error < 0.012
    assert around.report.smallest_spacing > 0.6


def test_footprints_keep_off_obstacles_where_overlap_is_avoided():
    sizes = [Size("small", 0.1, 400), Size("range", (0.5, 3.0), 60, line=None)]
    problem = Problem(WIDE, [BodyClass("k", sizes)], obstacles=[POND, HOUSE], avoid_overlap=True)
    placement = solved(problem)
    assert placement.report.overlaps == 0
    radius = np.sqrt(placement.area / np.pi)
    assert (np.linalg.norm(placement.position - [12.0, 10.0], axis=1) >= 5.5 + radius).all()
    assert (from_house(placement.position) >= radius).all()


def test_lines_keep_off_obstacles_with_both_ends():
    sizes = [Size("stick", 0.4, 150, line=Line(2.0, "none", width=0.2))]
    problem = Problem(WIDE, [BodyClass("k", sizes)], obstacles=[POND, HOUSE], avoid_overlap=True)
    placement = solved(problem)
    half = 0.5 * placement.length[:, None] * np.stack([np.cos(placement.angle), np.sin(placement.angle)], axis=1)
    for end in (placement.position - half, placement.position, placement.position + half):
        assert (np.linalg.norm(end - [12.0, 10.0], axis=1) > 5.5).all()
        assert (from_house(end) > 0.0).all()


@pytest.mark.parametrize("outline", [None, Footprint.rectangle(2.0, 0.3)])
@pytest.mark.parametrize("boundary", ["open", "natural"])
def test_lines_do_not_lie_across_posts_and_walls_that_are_thinner_than_they_are_long(outline, boundary):
    import shapely

    posts = [shapely.box(x, y, x + 0.1, y + 0.1) for x in np.arange(1.0, 11.0, 1.7) for y in np.arange(1.0, 11.0, 1.7)]
    things = [*posts, shapely.box(-1.0, 5.9, 13.0, 6.1)]
    size = Size("stick", 0.6, 60, line=Line(2.0 if outline is None else 1.7, "none", width=0.3), footprint=outline)
    if outline is not None:
        size = replace(size, area=None)
    obstacles = [Obstacle(polygon=list(thing.exterior.coords)[:-1]) for thing in things]
    problem = Problem(
        Domain((12.0, 12.0), boundary), [BodyClass("k", [size])], obstacles=obstacles, avoid_overlap=True, seed=1
    )
    placement = solved(problem, 100)
    for at, angle, length in zip(placement.position, placement.angle, placement.length, strict=True):
        along = 0.5 * length * np.array([np.cos(angle), np.sin(angle)])
        body = shapely.LineString([at - along, at + along]).buffer(0.15)
        if outline is not None:
            body = shapely.affinity.rotate(shapely.box(-1.0, -0.15, 1.0, 0.15), angle, (0, 0), use_radians=True)
            body = shapely.affinity.translate(body, *at)
        assert max(body.intersection(thing).area for thing in things) < 1e-4


def test_a_size_that_fits_nowhere_is_refused_by_name():
    sizes = [Size("small", 0.1, 5), Size("large", 900.0, 1)]
    problem = Problem(WIDE, [BodyClass("k", sizes)], obstacles=[POND, HOUSE], avoid_overlap=True)
    with pytest.raises(
        ProblemError, match=r'`obstacles` must leave room for size "large" of class "k", which keeps [0-9.]+ m away'
    ):
        Solver(problem, device="cpu")


def test_classes_whose_images_are_alike_ask_once_how_far_obstacles_are(monkeypatch):
    from esh.engine.model import supports

    asked, honest = [], supports.clearance

    def counted(*arguments):
        asked.append(arguments)
        return honest(*arguments)

    monkeypatch.setattr(supports, "clearance", counted)
    lake = [Obstacle(disc=(20.0, 10.0, 4.0), margin=0.5)]
    areas = (0.2, 0.9, 0.5)
    classes = [BodyClass(f"k{area}", [Size("a", area, 40)]) for area in areas]
    together = solved(Problem(WIDE, classes, obstacles=lake, avoid_overlap=True, seed=2), 10)
    assert len(asked) == 1
    away = np.hypot(*(together.position - (20.0, 10.0)).T) - np.sqrt(np.array(areas)[together.class_index] / np.pi)
    assert away.min() >= 4.5


@pytest.mark.parametrize("shape", ["rectangle", "ball"])
def test_that_fixed_bodies_alone_make_a_coverage_error_is_said(shape):
    """Large ones, or many in one place: a part of the error that stays wherever others are."""
    domain, at = WIDE, np.array([[10.0, 10.0], [30.0, 5.0]])
    if shape == "ball":
        trimesh = pytest.importorskip("trimesh")
        ball = trimesh.creation.icosphere(3, radius=8.0)
        domain, at = Surface(SurfaceMesh(ball.vertices, ball.faces)), np.array([[8.0, 0.0, 0.0], [0.0, 0.0, 8.0]])
    classes = [BodyClass("k", [Size("a", 0.5, 300)]), BodyClass("other", [Size("a", 0.5, 300)])]
    for area, beside, is_said in ((0.5, 1, False), (12.0, 1, True), (12.0, 2, True)):
        fixed = FixedBodies(at, "k", area=area)
        placements = [solved(Problem(domain, classes[:beside], fixed=fixed, seed=seed), 20) for seed in (0, 1)]
        for placement in placements:
            told = [note for note in placement.report.notes if "fixed bodies" in note]
            assert len(told) == is_said
            if told:
                of_class = ' of class "k"' if beside > 1 else ""
                assert told[0].startswith(
                    f"fixed bodies{of_class} are more than the density asks for where they are, wh"
                )
                part, error = float(told[0].split()[-1]), placement.report.classes[0].coverage_error
                assert 0.5 * error - 0.01 < part <= error
        notes = {note for placement in placements for note in placement.report.notes}
        assert len(notes) == is_said, "it does not depend on others"
