"""Charges that are spread as widely wherever they lie in a triangle."""

from contextlib import closing

import esh
import numpy as np
import pytest
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.heat.heat_mesh import INNER, HeatMesh

DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)]


@pytest.fixture(params=DEVICES)
def launcher(request):
    with closing(Launcher(resolve_device(request.param))) as opened:
        yield opened


def irregular(bend, cells=16):
    """A square of 1 m of irregular triangles, bent along its middle: a mesh, and where its vertices lie when it is laid flat."""
    rng = np.random.default_rng(4)
    x, y = np.meshgrid(np.linspace(0.0, 1.0, cells + 1), np.linspace(0.0, 1.0, cells + 1), indexing="ij")
    flat = np.stack([x.ravel(), y.ravel()], axis=1)
    # What lies on the border or on the bend stays there.
    free = ((flat > 0.0) & (flat < 1.0)).all(axis=1) & (flat[:, 0] != 0.5)
    flat[free] += rng.uniform(-0.15, 0.15, (free.sum(), 2)) / cells
    beyond = np.maximum(flat[:, 0] - 0.5, 0.0)
    corner = np.stack([np.minimum(flat[:, 0], 0.5) + beyond * np.cos(bend), flat[:, 1], beyond * np.sin(bend)], axis=1)
    one = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    other = one + cells + 1
    face = np.concatenate([np.stack([one, other, other + 1], axis=1), np.stack([one, other + 1, one + 1], axis=1)])
    return esh.Surface(esh.SurfaceMesh(corner, face)), flat


def moments(place, charge):
    """Of order 0 to 2."""
    x, y = place.T
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y]) @ charge


@pytest.mark.parametrize("bend", [0.0, 1.2])
@pytest.mark.parametrize("cells", [pytest.param(16, id="whole"), pytest.param(4, id="cut")])
def test_charges_keep_their_moments(bend, cells, launcher):
    """Those of order 2, too: by the corners alone these would grow by as much as the corners are away."""
    surface, flat = irregular(bend, cells)
    heat = HeatMesh(launcher, surface, 40)
    # Where every vertex lies, by what each gets of charges at every place of a fine lattice in every triangle.
    rng = np.random.default_rng(1)
    inner = np.flatnonzero(((flat[surface.triangle] > 0.0) & (flat[surface.triangle] < 1.0)).all(axis=(1, 2)))
    assert len(inner) > 1
    places = vertex_places(heat, surface, flat)
    for triangle in rng.choice(inner, 8):
        weight = rng.dirichlet(np.ones(3))
        own = launcher.own_array(np.array([triangle], np.int32), wp.int32), launcher.own_array(weight[None], wp.vec3d)
        point = weight @ flat[surface.triangle[triangle]]
        wanted = moments(point[None], np.ones(1))
        evenly = heat.deposit.charges_evenly(*own, np.ones(1)).numpy()
        np.testing.assert_allclose(moments(places, evenly), wanted, atol=1e-9)
        plain = heat.deposit.charges(*own, np.ones(1)).numpy()
        np.testing.assert_allclose(moments(places, plain)[:3], wanted[:3], atol=1e-9)
        assert moments(places, plain)[3:].sum() > wanted[3:].sum() + 1e-6


def vertex_places(heat, surface, flat):
    """Where the vertices of a mesh lie that is cut evenly, shape ``[n, 2]``."""
    corner = flat[surface.triangle]
    mesh = heat._mesh
    places = np.zeros((mesh.vertex_count, 2))
    places[mesh.cut.vertex.numpy()] = np.einsum("pk,tkd->tpd", mesh.places, corner).reshape(-1, 2)
    return places


@pytest.mark.parametrize("cells", [16, 4])
def test_areas_are_shared_out_as_charges_are_that_lie_all_over_them(cells, launcher):
    surface, _ = irregular(0.7, cells)
    heat = HeatMesh(launcher, surface, 40)
    area = heat.deposit.area_evenly().numpy()
    assert area.sum() == pytest.approx(1.0)
    finer = 12
    place = np.array([(i, j) for j in range(finer) for i in range(finer - j)], float)
    low = np.column_stack([finer - 1.0 - place.sum(axis=1), place])
    high = np.column_stack([finer - 2.0 - place.sum(axis=1), place])
    high = high[high[:, 0] >= 0.0]
    lattice = np.concatenate([low[:, None] + INNER, high[:, None] + 1.0 - INNER]).reshape(-1, 3) / finer
    count = len(surface.triangle)
    triangle = np.repeat(np.arange(count, dtype=np.int32), len(lattice))
    charge = np.repeat(surface.triangle_area / surface.area / len(lattice), len(lattice))
    own = launcher.own_array(triangle, wp.int32), launcher.own_array(np.tile(lattice, (count, 1)), wp.vec3d)
    np.testing.assert_allclose(heat.deposit.charges_evenly(*own, charge).numpy(), area, rtol=1e-6)


def test_beside_slivers_and_borders_nothing_is_lost(launcher):
    """Across a border the surface goes on as in a mirror; a sliver's corners say nothing of how something curves."""
    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.5, 1.0005, 0], [0.5, 2, 0]], float)
    surface = esh.Surface(esh.SurfaceMesh(corner, np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4], [2, 4, 5]])))
    heat = HeatMesh(launcher, surface, 3)
    weight = np.random.default_rng(0).dirichlet(np.ones(3), 400)
    triangle = np.tile(np.arange(len(surface.triangle), dtype=np.int32), 100)
    own = launcher.own_array(triangle, wp.int32), launcher.own_array(weight, wp.vec3d)
    shared = heat.deposit.charges_evenly(*own, np.ones(400)).numpy()
    assert shared.sum() == pytest.approx(400.0)
    assert np.isfinite(shared).all()
    assert np.abs(shared).max() < 400.0


def across_of(mesh):
    """Corners across sides of small triangles, by a table of all sides: see :class:`~esh.engine.heat.kernels_deposit.Across`."""
    small = mesh.small_vertices.reshape(-1, 3)
    corners = {}
    for i, vertex in enumerate(small.tolist()):
        for k in range(3):
            corners.setdefault(frozenset((vertex[(k + 1) % 3], vertex[(k + 2) % 3])), []).append(3 * i + k)
    result = np.full(small.size, -1)
    for found in corners.values():
        if len(found) == 2:
            result[found] = found[::-1]
    return result


@pytest.mark.parametrize("cells", [pytest.param(16, id="whole"), pytest.param(4, id="cut"), None])
def test_whatever_shares_one_side_is_across_from_each_other(cells, launcher):
    """But not where three triangles meet in a side, or none goes on."""
    if cells is None:
        corner = [[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0.5], [1, 1, 1]]
        face = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4], [2, 1, 5]])
        surface = esh.Surface(esh.SurfaceMesh(np.array(corner, float), face))
    else:
        surface, _ = irregular(0.7, cells)
    deposit = HeatMesh(launcher, surface, 40).deposit
    np.testing.assert_array_equal(deposit._across.corner.numpy(), across_of(deposit._mesh))
    assert deposit.area_evenly().numpy().sum() == pytest.approx(1.0)
