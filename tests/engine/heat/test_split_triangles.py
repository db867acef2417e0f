"""Triangles that are split for what is measured: they fit together, no side is too long, and slivers are measured well."""

import esh
import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.geometry.nearest_on_triangles import nearest_on_triangles
from esh.engine.heat.heat_mesh import HeatMesh
from esh.engine.heat.split_triangles import even_triangles, split_triangles

trimesh = pytest.importorskip("trimesh")

MESHES = {
    "cylinder": lambda: trimesh.creation.cylinder(radius=0.6, height=1.5, sections=80),
    "box": lambda: trimesh.creation.box((1.0, 2.0, 0.1)),
    "ball": lambda: trimesh.creation.icosphere(2),
}


def strips(columns, rows):
    x, y = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1), indexing="ij")
    place = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    a = (i * (rows + 1) + j).ravel()
    b = a + rows + 1
    faces = np.concatenate([np.column_stack([a, b, b + 1]), np.column_stack([a, b + 1, a + 1])])
    return esh.Surface(esh.SurfaceMesh(place, faces))


def tube(sides, radius, length):
    angle = np.arange(sides) * 2.0 * np.pi / sides
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle])
    a = np.arange(sides)
    b = (a + 1) % sides
    faces = [np.column_stack([a, b, b + sides]), np.column_stack([a, b + sides, a + sides])]
    return esh.Surface(esh.SurfaceMesh(np.concatenate([ring, ring + [0.0, 0.0, length]]), np.concatenate(faces)))


def surface_of(mesh):
    return esh.Surface(esh.SurfaceMesh(mesh.vertices, mesh.faces))


def corners(surface, parts):
    """Where the corners of parts lie in space, shape ``[t, 3, 3]``."""
    triangle, weight = parts.points(np.repeat(np.arange(len(parts)), 3), np.tile(np.eye(3), (len(parts), 1)))
    return surface.points(triangle, weight).position.reshape(-1, 3, 3)


@pytest.mark.parametrize("split", [split_triangles, even_triangles])
@pytest.mark.parametrize("longest", [1.0, 0.3, 0.05])
@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES.keys())
def test_parts_fit_together_and_cover_the_surface(mesh, longest, split):
    surface = surface_of(mesh())
    parts = split(surface, longest, 1_000_000)
    side = np.linalg.norm(parts.flat - np.roll(parts.flat, 1, axis=1), axis=2)
    # What crosses a part is no side of the whole, and may be a little longer.
    assert side.max() < (1.5 if split is split_triangles else 1.0 + 1e-9) * longest
    assert parts.area.sum() == pytest.approx(surface.area)
    (first, second), (third, fourth) = ((parts.flat[:, k] - parts.flat[:, 0]).T for k in (1, 2))
    np.testing.assert_allclose(0.5 * (first * fourth - second * third), parts.area, rtol=1e-9, atol=1e-15)
    # Along the surface it is nowhere shorter than in space, and where nothing bends it is as long.
    corner = corners(surface, parts)
    in_space = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    assert (in_space <= side + 1e-9).all() and np.median(side - in_space) < 1e-9
    # Closed as the surface is, and of its genus.
    sides = parts.sides
    assert (sides.count == 2).all()
    assert len(np.unique(sides.start)) - len(sides.count) + len(parts) == 2
    points = surface.sample(1000)
    triangle, weight = parts.locate(points.triangle, points.barycentric)
    assert weight.min() >= 0.0
    back = surface.points(*parts.points(triangle, weight))
    np.testing.assert_allclose(back.position, points.position, atol=1e-12)


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES.keys())
def test_even_triangles_are_delaunay_and_nearly_as_high_as_they_are_long(mesh):
    parts = even_triangles(surface_of(mesh()), 0.04, 1_000_000)
    first, second = parts.sides.pairs()
    cotangent = parts.cotangents.ravel()
    assert (cotangent[first] + cotangent[second]).min() > -1e-5
    side = np.linalg.norm(parts.flat - np.roll(parts.flat, 1, axis=1), axis=2)
    lowest = 2.0 * parts.area / side.max(axis=1) ** 2
    assert np.median(lowest) > 0.45
    assert parts.area[lowest < 0.2].sum() < 0.02 * parts.area.sum(), "at most where slivers meet in a corner"


@pytest.mark.parametrize("sides", [3, 4, 5])
def test_no_two_sides_around_a_thin_tube_have_the_same_ends(sides):
    """Turned as Delaunay wants them, some would go around it and end where another one does."""
    surface = tube(sides, 0.01, 1.0)
    parts = even_triangles(surface, 0.03, 1_000_000)
    assert parts.sides.count.max() == 2
    assert (parts.sides.start != parts.sides.end).all()
    assert len(np.unique(parts.sides.start)) - len(parts.sides.count) + len(parts) == 0, "open at both ends"
    points = surface.sample(1000)
    back = surface.points(*parts.points(*parts.locate(points.triangle, points.barycentric)))
    np.testing.assert_allclose(back.position, points.position, atol=1e-12)


