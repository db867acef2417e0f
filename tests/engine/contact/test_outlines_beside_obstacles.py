"""Outlines of any shape lie close to convex obstacles, are parted from them as from each other, and turn into the gaps between."""

import dataclasses
import time

import numpy as np
import pytest
import shapely
from esh import BodyClass, Domain, Footprint, Footprints, Line, Obstacle, Problem, Size, Solver, solve
from esh.engine.contact.separation import Separation
from esh.engine.problem.cover import cover_of
from shapely import affinity

SIDE = 20.0
PLANK = Footprint.rectangle(2.0, 0.3)
QUAD = Footprint.polygon([[-0.55, -0.32], [0.45, -0.32], [0.45, 0.08], [-0.35, 0.48]])
WALL = [[9.9, 0.0], [10.1, 0.0], [10.1, SIDE], [9.9, SIDE]]


def laid_out(placement, outline):
    """What lies where, as shapely's polygons."""
    shape = shapely.Polygon(outline.outline(32))
    return [
        affinity.translate(
            affinity.scale(affinity.rotate(shape, angle, (0, 0), use_radians=True), factor, factor, origin=(0, 0)), *at
        )
        for at, angle, factor in zip(placement.position, placement.angle, placement.scale, strict=True)
    ]


def overlaps(one, others):
    """How many of some polygons lie in others by more than is seen."""
    tree = shapely.STRtree(others)
    found = 0
    for shape in one:
        near = [others[k] for k in tree.query(shape) if others[k] is not shape]
        found += any(shape.intersection(o).area > 2e-4 * min(shape.area, o.area) for o in near)
    return found


def problem_of(outline, count, obstacles, boundary="open", seed=2, **footprints):
    size = Size("a", None, count, footprint=Footprints([outline], **footprints))
    domain = Domain((SIDE, SIDE), boundary)
    return Problem(domain, [BodyClass("k", [size])], avoid_overlap=True, obstacles=obstacles, seed=seed)


def convex_ones(kind):
    """Obstacles, and the ground that they take as polygons."""
    if kind == "posts":
        at = [(x, y) for x in np.arange(1.0, SIDE, 2.0) for y in np.arange(1.0, SIDE, 2.0)]
        return [Obstacle(disc=(x, y, 0.05)) for x, y in at], [shapely.Point(p).buffer(0.05, 64) for p in at]
    if kind == "wall with a margin":
        return [Obstacle(polygon=WALL, margin=0.3)], [shapely.Polygon(WALL).buffer(0.3, 64)]
    random = np.random.default_rng(1)
    corners = [random.uniform(0.0, SIDE, 2) + random.uniform(-1.5, 1.5, (3, 2)) for _ in range(30)]
    return [Obstacle(polygon=c) for c in corners], [shapely.Polygon(c) for c in corners]


@pytest.mark.parametrize("boundary", ["open", "periodic", "natural"])
@pytest.mark.parametrize("kind", ["posts", "wall with a margin", "triangles"])
@pytest.mark.parametrize("footprints", [{}, {"turn": "random", "scale_jitter": 0.3}], ids=["free", "given turns"])
def test_none_lies_in_an_obstacle_nor_in_another(kind, boundary, footprints):
    obstacles, ground = convex_ones(kind)
    placement = solve(problem_of(PLANK, 80, obstacles, boundary, **footprints), device="cpu")
    shapes = laid_out(placement, PLANK)
    assert overlaps(shapes, ground) == overlaps(shapes, shapes) == 0
    assert placement.report.overlaps == 0


@pytest.mark.parametrize("count", [90, 160])
def test_they_find_the_gaps_between_many_planks(count):
    """Where each kept the distance of a disc around it, there was room for hardly any of them."""
    ground = planks_on_the_ground()
    obstacles = [Obstacle(polygon=np.array(shape.exterior.coords)[:-1]) for shape in ground]
    placement = solve(problem_of(QUAD, count, obstacles), device="cpu")
    shapes = laid_out(placement, QUAD)
    assert overlaps(shapes, ground) == overlaps(shapes, shapes) == placement.report.overlaps == 0
    assert placement.report.coverage_error < 0.1


