"""A coverage error counts the ground that large bodies take from small ones as that of obstacles."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
import trimesh
from esh import (
    Balance,
    BodyClass,
    Domain,
    Footprint,
    Footprints,
    Line,
    Problem,
    Size,
    Surface,
    SurfaceMesh,
    solve,
)
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.problem.placement_footprints import footprints_of_placement
from esh.engine.quality.groups_by_area import groups_by_area
from esh.engine.quality.taken_ground import taken_ground

SIDE, SMALL = 20.0, 0.1


@pytest.fixture(params=["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])
def launcher(request):
    made = Launcher(resolve_device(request.param))
    yield made
    made.close()


def among(large, domain=None, *, apart=True, **settings):
    tufts = BodyClass("tuft", [Size("s", math.pi * SMALL**2, 600)])
    classes = [BodyClass("large", [large], **settings), tufts]
    return Problem(domain or Domain((SIDE, SIDE)), classes, avoid_overlap=apart)


def taken_from(placement, launcher, group):
    area = placement.area
    groups = groups_by_area(placement, area)
    return taken_ground(placement, launcher, groups, group, area, footprints_of_placement(placement))


def as_capsule(outline, position, angle, *, factor=1.0, away=0.0):
    """The capsule of an outline's width and area about its middle, as a polygon."""
    low, high = outline.corners.min(axis=0), outline.corners.max(axis=0)
    half = 0.5 * (outline.area - 0.25 * math.pi * outline.width**2) / outline.width
    ends = 0.5 * (low + high) + np.array([[-half, 0.0], [half, 0.0]])
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    return shapely.LineString(position + factor * ends @ turn).buffer(0.5 * factor * outline.width + away)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize(("room", "gap"), [(1.0, 0.0), (1.3, 0.4)])
def test_in_a_rectangle_it_is_that_of_outlines_where_they_lie(launcher, periodic, room, gap):
    outline = Footprint(np.array([[0.5, -0.4], [4.0, -0.4], [4.0, 0.4], [0.5, 0.4]]))
    large = Size("s", None, 8, footprint=Footprints([outline], turn="random", scale_jitter=0.3))
    problem = among(large, Domain((SIDE, SIDE), "periodic" if periodic else "open"), room=room, gap=gap)
    placement = solve(problem, device="cpu", max_steps=20)
    taken = taken_from(placement, launcher, 1)
    free = taken.in_cells(problem.rectangle, (400, 400))
    own = placement.class_index == 0
    poses = zip(placement.position[own], placement.angle[own], placement.scale[own], strict=True)
    away = 0.5 * gap + SMALL
    shapes = [as_capsule(outline, p, a, factor=f * room, away=away) for p, a, f in poses]
    shifts = [(x, y) for x in (-SIDE, 0.0, SIDE) for y in (-SIDE, 0.0, SIDE)] if periodic else [(0.0, 0.0)]
    union = shapely.union_all([shapely.affinity.translate(s, *shift) for s in shapes for shift in shifts])
    middle = (np.arange(400) + 0.5) * SIDE / 400
    expected = shapely.contains_xy(union, *np.meshgrid(middle, middle))
    assert expected.mean() > 0.05
    assert np.mean((free == 0.0) != expected) < 0.002


def test_lines_are_capsules_as_they_came_to_be(launcher):
    line = Size("s", 1.0, 10, line=Line(length=3.0, direction="none", width=0.4))
    placement = solve(among(line), device="cpu", max_steps=20)
    free = taken_from(placement, launcher, 1).in_cells(placement.problem.rectangle, (400, 400))
    own = placement.class_index == 0
    along = np.stack([np.cos(placement.angle[own]), np.sin(placement.angle[own])], axis=1)
    half, middle = 0.5 * placement.length[own, None] * along, placement.position[own]
    ends = np.stack([middle - half, middle + half], axis=1)
    union = shapely.union_all(shapely.buffer(shapely.linestrings(ends), 0.5 * placement.width[own] + SMALL))
    at = (np.arange(400) + 0.5) * SIDE / 400
    assert np.mean((free == 0.0) != shapely.contains_xy(union, *np.meshgrid(at, at))) < 0.002


