"""What the report says of outlines in obstacles and across the border is what shapely counts."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from esh import BodyClass, Domain, FixedBodies, Footprint, Footprints, Line, Obstacle, Problem, Size, solve
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.quality.measurement import measure
from shapely import affinity

SIDE = 20.0
CORNER = [[4.0, 4.0], [16.0, 4.0], [16.0, 6.0], [6.0, 6.0], [6.0, 16.0], [4.0, 16.0]]
BOW = [[2.0, 2.0], [8.0, 8.0], [8.0, 2.0], [2.0, 8.0]]
WALL = [[9.9, 0.0], [10.1, 0.0], [10.1, SIDE], [9.9, SIDE]]
IMAGE = np.zeros((400, 400), bool)
IMAGE[100:140, 50:300] = IMAGE[300:303] = True
PIXEL = SIDE / 400.0
DRAWN = [
    shapely.box(50 * PIXEL, SIDE - 140 * PIXEL, 300 * PIXEL, SIDE - 100 * PIXEL),
    shapely.box(0.0, SIDE - 303 * PIXEL, SIDE, SIDE - 300 * PIXEL),
]
OBSTACLES = {
    "wall": (Obstacle(polygon=WALL), [shapely.Polygon(WALL)]),
    "corner": (Obstacle(polygon=CORNER), [shapely.Polygon(CORNER)]),
    "corner with a margin": (Obstacle(polygon=CORNER, margin=0.5), [shapely.Polygon(CORNER).buffer(0.5, 64)]),
    "bow, whose edges cross": (Obstacle(polygon=BOW), list(shapely.make_valid(shapely.Polygon(BOW)).geoms)),
    "disc": (Obstacle(disc=(5.0, 5.0, 2.0)), [shapely.Point(5.0, 5.0).buffer(2.0, 128)]),
    "image": (Obstacle(image=IMAGE), DRAWN),
    "image with a margin": (Obstacle(image=IMAGE, margin=0.3), [shape.buffer(0.3, 64) for shape in DRAWN]),
}
OUTLINES = {
    "plank": Footprint.rectangle(2.0, 0.3),
    "capsule": Footprint.capsule(1.5, 0.5),
    "disc": Footprint.disc(0.4),
    "off center": Footprint.polygon([[0.2, -0.5], [1.4, -0.3], [1.1, 0.8], [0.1, 0.6]], 0.1),
}


@pytest.fixture(scope="module")
def launcher():
    made = Launcher(resolve_device("cpu"))
    yield made
    made.close()


def strewn(problem, seed):
    """A placement whose bodies lie at random, and their outlines as shapely's polygons."""
    placement = solve(problem, device="cpu", max_steps=1)
    random = np.random.default_rng(seed)
    n = len(placement.position)
    placement = replace(placement, position=random.uniform(0.0, SIDE, (n, 2)), angle=random.uniform(-3.0, 3.0, n))
    shape = shapely.Polygon(problem.classes[0].sizes[0].footprint.outlines[0].outline(64))
    turned = [affinity.rotate(shape, angle, (0, 0), use_radians=True) for angle in placement.angle]
    return placement, [
        affinity.translate(one, *at) for one, at in zip(turned, placement.position.tolist(), strict=True)
    ]


def problem_of(outline, obstacles, boundary="open", inset=True, count=150):
    size = Size("a", None, count, footprint=Footprints([outline]))
    domain = Domain((SIDE, SIDE), boundary, inset=inset)
    return Problem(domain, [BodyClass("k", [size])], avoid_overlap=True, obstacles=obstacles)


@pytest.mark.parametrize("outline", OUTLINES.values(), ids=OUTLINES.keys())
@pytest.mark.parametrize("obstacle", OBSTACLES.values(), ids=OBSTACLES.keys())
def test_shapely_counts_as_many(launcher, obstacle, outline):
    given, ground = obstacle
    placement, shapes = strewn(problem_of(outline, [given]), seed=4)
    report = measure(placement, launcher)

    def inside(smaller):
        """Of outlines that are so much smaller: an image's pixels are obstacles where their middles are."""
        shrunk = [shape.buffer(-smaller) for shape in shapes]
        return sum(any(s.intersection(g).area > 1e-4 * min(s.area, g.area) for g in ground) for s in shrunk)

    if given.image is None:
        assert report.in_obstacles == inside(0.0) > 0
    else:
        assert inside(0.75 * PIXEL) <= report.in_obstacles <= inside(0.0)
    across = [max(-s.bounds[0], -s.bounds[1], s.bounds[2] - SIDE, s.bounds[3] - SIDE, 0.0) for s in shapes]
    assert report.beyond_border == np.count_nonzero(np.array(across) > 1e-3 * outline.width) > 0
    assert report.farthest_beyond_border == pytest.approx(max(across), abs=1e-3)
    assert not report.clean
    assert any("in obstacles" in note for note in report.notes)
    assert any("across the border" in note for note in report.notes)