def test_a_second_scatter_fills_the_gaps_of_a_first_one():
    """Trees and logs stand already: pebbles that are pressed a little into each other between them find other gaps."""
    tree, log = Footprint.polygon(round_corners(0.4, 32)), Footprint.rectangle(1.6, 0.2)
    sizes = [Size(name, None, n, footprint=Footprints([one])) for name, n, one in (("t", 146, tree), ("l", 90, log))]
    first = solve(Problem(Domain((SIDE, SIDE)), [BodyClass("k", sizes)], avoid_overlap=True), device="cpu")
    standing = zip(laid_out(first, tree), laid_out(first, log), first.size_index, strict=True)
    ground = [as_log if number else as_tree for as_tree, as_log, number in standing]
    obstacles = [Obstacle(polygon=np.array(shape.exterior.coords)[:-1]) for shape in ground]
    pebble = Footprint.polygon(round_corners(0.3, 10))
    for seed, count in ((2, 460), (1, 500)):
        placement = solve(problem_of(pebble, count, obstacles, seed=seed, turn="random"), device="cpu")
        shapes = laid_out(placement, pebble)
        assert overlaps(shapes, ground) == overlaps(shapes, shapes) == placement.report.overlaps == 0


def test_long_ones_find_the_last_places_between_others():
    obstacles = [Obstacle(polygon=np.array(shape.exterior.coords)[:-1]) for shape in planks_on_the_ground()]
    size = Size("a", 0.6, 120, line=Line(1.7, "none", width=0.3), footprint=Footprints([PLANK]))
    problem = Problem(Domain((SIDE, SIDE)), [BodyClass("k", [size])], avoid_overlap=True, obstacles=obstacles, seed=2)
    assert solve(problem, device="cpu").report.overlaps == 0


def round_corners(radius, count):
    angle = 2.0 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def planks_on_the_ground():
    return laid_out(solve(problem_of(PLANK, 146, [], seed=1), device="cpu"), PLANK)


def test_they_lie_close_to_a_wall():
    """Free planks beside one turn along it; a disc around them would keep a meter away."""
    placement = solve(problem_of(PLANK, 300, [Obstacle(polygon=WALL)]), device="cpu")
    away = shapely.distance(np.array(laid_out(placement, PLANK)), shapely.Polygon(WALL))
    assert np.count_nonzero(away < 0.3) > 20
    assert placement.report.converged


def test_what_is_not_convex_keeps_the_distance_of_a_disc():
    corner = [[4.0, 4.0], [16.0, 4.0], [16.0, 6.0], [6.0, 6.0], [6.0, 16.0], [4.0, 16.0]]
    placement = solve(problem_of(PLANK, 200, [Obstacle(polygon=corner)]), device="cpu")
    assert overlaps(laid_out(placement, PLANK), [shapely.Polygon(corner)]) == 0
    assert shapely.distance(shapely.points(placement.position), shapely.Polygon(corner)).min() > PLANK.circumradius


def test_an_obstacle_far_larger_than_the_domain_is_met_as_well():
    half = [[-500.0, -500.0], [500.0, -500.0], [500.0, 5.0], [-500.0, 5.0]]
    placement = solve(problem_of(PLANK, 250, [Obstacle(polygon=half)]), device="cpu")
    shapes = laid_out(placement, PLANK)
    assert overlaps(shapes, [shapely.Polygon(half)]) == overlaps(shapes, shapes) == 0


def test_what_lies_just_beyond_the_border_is_met_by_those_that_reach_across_it():
    beyond = [[0.0, SIDE + 0.1], [SIDE, SIDE + 0.1], [SIDE, SIDE + 0.7], [0.0, SIDE + 0.7]]
    placement = solve(problem_of(PLANK, 150, [Obstacle(polygon=beyond)]), device="cpu")
    shapes = laid_out(placement, PLANK)
    assert any(shape.bounds[3] > SIDE for shape in shapes)
    assert overlaps(shapes, [shapely.Polygon(beyond)]) == placement.report.in_obstacles == 0
    assert placement.report.converged


