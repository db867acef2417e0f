"""Overlaps that the report counts, against shapely."""

import dataclasses
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.body_footprints import footprints_of
from esh.engine.problem.domain import Domain
from esh.engine.problem.footprint import Footprint
from esh.engine.problem.footprints import Footprints
from esh.engine.problem.line import Line
from esh.engine.problem.placement import Placement
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.quality.bodies_on_surface import bodies_on_surface
from esh.engine.quality.overlaps import TOLERANCE, find_overlaps, find_overlaps_on_surface, overlaps_of
from esh.engine.solve import solve
from esh.engine.solver.solver import Solver

pytest.importorskip("shapely")
BENCHMARKS = Path(__file__).resolve().parents[3] / "benchmarks"


@pytest.fixture(scope="module")
def contact():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        import contact

        yield contact
        sys.modules.pop("contact", None)


@pytest.fixture(scope="module")
def launcher():
    result = Launcher(resolve_device("cpu"))
    yield result
    result.close()


def scattered(domain, sizes, seed):
    """A placement at random: nothing keeps apart."""
    problem = Problem(domain, [BodyClass("a", sizes)], seed=seed)
    rng = np.random.default_rng(seed)
    n = problem.body_count
    line = np.repeat([size.line is not None for size in sizes], [size.count for size in sizes])
    length, width = np.where(line, rng.uniform(0.3, 2.0, n), 0.0), np.where(line, 0.2, 0.0)
    position = rng.random((n, 2)) * domain.size
    return Placement(problem, position, *problem.body_indices(), rng.uniform(-4, 4, n), length, width)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_overlaps_equal_those_that_shapely_finds(contact, launcher, boundary, seed):
    polygons = contact.random_polygons(60, seed)
    sizes = [
        Size("polygons", count=500, footprint=Footprints(polygons, scale_jitter=0.5)),
        Size("discs", count=300, footprint=[Footprint.disc(1.0), Footprint.disc(0.1)]),
        Size("rounded", count=300, footprint=Footprint.rectangle(1.5, 0.2, 0.1)),
        Size("capsules", count=200, footprint=Footprint.capsule(2.0, 0.2)),
        Size("lines", 0.2, 200, line=Line(1.0, width=0.2)),
        Size("dots", 0.2, 300),
    ]
    placement = scattered(Domain((70.0, 50.0), boundary), sizes, seed)
    found = overlaps_of(placement, launcher)
    count, deepest = contact.overlaps_by_shapely(placement)
    assert found.count == count > 300
    assert found.deepest == pytest.approx(deepest, rel=1e-9)
    i, j = found.pair
    way = placement.position[j] - placement.position[i]
    if boundary == "periodic":
        way -= np.array([70.0, 50.0]) * np.round(way / [70.0, 50.0])
    middle = placement.position[i] + 0.5 * way
    off = np.array(found.place) - middle
    np.testing.assert_allclose(off - np.array([70.0, 50.0]) * np.round(off / [70.0, 50.0]), 0.0, atol=1e-9)


def two(launcher, footprint, position, angle, domain=None, **kwargs):
    domain = domain or Domain((40.0, 30.0))
    problem = Problem(domain, [BodyClass("a", [Size("s", count=len(position), footprint=footprint)])])
    zero = np.zeros(len(position))
    return find_overlaps(
        footprints_of(problem), np.array(position), np.array(angle), zero, zero, domain, launcher, **kwargs
    )


def test_depth_is_the_shortest_way_out(launcher):
    box = Footprint.rectangle(2.0, 1.0)
    found = two(launcher, box, [[10.0, 10.0], [10.3, 10.8]], [0.0, 0.0])
    assert (found.count, found.pair) == (1, (0, 1))
    assert found.deepest == pytest.approx(0.2)
    assert found.place == pytest.approx((10.15, 10.4))
    # A corner in a side, by the axis of the diagonal.
    found = two(launcher, Footprint.rectangle(1.0, 1.0), [[10.0, 10.0], [11.1, 10.0]], [0.0, math.pi / 4])
    assert found.deepest == pytest.approx(0.5 + math.sqrt(0.5) - 1.1)
    # Crossed capsules: out along the shorter way, past an end.
    found = two(launcher, Footprint.capsule(2.2, 0.2), [[10.0, 10.0], [10.9, 10.0]], [0.0, math.pi / 2])
    assert found.deepest == pytest.approx(0.1 + 0.2)
    # Touching is none, nor is a thousandth of the width.
    assert two(launcher, box, [[10.0, 10.0], [10.0, 10.9995]], [0.0, 0.0]).count == 0
    assert two(launcher, box, [[10.0, 10.0], [10.0, 10.9985]], [0.0, 0.0]).count == 1
    # Corners that are near, in no face's direction.
    rounded = Footprint.rectangle(1.0, 1.0, 0.1)
    assert two(launcher, rounded, [[10.0, 10.0], [11.15, 11.15]], [0.0, 0.0]).count == 0
    assert two(launcher, rounded, [[10.0, 10.0], [11.13, 11.13]], [0.0, 0.0]).count == 1


