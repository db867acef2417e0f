"""Triangles that are split for what is measured: they fit together, no side is too long, and slivers are measured well."""

import esh
import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.problem.nearest_on_triangles import nearest_on_triangles
from esh.engine.quality.flips import cotangents
from esh.engine.quality.heat import HeatMesh
from esh.engine.quality.split_triangles import halve_triangles, split_triangles

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


def halved(surface, longest, most):
    parts = halve_triangles(surface, longest, most)
    assert parts is not None
    return parts.delaunay()


@pytest.mark.parametrize("split", [split_triangles, halved])
@pytest.mark.parametrize("longest", [1.0, 0.3, 0.05])
@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES.keys())
def test_parts_fit_together_and_cover_the_surface(mesh, longest, split):
    given = mesh()
    surface = esh.Surface(esh.SurfaceMesh(given.vertices, given.faces))
    parts = split(surface, longest, 1_000_000)
    side = np.linalg.norm(parts.corner - np.roll(parts.corner, 1, axis=1), axis=2)
    # What crosses a part is no side of the whole, and may be a little longer.
    assert side.max() < 1.5 * longest
    assert parts.area.sum() == pytest.approx(surface.area)
    cross = np.cross(parts.corner[:, 1] - parts.corner[:, 0], parts.corner[:, 2] - parts.corner[:, 0])
    np.testing.assert_allclose(0.5 * np.linalg.norm(cross, axis=1), parts.area, rtol=1e-9, atol=1e-15)
    assert (np.einsum("nd,nd->n", cross, surface.normal[parts.origin]) > 0.0).all()
    # Closed as the surface is, and of its genus.
    sides = parts.sides
    assert (sides.count == 2).all()
    assert len(np.unique(sides.start)) - len(sides.count) + len(parts) == 2
    points = surface.sample(1000)
    triangle, weight = parts.locate(points.triangle, points.barycentric)
    np.testing.assert_array_equal(parts.origin[triangle], points.triangle)
    np.testing.assert_allclose(np.einsum("nk,nkd->nd", weight, parts.corner[triangle]), points.position, atol=1e-12)
    back = surface.points(*parts.points(triangle, weight))
    np.testing.assert_allclose(back.position, points.position, atol=1e-12)


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES.keys())
def test_parts_within_a_triangle_are_delaunay(mesh):
    given = mesh()
    parts = halved(esh.Surface(esh.SurfaceMesh(given.vertices, given.faces)), 0.1, 1_000_000)
    first, second = parts.sides.pairs()
    inner = parts.origin[first // 3] == parts.origin[second // 3]
    cotangent = cotangents(parts.corner).ravel()
    assert inner.any() and (cotangent[first] + cotangent[second])[inner].min() > -1e-5


def test_nothing_is_halved_where_that_would_be_too_many():
    assert halve_triangles(strips(100, 1), 0.001, 3000) is None
    assert halve_triangles(strips(10, 10), 2.0, 3000).is_whole


def test_slivers_are_weighed_by_their_length():
    """A strip of 100 cells, each two triangles of 1 by .01."""
    parts = halve_triangles(strips(100, 1), 2.0, 3000)
    assert parts.beside_slivers(1.0 / 16.0, 0.001) == pytest.approx(200 * 1.0 * 0.001, rel=1e-3)
    assert parts.beside_slivers(1.0 / 200.0, 0.001) == 0.0


def test_nothing_is_split_where_all_sides_are_short_and_few_where_few_are_allowed():
    surface = strips(10, 10)
    assert split_triangles(surface, 0.2, 1000).is_whole
    parts = split_triangles(strips(100, 1), 0.001, 3000)
    assert not parts.is_whole and len(parts) <= 3000


@pytest.mark.parametrize("columns", [50, 100, 400])
def test_coverage_errors_do_not_depend_on_slivers(columns):
    """The same bodies on squares of slivers and of triangles of one size."""
    rng = np.random.default_rng(2)
    steps = (np.arange(40) + 0.5) / 40
    x, y = np.meshgrid(steps, steps)
    # A lattice that is stirred: even, but not quite.
    place = np.column_stack([x.ravel(), y.ravel()]) + rng.uniform(-0.004, 0.004, (1600, 2))
    launcher = Launcher(resolve_device("cpu"))
    found = []
    for surface in (strips(40, 40), strips(columns, 1)):
        heat = HeatMesh(launcher, surface, len(place))
        corner = surface.position[surface.triangle]
        points = nearest_on_triangles(corner, np.column_stack([place, np.zeros(len(place))]), np.zeros((len(place), 3)))
        on_device = [launcher.array(points[0].astype(np.int32), wp.int32), launcher.array(points[1], wp.vec3d)]
        charges = heat.charges(*on_device, np.ones(len(place)))
        found.append([heat.error(charges, float(len(place)), heat.target(), len(place), k) for k in (1.0, 2.0)])
    np.testing.assert_allclose(found[1], found[0], rtol=0.25, atol=3e-3)


def test_more_triangles_than_are_allowed_stay_whole():
    """Sides were let be longer and longer, without end."""
    assert split_triangles(strips(40, 40), 0.001, 1000).is_whole