@pytest.mark.parametrize("seed", [4, 7])
def test_obstacles_that_go_on_beyond_an_inset_border_are_no_jam(seed):
    """What does not move was counted among those that reach across it: runs were given up early, and the last bodies stayed there."""
    random = np.random.default_rng(seed)
    corners = [random.uniform(0.0, SIDE, 2) + random.uniform(-3.0, 3.0, (3, 2)) for _ in range(30)]
    obstacles = [Obstacle(polygon=WALL), *(Obstacle(polygon=c) for c in corners)]
    given = problem_of(QUAD, 260, obstacles, seed=seed, turn="random", scale_jitter=0.4)
    report = solve(dataclasses.replace(given, domain=Domain((SIDE, SIDE), inset=True)), device="cpu").report
    assert report.overlaps == report.beyond_border == report.in_obstacles == 0


def test_edits_part_them_as_well():
    obstacles, ground = convex_ones("triangles")
    solver = Solver(problem_of(PLANK, 80, []), device="cpu")
    solver.run(60)
    solver.separate()
    solver.edit(problem_of(PLANK, 80, obstacles))
    solver.run(60)
    solver.separate()
    shapes = laid_out(solver.placement(), PLANK)
    assert overlaps(shapes, ground) == overlaps(shapes, shapes) == 0


@pytest.mark.parametrize(
    ("corners", "convex"),
    [
        (WALL, True),
        (WALL[::-1], True),
        ([[0, 0], [1, 0], [2, 0], [2, 1], [0, 1]], True),
        ([[0, 0], [2, 0], [2, 2], [1, 0.5], [0, 2]], False),
        ([[0, 0], [2, 2], [2, 0], [0, 2]], False),
        ([[0, 0], [1, 0], [2, 0]], False),
    ],
    ids=["box", "clockwise", "corner on an edge", "notch", "crossing", "no inside"],
)
def test_only_convex_polygons_have_an_outline(corners, convex):
    outline = Obstacle(polygon=corners, margin=0.1).outline
    assert (outline is not None) == convex
    if convex:
        assert outline.area == pytest.approx(shapely.Polygon(corners).buffer(0.1, 64).area, rel=1e-3)


def test_round_polygons_of_many_corners_have_one_around_them():
    ring = np.array(shapely.Point(3.0, 2.0).buffer(1.0, 64).exterior.coords)[:-1]
    outline = shapely.Polygon(Obstacle(polygon=ring).outline.corners)
    assert outline.buffer(1e-9).contains(shapely.Polygon(ring))
    assert outline.area < 1.03 * shapely.Polygon(ring).area


def test_many_thin_gaps_are_found_in_little_time():
    """Gaps that are as narrow as a pixel of a density would be lost; and nobody tries a thousand places beside two hundred walls."""
    walls = [[[0.0, y], [50.0, y], [50.0, y + 0.05], [0.0, y + 0.05]] for y in np.arange(0.0, 50.0, 0.5)]
    size = Size("a", None, 1500, footprint=Footprints([Footprint.rectangle(0.5, 0.2)]))
    problem = Problem(
        Domain((50.0, 50.0)),
        [BodyClass("k", [size])],
        avoid_overlap=True,
        obstacles=[Obstacle(polygon=wall) for wall in walls],
    )
    start = time.process_time()
    report = solve(problem, device="cpu", max_steps=60).report
    assert report.clean and report.coverage_error < 0.1
    assert time.process_time() - start < 60.0


@pytest.mark.parametrize(("radius", "least", "most"), [(0.13, 0.9, 500), (0.15, 1.3, 150)])
def test_what_has_not_enough_room_between_others_is_given_up_soon(monkeypatch, radius, least, most):
    """As many pairs were left after 1,600 and 500 rounds; of 10,000 bodies such took a minute and a half."""
    at = [(x, y) for x in np.arange(0.625, SIDE, 1.25) for y in np.arange(0.625, SIDE, 1.25)]
    obstacles = [Obstacle(polygon=round_corners(0.5, 12) + place) for place in at]
    problem = problem_of(Footprint.polygon(round_corners(radius, 8)), 2500, obstacles, turn="random")
    cover = cover_of(problem)
    assert cover.covered > least * cover.fits
    rounds = []
    honest = Separation._find
    monkeypatch.setattr(Separation, "_find", lambda parting: rounds.append(1) or honest(parting))
    report = solve(problem, device="cpu").report
    assert len(rounds) < most
    assert report.overlaps > 1000 and any("still overlap" in note for note in report.notes)