def test_nearly_parallel_axes_are_seen_to_cross(launcher):
    footprint = Footprint.capsule(30.0, 0.02)
    position = [[20.0, 15.0], [20.0, 15.1], [20.0, 20.0]]
    assert two(launcher, footprint, position, [0.7, 0.7005, 0.7]).count == 0
    assert two(launcher, footprint, position, [0.7, 0.72, 0.7]).count == 1


def test_images_beyond_the_nearest_one_count(launcher):
    """A long body meets the next one again across the border, where their middles are farther apart; and itself."""
    domain = Domain((10.0, 4.0), "periodic")
    plank = Footprint.rectangle(9.0, 0.2)
    assert two(launcher, plank, [[5.0, 1.0], [5.5, 3.0]], [0.0, 0.0], domain).count == 0
    assert two(launcher, plank, [[5.0, 1.0], [5.5, 3.0]], [0.0, 0.6], domain).count == 1
    # Upright it reaches over two periods: on itself, and on the other.
    found = two(launcher, plank, [[5.0, 1.0], [8.0, 3.0]], [math.pi / 2, 0.0], domain)
    assert found.count == 2


def test_footprints_far_larger_than_the_domain_end(launcher):
    domain = Domain((8.0, 8.0), "periodic")
    assert two(launcher, Footprint.disc(60.0), [[1.0, 1.0]], [0.0], domain).count == 1
    assert two(launcher, Footprint.rectangle(100.0, 70.0), [[1.0, 1.0], [3.0, 3.0]], [0.0, 1.0], domain).count == 3


def test_room_below_one_may_overlap_that_far(launcher):
    for room, count in ((1.0, 1), (0.8, 0), (1.5, 1)):
        size = Size("s", count=2, footprint=Footprints(Footprint.disc(0.5), room=room))
        problem = Problem(Domain((4.0, 4.0)), [BodyClass("a", [size])])
        zero = np.zeros(2)
        placement = Placement(problem, np.array([[1.0, 1.0], [1.85, 1.0]]), *problem.body_indices(), zero, zero, zero)
        assert overlaps_of(placement, launcher).count == count


@pytest.mark.parametrize("threads", [1, 3, 16])
def test_discs_of_all_sizes_on_any_number_of_threads(threads, monkeypatch, overlap_count):
    """Levels of size without bodies lie between others; counted pair by pair beside it."""
    rng = np.random.default_rng(7)
    radius = np.concatenate([np.full(3, 6.0), rng.uniform(0.2, 0.35, 400), rng.uniform(0.001, 0.02, 1500)])
    position = rng.random((len(radius), 2)) * [60.0, 40.0]
    way = position[:, None] - position
    depth = radius[:, None] + radius - np.hypot(way[..., 0], way[..., 1])
    deep = np.triu(depth > 2.0 * TOLERANCE * np.minimum(radius[:, None], radius), 1)
    monkeypatch.setenv("ESH_THREADS", str(threads))
    launcher = Launcher(resolve_device("cpu"))
    try:
        found = overlap_count(position, math.pi * radius**2, Domain((60.0, 40.0)), launcher)
    finally:
        launcher.close()
    assert found == deep.sum() > 100


def overlapping_ribbons(placement):
    """Pairs that shapely finds, of lines as they are bent and of discs, and how deep the deepest lies."""
    import shapely

    cores, radius = [], np.where(placement.width > 0.0, 0.5 * placement.width, np.sqrt(placement.area / math.pi))
    for bend, position in zip(placement.bends, placement.position, strict=True):
        there = np.isfinite(bend).all(axis=1)
        cores.append(shapely.LineString(bend[there]) if there.any() else shapely.Point(position))
    cores = np.array(cores)
    size = placement.problem.domain.size
    periods = (-1, 0, 1) if placement.problem.domain.periodic else (0,)
    distance = np.full((len(cores), len(cores)), np.inf)
    for a in periods:
        for b in periods:
            moved = shapely.transform(cores, lambda p, a=a, b=b: p + np.array([a * size[0], b * size[1]]))
            distance = np.minimum(distance, shapely.distance(cores[:, None], moved[None]))
    i, j = np.triu_indices(len(cores), 1)
    depth = (radius[i] + radius[j] - distance[i, j]) / (2.0 * np.minimum(radius[i], radius[j]))
    return {(int(a), int(b)) for a, b in zip(i[depth > TOLERANCE], j[depth > TOLERANCE], strict=True)}