def test_parts_are_told_that_reach_into_a_triangle():
    surface = tube(8, 0.3, 2.0)
    parts = even_triangles(surface, 0.2, 1_000_000)
    chosen = np.array([0, 5])
    reach = parts.reach_into(chosen)
    rng = np.random.default_rng(1)
    inside = np.repeat(np.arange(len(parts)), 20)
    triangle, _ = parts.points(inside, rng.dirichlet(np.ones(3), len(inside)))
    assert reach[inside[np.isin(triangle, chosen)]].all()
    assert 0 < reach.sum() < 0.6 * len(parts)


def test_there_are_no_more_even_triangles_than_are_allowed():
    assert 1500 < len(even_triangles(strips(100, 1), 0.001, 3000)) <= 3000
    assert even_triangles(strips(10, 10), 2.0, 3000).is_whole


def test_slivers_are_weighed_by_their_length():
    """A strip of 100 cells, each two triangles of 1 by .01."""
    parts = split_triangles(strips(100, 1), 2.0, 3000)
    assert parts.is_whole
    assert parts.beside_slivers(1.0 / 16.0, 0.001) == pytest.approx(200 * 1.0 * 0.001, rel=1e-3)
    assert parts.beside_slivers(1.0 / 200.0, 0.001) == 0.0
    assert parts.beside_slivers(1.0 / 16.0, 0.001, 0.9) > 0.0 == parts.beside_slivers(1.0 / 16.0, 0.001, 1.1)


def test_nothing_is_split_where_all_sides_are_short_and_few_where_few_are_allowed():
    surface = strips(10, 10)
    assert split_triangles(surface, 0.2, 1000).is_whole
    parts = split_triangles(strips(100, 1), 0.001, 3000)
    assert not parts.is_whole and len(parts) <= 3000


def errors(surface, place, ks):
    launcher = Launcher(resolve_device("cpu"))
    heat = HeatMesh(launcher, surface, len(place))
    points = nearest_on_triangles(surface.position[surface.triangle], place, np.zeros((len(place), 3)))
    on_device = [launcher.array(points[0].astype(np.int32), wp.int32), launcher.array(points[1], wp.vec3d)]
    charges = heat.deposit.charges(*on_device, np.ones(len(place)))
    return [heat.error(charges, float(len(place)), heat.target(), len(place), k) for k in ks]


@pytest.mark.parametrize("columns", [50, 100, 400])
def test_coverage_errors_do_not_depend_on_slivers(columns):
    """The same bodies on squares of slivers and of triangles of one size."""
    rng = np.random.default_rng(2)
    steps = (np.arange(40) + 0.5) / 40
    x, y = np.meshgrid(steps, steps)
    # A lattice that is stirred: even, but not quite.
    place = np.column_stack([x.ravel(), y.ravel()]) + rng.uniform(-0.004, 0.004, (1600, 2))
    place = np.column_stack([place, np.zeros(len(place))])
    found, expected = (errors(surface, place, (1.0, 2.0)) for surface in (strips(columns, 1), strips(40, 40)))
    np.testing.assert_allclose(found, expected, rtol=0.05)


def test_coverage_errors_of_even_bodies_do_not_depend_on_slivers():
    """Slivers made errors of bodies that a solver has placed up to three times as high."""
    n = 300
    surface = strips(12, 12)
    problem = esh.Problem(surface, [esh.BodyClass("a", [esh.Size("s", 0.3 / n, n)])])
    with esh.Solver(problem, device="cpu") as solver:
        solver.step(100)
        place = solver.placement().position
    found, expected = (errors(one, place, (0.5, 1.0, 2.0)) for one in (strips(60, 1), surface))
    np.testing.assert_allclose(found, expected, rtol=0.25)


def test_more_triangles_than_are_allowed_stay_whole():
    """Sides were let be longer and longer, without end."""
    assert split_triangles(strips(40, 40), 0.001, 1000).is_whole


def test_points_in_triangles_that_are_whole_are_not_looked_for(monkeypatch):
    """Of a rock's 10,000 bodies, few of whose triangles are split, that took longer than to share them out."""
    lattice = strips(4, 40)
    assert split_triangles(lattice, 0.26, 1_000_000).is_whole
    # One more triangle is larger than all others.
    corner = np.concatenate([lattice.position, [[3.0, 0.5, 0.0]]])
    face = np.concatenate([lattice.triangle, [[len(corner) - 2, 40, len(corner) - 1]]])
    parts = split_triangles(esh.Surface(esh.SurfaceMesh(corner, face)), 0.26, 1_000_000)
    rng = np.random.default_rng(0)
    triangle, weight = rng.integers(0, len(face), 3000), rng.dirichlet(np.ones(3), 3000)
    asked, inverses = [], esh.engine.heat.cuts.inverses
    monkeypatch.setattr("esh.engine.heat.cuts.inverses", lambda of: asked.append(len(of)) or inverses(of))
    back, again = parts.points(*parts.locate(triangle, weight))
    np.testing.assert_array_equal(back, triangle)
    np.testing.assert_allclose(again, weight, atol=1e-9)
    assert 0 < max(asked) <= len(parts) - len(face) + 1