@pytest.mark.parametrize("shape", [(37, 41), (64, 64)])
def test_discs_keep_off_the_squares_of_an_image_whose_pixels_are_others(shape):
    random = np.random.default_rng(3)
    image = random.random(shape) < 0.03
    rows, columns = np.nonzero(image)
    high, wide = SIDE / shape[0], SIDE / shape[1]
    ground = [
        shapely.box(c * wide, SIDE - (r + 1) * high, (c + 1) * wide, SIDE - r * high)
        for r, c in zip(rows, columns, strict=True)
    ]
    disc = Footprint.disc(0.4)
    placement = solve(problem_of(disc, 200, [Obstacle(image=image)]), device="cpu")
    away = shapely.distance(shapely.points(placement.position)[:, None], np.array(ground)[None])
    assert away.min() > disc.circumradius - 1e-6


def test_polygons_of_many_corners_are_measured_as_they_are():
    """They are parted by an outline around them, which is a little larger."""
    ring = np.array(shapely.Point(10.0, 10.0).buffer(3.0, 10).exterior.coords)[:-1]
    obstacle = Obstacle(polygon=ring)
    assert shapely.union_all([shapely.Polygon(p.corners) for p in obstacle.pieces]).area == pytest.approx(
        shapely.Polygon(ring).area, rel=1e-9
    )
    assert obstacle.outline.area > 1.001 * shapely.Polygon(ring).area


@pytest.mark.parametrize("direction", ["none", 0.4])
def test_long_bodies_with_an_axis_find_the_gaps_as_well(direction):
    """Where they start an axis lies across obstacles, and only turning and going elsewhere leads out."""
    planks = laid_out(solve(problem_of(PLANK, 146, [], seed=1), device="cpu"), PLANK)
    line = Line(1.7, direction, width=0.3)
    size = Size("a", 0.6, 80, line=line, footprint=Footprints([PLANK]))
    obstacles = [Obstacle(polygon=np.array(shape.exterior.coords)[:-1]) for shape in planks]
    problem = Problem(Domain((SIDE, SIDE)), [BodyClass("k", [size])], avoid_overlap=True, obstacles=obstacles, seed=2)
    placement = solve(problem, device="cpu")
    shapes = laid_out(placement, PLANK)
    assert overlaps(shapes, planks) == overlaps(shapes, shapes) == 0
    assert placement.report.clean


@pytest.mark.parametrize("boundary", ["open", "natural"])
@pytest.mark.parametrize("seed", range(3))
def test_long_bodies_with_an_axis_do_not_lie_across_the_end_of_a_road(boundary, seed):
    """Between it and the border axes had not grown: all seeds left a plank or more in the road, whose axis was beside it."""
    way = shapely.LineString([[1.8, 2.5], [7.0, 10.0], [12.0, 8.0], [18.2, 17.0]])
    pixels = 400
    middle = (np.arange(pixels) + 0.5) * SIDE / pixels
    x, y = np.meshgrid(middle, middle[::-1])
    image = shapely.distance(way, shapely.points(x, y)) < 1.2
    long = Footprint.rectangle(3.0, 0.3)
    size = Size("a", None, 70, line=Line(2.7, "none"), footprint=Footprints([long]))
    classes = [BodyClass("k", [size]), BodyClass("d", [Size("d", 0.4, 80)])]
    obstacles = [Obstacle(image=image)]
    problem = Problem(Domain((SIDE, SIDE), boundary), classes, avoid_overlap=True, obstacles=obstacles, seed=seed)
    placement = solve(problem, device="cpu")
    assert placement.report.in_obstacles == placement.report.overlaps == 0
    planks = placement.class_index == 0
    along = 1.5 * np.stack([np.cos(placement.angle), np.sin(placement.angle)], axis=1)[planks]
    at = placement.position[planks]
    lying = shapely.linestrings(np.stack([at - along, at + along], axis=1)).tolist()
    assert min(way.distance(one) for one in lying) > 1.2
    assert placement.length[planks].min() > 2.0