def test_on_a_surface_it_is_the_same_as_in_the_plane(launcher):
    corners = np.array([[0.0, 0.0, 0.0], [SIDE, 0.0, 0.0], [SIDE, SIDE, 0.0], [0.0, SIDE, 0.0]])
    two_sided = np.array([[0, 1, 2], [0, 2, 3]])
    surface = Surface(SurfaceMesh(corners, two_sided))
    for large in (
        Size("s", None, 8, footprint=Footprints([Footprint.rectangle(4.0, 0.8)], turn="random")),
        Size("s", 1.0, 8, line=Line(length=3.0, direction="none", width=0.4)),
    ):
        placement = solve(among(large, surface), device="cpu", max_steps=20)
        own = placement.class_index == 0
        along = placement.tangent[own, :2]
        flat = replace(
            placement,
            problem=among(large),
            position=placement.position[:, :2],
            angle=np.where(own, np.pad(np.arctan2(*along.T[::-1]), (0, int((~own).sum()))), 0.0),
            normal=None,
            tangent=None,
            triangle=None,
            barycentric=None,
            mesh=None,
        )
        free = taken_from(flat, launcher, 1).in_cells(flat.problem.rectangle, (800, 800))
        points = surface.sample()
        cell = np.minimum((points.position[:, :2] / SIDE * 800).astype(int), 799)
        found = taken_from(placement, launcher, 1).at(points)
        assert 0.02 < np.mean(found == 0.0) < 0.5
        assert np.mean(found != free[cell[:, 1], cell[:, 0]]) < 0.005


def test_what_stands_on_the_other_side_of_a_board_takes_nothing(launcher):
    board = trimesh.creation.box((SIDE, SIDE, 0.05))
    placement = solve(among(Size("s", 4.0, 4), Surface(SurfaceMesh(board.vertices, board.faces))), device="cpu")
    taken = taken_from(placement, launcher, 1)
    points = placement.problem.domain.sample()
    own = placement.class_index == 0
    for up in (1.0, -1.0):
        on_side = points.normal[:, 2] * up > 0.5
        stand = np.count_nonzero(placement.normal[own, 2] * up > 0.5)
        share = np.count_nonzero(taken.at(points)[on_side] == 0.0) / np.count_nonzero(on_side)
        assert share == pytest.approx(stand * math.pi * (math.sqrt(4.0 / math.pi) + SMALL) ** 2 / SIDE**2, rel=0.1)


def test_what_stands_on_a_shelf_takes_nothing_of_the_next_one(launcher):
    corners = np.array([[0.0, 0.0, 0.0], [SIDE, 0.0, 0.0], [SIDE, SIDE, 0.0], [0.0, SIDE, 0.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    shelves = Surface(
        SurfaceMesh(
            np.vstack([corners, corners + [0.0, 0.0, 0.5]]),
            np.vstack([triangles, triangles + 4]),
        )
    )
    placement = solve(among(Size("s", 4.0, 8), shelves), device="cpu", max_steps=20)
    points, own = shelves.sample(), placement.class_index == 0
    free = taken_from(placement, launcher, 1).at(points)
    for low, high in ((-0.1, 0.1), (0.4, 0.6)):
        here = (points.position[:, 2] > low) & (points.position[:, 2] < high)
        stand = placement.position[own]
        stand = stand[(stand[:, 2] > low) & (stand[:, 2] < high), :2]
        away = np.linalg.norm(points.position[here, None, :2] - stand, axis=2).min(axis=1, initial=np.inf)
        expected = away >= math.sqrt(4.0 / math.pi) + SMALL
        assert np.mean(expected) < 0.97 and np.mean(expected != (free[here] > 0.0)) < 0.001


def test_it_is_counted_where_classes_keep_apart_and_bodies_are_much_larger(launcher):
    large = Size("s", 4.0, 6)
    placement = solve(among(large), device="cpu", max_steps=30)
    assert taken_from(placement, launcher, 1) is not None and taken_from(placement, launcher, 0) is None
    may_overlap = Problem(
        Domain((SIDE, SIDE)), placement.problem.classes, Balance(non_overlap=np.eye(2)), avoid_overlap=True
    )
    for problem in (among(large, apart=False), may_overlap, among(Size("s", 8.9 * math.pi * SMALL**2, 6))):
        assert taken_from(solve(problem, device="cpu", max_steps=2), launcher, 1) is None


@pytest.mark.parametrize("on_surface", [False, True])
def test_small_bodies_beside_large_ones_are_as_even_as_alone(on_surface):
    """If the ground of the large ones counted as empty, the error would be .2."""
    domain = Domain((40.0, 40.0))
    if on_surface:
        ball = trimesh.creation.icosphere(5, radius=math.sqrt(1600.0 / (4.0 * math.pi)))
        domain = Surface(SurfaceMesh(ball.vertices, ball.faces))
    tufts = BodyClass("tuft", [Size("s", math.pi * SMALL**2, 3000)])
    boulders = BodyClass("boulder", [Size("s", math.pi * 1.2**2, 30)])
    report = solve(Problem(domain, [boulders, tufts], avoid_overlap=True), device="cpu").report
    assert report.classes[1].coverage_error < 0.02
    assert not report.classes[1].kept_off