@pytest.mark.parametrize("boundary", ["open", "periodic"])
@pytest.mark.parametrize("seed", [1, 2])
def test_lines_that_bend_count_as_they_are_bent(launcher, boundary, seed):
    bending = [Line(1.0, "none", width=0.15, charges=charges, straightness=0.1) for charges in (3, 7)]
    sizes = [Size("bent", 0.2, 150, line=bending[0]), Size("more", 0.2, 150, line=bending[1]), Size("disc", 0.05, 150)]
    placement = scattered(Domain((20.0, 18.0), boundary), sizes, seed)
    rng = np.random.default_rng(seed)
    bends = np.full((450, 7, 2), np.nan)
    for i in range(300):
        along = 0.5 * placement.length[i] * np.linspace(-1.0, 1.0, 3 if i < 150 else 7)
        across = rng.uniform(-0.25, 0.25, len(along)) * placement.length[i]
        c, s = math.cos(placement.angle[i]), math.sin(placement.angle[i])
        bends[i, : len(along)] = placement.position[i] + np.stack([c * along - s * across, s * along + c * across], 1)
    straight = overlaps_of(placement, launcher)
    bent = dataclasses.replace(placement, bends=bends)
    found = overlaps_of(bent, launcher)
    expected = overlapping_ribbons(bent)
    assert found.count == len(expected) > 100
    assert set(found.bodies) == {body for pair in expected for body in pair}
    assert found.pair in expected
    assert set(straight.bodies) != set(found.bodies)


def test_lines_that_bend_on_a_flat_surface_count_as_in_the_plane(launcher):
    line = Line(1.0, "none", width=0.15, charges=5, straightness=0.1)
    sizes = [Size("bent", 0.2, 150, line=line), Size("disc", 0.05, 100)]
    flat = scattered(Domain((10.0, 9.0), "open"), sizes, 4)
    rng = np.random.default_rng(5)
    bends = np.full((250, 5, 2), np.nan)
    along = 0.5 * flat.length[:150, None] * np.linspace(-1.0, 1.0, 5)
    across = rng.uniform(-0.25, 0.25, along.shape) * flat.length[:150, None]
    c, s = np.cos(flat.angle[:150, None]), np.sin(flat.angle[:150, None])
    bends[:150] = flat.position[:150, None] + np.stack([c * along - s * across, s * along + c * across], 2)
    flat = dataclasses.replace(flat, bends=bends)
    corner = np.array([[0.0, 0, 0], [10, 0, 0], [10, 9, 0], [0, 9, 0]])
    surface = Surface(SurfaceMesh(corner, [[0, 1, 2], [0, 2, 3]]))
    x, y = flat.position.T
    # Of the triangle below the diagonal, and of that above.
    below = y / 9.0 <= x / 10.0
    weights = np.where(
        below[:, None],
        np.column_stack([1.0 - x / 10.0, x / 10.0 - y / 9.0, y / 9.0]),
        np.column_stack([1.0 - y / 9.0, x / 10.0, y / 9.0 - x / 10.0]),
    )
    placement = Placement(
        Problem(surface, [BodyClass("a", sizes)]),
        np.column_stack([flat.position, np.zeros(250)]),
        flat.class_index,
        flat.size_index,
        flat.angle,
        flat.length,
        flat.width,
        bends=np.concatenate([bends, np.zeros((250, 5, 1))], axis=2),
        normal=np.tile([0.0, 0.0, 1.0], (250, 1)),
        tangent=np.column_stack([np.cos(flat.angle), np.sin(flat.angle), np.zeros(250)]),
        mesh=np.zeros(250, np.int32),
        triangle=np.where(below, 0, 1).astype(np.int32),
        barycentric=weights,
    )
    bodies = bodies_on_surface(placement, launcher)
    found, expected = find_overlaps_on_surface(placement, bodies, launcher), overlapping_ribbons(flat)
    assert found.count == len(expected) > 100
    assert set(found.bodies) == {body for pair in expected for body in pair}
    assert found.deepest == pytest.approx(overlaps_of(flat, launcher).deepest, rel=1e-6)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_lines_bend_as_far_as_there_is_room(boundary):
    """Parted as if they were straight they would overlap as they are bent: in 60 pairs."""
    line = Line(2.0, "none", width=0.25, charges=5, straightness=0.02, turn_weights=(0.4, 0.0))
    image = np.ones((8, 8))
    image[::2] = 0.3
    sizes = [Size("bent", 0.5, 90, line=line), Size("disc", 0.3, 60)]
    crowd = Problem(Domain((14.0, 12.0), boundary), [BodyClass("a", sizes, image)], seed=3, avoid_overlap=True)
    placement = solve(crowd, device="cpu", max_steps=40)
    assert placement.report.overlaps == len(overlapping_ribbons(placement)) == 0
    assert placement.bends is not None and np.isfinite(placement.bends[:90]).all()
    # Where nobody is near they stay as they are.
    few = [Size("bent", 0.5, 12, line=line)]
    bends = []
    for avoid in (False, True):
        domain = Domain((14.0, 12.0), boundary)
        made = Problem(domain, [BodyClass("a", few, image)], seed=3, avoid_overlap=avoid)
        with Solver(made, device="cpu") as solver:
            solver.run(40)
            before = solver.state.bend.numpy().copy()
            solver.separate()
            bends.append((np.abs(before).max(), np.abs(solver.state.bend.numpy()).max()))
        placement = solve(made, device="cpu", max_steps=40)
        assert not avoid or placement.report.overlaps == len(overlapping_ribbons(placement)) == 0
    assert bends[0][0] == bends[0][1]
    assert 0.02 < bends[1][1] <= bends[1][0]