def test_the_depth_is_the_shortest_way_out(launcher):
    problem = problem_of(Footprint.disc(0.5), [Obstacle(disc=(10.0, 10.0, 1.0), margin=0.2)], count=2)
    placement = solve(problem, device="cpu", max_steps=1)
    report = measure(replace(placement, position=np.array([[11.3, 10.0], [3.0, 3.0]])), launcher)
    assert (report.in_obstacles, report.beyond_border) == (1, 0)
    assert report.deepest_in_obstacle == pytest.approx(0.4)
    assert report.notes == (
        "1 body lies in obstacles, the deepest by 0.4 m; take more steps, or lower the counts or the areas",
    )


def test_in_a_periodic_domain_obstacles_go_on_at_the_other_side(launcher):
    """Of a polygon and of an image."""
    image = np.zeros((40, 40), bool)
    image[:, -2:] = True
    for obstacle in (Obstacle(polygon=[[19.0, 0.0], [20.5, 0.0], [20.5, 20.0], [19.0, 20.0]]), Obstacle(image=image)):
        problem = problem_of(OUTLINES["plank"], [obstacle], "periodic", inset=False, count=2)
        placement = solve(problem, device="cpu", max_steps=1)
        beside = replace(placement, position=np.array([[0.9, 10.0], [5.0, 10.0]]), angle=np.zeros(2))
        assert measure(beside, launcher).in_obstacles == 1
        away = replace(placement, position=np.array([[1.6, 10.0], [5.0, 10.0]]), angle=np.zeros(2))
        assert measure(away, launcher).in_obstacles == 0


def test_bent_lines_count_as_they_are_bent(launcher):
    line = Line(3.0, "none", width=0.2, charges=9, straightness=0.2)
    problem = Problem(
        Domain((SIDE, SIDE)),
        [BodyClass("k", [Size("a", 0.5, 1, line=line)])],
        avoid_overlap=True,
        obstacles=[Obstacle(disc=(10.0, 10.6, 0.2))],
    )
    placement = solve(problem, device="cpu", max_steps=1)
    along = np.linspace(-1.5, 1.5, placement.bends.shape[1])
    for height, count in ((0.0, 0), (0.5, 1)):
        points = np.stack([along, height * (1.0 - (along / 1.5) ** 2)], axis=1) + [10.0, 10.0]
        bent = replace(placement, position=np.array([[10.0, 10.0]]), angle=np.zeros(1), bends=points[None])
        assert measure(bent, launcher).in_obstacles == count


def test_fixed_bodies_do_not_count_but_those_that_overlap_each_other_are_told():
    fixed = FixedBodies([[5.0, 5.0], [5.5, 5.0], [12.0, 12.0]], 0, 0)
    size = Size("a", None, 20, footprint=Footprints([Footprint.disc(0.5)]))
    problem = Problem(
        Domain((SIDE, SIDE), inset=True),
        [BodyClass("k", [size])],
        avoid_overlap=True,
        obstacles=[Obstacle(disc=(12.0, 12.0, 1.0))],
        fixed=fixed,
    )
    report = solve(problem, device="cpu").report
    assert report.clean and report.converged and report.fixed_overlaps == 1
    assert report.notes == (
        "1 pair of fixed bodies overlaps each other, the deepest by 0.5 m: they stay where they are",
        "1 fixed body lies in obstacles, by 1.5 m: it stays where it is",
    )


def test_fixed_bodies_out_of_place_are_told(launcher):
    """In a disc, in an image, and across the border; what moves is away from all of them."""
    image = np.zeros((40, 40), bool)
    image[:, 20:24] = True
    given = problem_of(Footprint.disc(0.5), [Obstacle(disc=(5.0, 10.0, 1.0)), Obstacle(image=image)], count=1)
    fixed = FixedBodies([[6.2, 10.0], [11.0, 3.0], [0.3, 15.0], [16.0, 16.0]])
    placement = solve(replace(given, fixed=fixed), device="cpu", max_steps=1)
    moved = placement.position.copy()
    moved[~placement.fixed] = [16.0, 5.0]
    report = measure(replace(placement, position=moved), launcher)
    assert report.clean and (report.in_obstacles, report.beyond_border) == (0, 0)
    told, across = report.notes
    assert told.startswith("2 fixed bodies lie in obstacles, the deepest by 0.3")
    assert across == "1 fixed body reaches across the border, by 0.2 m: it stays where it is"


def test_where_too_much_is_asked_for_more_steps_are_not_advised(launcher):
    disc = Obstacle(disc=(10.0, 10.0, 2.0))
    for count, advised in ((20, True), (800, False)):
        placement = solve(problem_of(Footprint.disc(0.5), [disc], count=count), device="cpu", max_steps=1)
        within = replace(placement, position=np.full_like(placement.position, 10.0))
        (note,) = [note for note in measure(within, launcher).notes if "in obstacles" in note]
        assert ("more steps" in note) == advised and "lower the counts" in note


def test_where_footprints_may_overlap_nothing_is_out_of_place(launcher):
    classes = problem_of(OUTLINES["plank"], []).classes
    problem = Problem(Domain((SIDE, SIDE)), classes, avoid_overlap=False, obstacles=[Obstacle(polygon=WALL)])
    placement, _ = strewn(problem, seed=1)
    report = measure(placement, launcher)
    assert (report.in_obstacles, report.beyond_border) == (0, 0)
