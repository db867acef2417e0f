"""The operator that heat spreads by: what it makes of numbers, and how much of it there is to read."""

from contextlib import closing

import esh
import numpy as np
import pytest
import surface_meshes as meshes
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.heat.cut_mesh import CutMesh
from esh.engine.heat.heat_mesh import HeatMesh
from esh.engine.heat.kernels_heat import MOST_MERGED, ROWS
from scipy.linalg import expm

DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)]


@pytest.fixture(params=DEVICES)
def launcher(request):
    with closing(Launcher(resolve_device(request.param))) as opened:
        yield opened


def fan(sides):
    """A flat disc of triangles around one vertex."""
    angle = np.arange(sides) * 2.0 * np.pi / sides
    rim = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    number = np.arange(sides)
    face = np.column_stack([np.zeros(sides, int), 1 + number, 1 + (number + 1) % sides])
    return np.concatenate([np.zeros((1, 3)), rim]), face


def leaves():
    """Four squares that meet in a side, one of them turned over."""
    corner = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    face = []
    for k in range(4):
        out = np.array([np.cos(0.4 + 1.6 * k), np.sin(0.4 + 1.6 * k), 0.0])
        corner += [out, out + [0.0, 0.0, 1.0]]
        own = [[0, 2 + 2 * k, 1], [1, 2 + 2 * k, 3 + 2 * k]]
        face += own if k else [triangle[::-1] for triangle in own]
    return np.array(corner), np.array(face)


MESHES = {
    "ball": lambda: meshes.sphere(2),
    "fan": lambda: fan(90),
    "leaves": leaves,
    "square": lambda: meshes.square(5),
}


def laplacian(mesh, corner, face):
    """The cotangent Laplacian over the roots of both masses, dense, for a mesh whose triangles are cut."""
    vertex, places = mesh.cut.vertex.numpy().reshape(len(face), -1), mesh.places
    small = vertex[:, mesh.pattern].reshape(-1, 3)
    place = np.einsum("pk,tkd->tpd", places, corner[face])[:, mesh.pattern].reshape(-1, 3, 3)
    result, mass = np.zeros((mesh.vertex_count, mesh.vertex_count)), np.zeros(mesh.vertex_count)
    for k in range(3):
        one, other = place[:, (k + 1) % 3] - place[:, k], place[:, (k + 2) % 3] - place[:, k]
        twice = np.linalg.norm(np.cross(one, other), axis=1)
        half = 0.5 * (one * other).sum(axis=1) / twice
        i, j = small[:, (k + 1) % 3], small[:, (k + 2) % 3]
        for a, b in ((i, j), (j, i)):
            np.add.at(result, (a, b), -half)
            np.add.at(result, (a, a), half)
        np.add.at(mass, small[:, k], twice / 6.0)
    return result / np.sqrt(mass[:, None] * mass)


@pytest.mark.parametrize("name", MESHES)
def test_heat_spreads_as_by_the_exponential_of_the_laplacian(name, launcher, monkeypatch):
    """Also from a vertex of very many triangles, and along a side of four."""
    corner, face = MESHES[name]()
    surface = esh.Surface(esh.SurfaceMesh(corner, face))
    # No detail is too fine to spread as fast as it may.
    monkeypatch.setattr("esh.engine.heat.heat_mesh.FINEST", 1e-4)
    heat = HeatMesh(launcher, surface, 12)
    root = heat._root.numpy()
    start, time = np.random.default_rng(0).random(len(root)), 0.02 * surface.area
    spread = heat._spread(launcher.array(start, wp.float64), 1.0, heat.mixed([], []), time).numpy()
    assert spread.shape == root.shape
    if heat._mesh.triangles.is_whole:
        expected = expm(-time * laplacian(heat._mesh, corner, face)) @ (start / root)
        np.testing.assert_allclose(spread, expected, rtol=0.0, atol=2e-5 * np.abs(expected).max())
    # Nothing is lost, whatever the mesh.
    assert (spread * root).sum() == pytest.approx(start.sum(), rel=1e-5)


def test_every_side_of_a_vertex_is_read_once(launcher):
    """And not once for each of the two triangles beside it, which took twice as long."""
    surface = esh.Surface(esh.SurfaceMesh(*meshes.sphere(4)))
    heat = HeatMesh(launcher, surface, 1000)
    block_start, _, factor, _ = (array.numpy() for array in heat._operator._arrays)
    mesh = heat._mesh
    assert mesh.triangles.is_whole
    sides = 3 * mesh.small_count // 2
    assert np.count_nonzero(factor) == 2 * sides
    # Zeros that fill up rows beside longer ones.
    assert len(factor) == ROWS * block_start[-1]
    assert len(factor) < 1.05 * 2 * sides + 7 * ROWS


def test_a_vertex_of_very_many_triangles_is_not_looked_through(launcher):
    """Looking for an entry among thousands, thousands of times, would take seconds."""
    surface = esh.Surface(esh.SurfaceMesh(*fan(6000)))
    heat = HeatMesh(launcher, surface, 4000)
    entries = np.diff(heat._operator._arrays[0].numpy())
    stiffness = heat._mesh.stiffness()
    most = int(np.diff(stiffness.start.numpy()).max())
    assert 2 * most > int(MOST_MERGED)
    assert entries.max() == 2 * most


def test_what_is_around_vertices_is_found_once_for_a_run_that_corrects_targets(monkeypatch):
    """And heat spreads but once for every correction, and for the report, where the density is even."""
    found, spread = [], []
    stiffness, spreads = CutMesh.stiffness, HeatMesh._spread
    monkeypatch.setattr(CutMesh, "stiffness", lambda self: found.append(1) or stiffness(self))
    monkeypatch.setattr(HeatMesh, "_spread", lambda self, *given: spread.append(1) or spreads(self, *given))
    surface = esh.Surface(esh.SurfaceMesh(*meshes.sphere(3)))
    corrected = []
    correct = esh.engine.descent.surface_target_correction.SurfaceTargetCorrection.correct
    monkeypatch.setattr(
        "esh.engine.descent.surface_target_correction.SurfaceTargetCorrection.correct",
        lambda self, *given: corrected.append(1) or correct(self, *given),
    )
    esh.solve(esh.Problem(surface, [esh.BodyClass("a", [esh.Size("s", 1e-6, 500)])]), device="cpu")
    assert len(corrected) == 5
    assert len(found) == 1
    assert len(spread) <= len(corrected) + 1
