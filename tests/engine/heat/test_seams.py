"""Meshes that touch without sharing corners: heat goes on across their seams, and nowhere else."""

from contextlib import closing
from functools import partial

import esh
import numpy as np
import pytest
import trimesh
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.geometry.nearest_on_triangles import nearest_on_triangles
from esh.engine.heat.heat_mesh import HeatMesh
from esh.engine.heat.split_triangles import even_triangles, split_triangles
from scipy.spatial import cKDTree

NEAR = 1e-3


def sheet(across, along, low=0.0, high=0.5, tilt=0.0, shift=0.0):
    """A sheet of 1 m along y, between two places along x, that rises behind 0.5 m."""
    x, y = np.meshgrid(np.linspace(low, high, across + 1), np.linspace(0.0, 1.0, along + 1), indexing="ij")
    z = np.maximum(x - 0.5, 0.0) * tilt
    corner = np.stack([x.ravel() + shift, y.ravel(), z.ravel()], axis=1)
    i, j = (index.ravel() for index in np.indices((across, along)))
    one = i * (along + 1) + j
    other = one + along + 1
    face = np.concatenate([np.stack([one, other, other + 1], axis=1), np.stack([one, other + 1, one + 1], axis=1)])
    return esh.SurfaceMesh(corner, face)


def surface(first, second, **placed):
    return esh.Surface([sheet(*first), sheet(*second, 0.5, 1.0, **placed)])


@pytest.mark.parametrize("split", [split_triangles, even_triangles])
@pytest.mark.parametrize(("first", "second"), [((8, 12), (6, 17)), ((1, 1), (3, 120)), ((2, 40), (2, 40))])
@pytest.mark.parametrize("placed", [{}, {"tilt": 3.0}, {"shift": 0.9 * NEAR}], ids=["flat", "bent", "apart"])
def test_where_sides_touch_the_surface_goes_on(split, first, second, placed):
    whole = surface(first, second, **placed)
    parts = split(whole, 0.2, 20_000, NEAR)
    length = 4.0 if "tilt" not in placed else 3.0 + np.sqrt(10.0)
    assert parts.border == pytest.approx(length, abs=4.0 * NEAR)
    assert parts.area.sum() == pytest.approx(whole.area)
    rng = np.random.default_rng(0)
    triangle, weight = rng.integers(0, len(whole.triangle), 2000), rng.dirichlet(np.ones(3), 2000)
    back, of_corners = parts.points(*parts.locate(triangle, weight))
    np.testing.assert_array_equal(back, triangle)
    np.testing.assert_allclose(of_corners, weight, atol=1e-9)


@pytest.mark.parametrize("apart", [1.1 * NEAR, 0.02])
def test_what_is_apart_ends(apart):
    parts = split_triangles(surface((8, 12), (6, 17), shift=apart), 0.2, 20_000, NEAR)
    assert parts.border == pytest.approx(6.0)


def test_small_triangles_keep_their_corners():
    """Corners that are all nearer than what touches stay apart along their sides."""
    whole = esh.Surface(sheet(40, 4, 0.0, 0.02))
    parts = split_triangles(whole, 1.0, 20_000, 1e-3)
    assert parts.border == pytest.approx(2.04)
    assert (parts.sides.start != parts.sides.end).all()


def errors(whole, place, ks=(1.0, 2.0)):
    with closing(Launcher(resolve_device("cpu"))) as launcher:
        heat = HeatMesh(launcher, whole, len(place))
        triangle, weight = nearest_on_triangles(whole.position[whole.triangle], place, np.zeros((len(place), 3)))[:2]
        on_device = [launcher.array(triangle.astype(np.int32), wp.int32), launcher.array(weight, wp.vec3d)]
        charges = heat.deposit.charges(*on_device, np.ones(len(place)))
        return [heat.error(charges, float(len(place)), heat.target(), len(place), k) for k in ks]


def test_coverage_errors_are_those_of_one_mesh():
    """As if both ended at the seam they were three times as high."""
    steps = (np.arange(40) + 0.5) / 40
    x, y = np.meshgrid(steps, steps)
    rng = np.random.default_rng(2)
    place = np.column_stack([x.ravel(), y.ravel()]) + rng.uniform(-0.004, 0.004, (1600, 2))
    place = np.column_stack([place, np.zeros(len(place))])
    found, expected = errors(surface((16, 32), (16, 23)), place), errors(esh.Surface(sheet(32, 32, 0.0, 1.0)), place)
    np.testing.assert_allclose(found, expected, rtol=0.05)


def test_who_is_placed_across_a_seam_is_as_even_as_on_one_mesh():
    asked = [esh.BodyClass("a", [esh.Size("s", 1e-6, 1500)])]

    def error(whole):
        problems = [esh.Problem(whole, asked, seed=seed) for seed in range(3)]
        return np.mean([esh.solve(problem, device="cpu").report.coverage_error for problem in problems])

    assert error(surface((16, 32), (16, 23))) < 1.15 * error(esh.Surface(sheet(32, 32, 0.0, 1.0)))


def in_parts(mesh, is_first, change=lambda part: part):
    """A mesh in two, the second of which is changed."""
    first, second = (mesh.submesh([np.flatnonzero(own)], append=True) for own in (is_first, ~is_first))
    return [esh.SurfaceMesh(part.vertices, part.faces) for part in (first, change(second))]


BOX = trimesh.creation.box((1.0, 1.0, 1.0))
IS_LID = BOX.face_normals[:, 2] > 0.5
BALL = trimesh.creation.icosphere(subdivisions=4)
IS_UPPER = BALL.triangles_center[:, 2] > 0.0


def box_with_a_corner_within_a_side():
    face = int(np.flatnonzero(IS_LID)[0])
    a, b, c = (int(corner) for corner in BOX.faces[face])
    faces = np.vstack([np.delete(BOX.faces, face, axis=0), [[8, b, c], [a, 8, c]]])
    return [esh.SurfaceMesh(np.vstack([BOX.vertices, BOX.vertices[[a, b]].mean(axis=0)]), faces)]


def box_with_a_finer_lid(subdivisions):
    def finer(part):
        for _ in range(subdivisions):
            part = part.subdivide()
        return part

    return in_parts(BOX, ~IS_LID, finer)


def soup(noise):
    corner = BALL.triangles.reshape(-1, 3) + np.random.default_rng(0).normal(0.0, noise, (3 * len(BALL.faces), 3))
    return [esh.SurfaceMesh(corner, np.arange(len(corner)).reshape(-1, 3))]


def rounded(part):
    return trimesh.Trimesh(part.vertices.astype(np.float32), part.faces, process=False)


CLOSED = {
    "a corner within a side": box_with_a_corner_within_a_side,
    **{f"a lid {2**k} times as fine": partial(box_with_a_finer_lid, k) for k in (1, 2, 3, 5)},
    "halves a little apart": lambda: in_parts(BALL, IS_UPPER, lambda part: part.apply_translation((0.0, 0.0, -1e-6))),
    "halves, one of single precision": lambda: in_parts(BALL, IS_UPPER, rounded),
    **{f"triangles moved by {noise:g}": partial(soup, noise) for noise in (1e-9, 1e-6, 1e-4)},
}


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])
@pytest.mark.parametrize("closed", CLOSED.values(), ids=CLOSED)
def test_what_closes_without_sharing_corners_is_as_even_as_what_is_closed(closed, device):
    """Once the last open side has met another one, nothing is left to look at."""
    meshes = closed()
    whole = BOX if esh.Surface(meshes).area < 7.0 else BALL
    placements = [
        esh.solve(esh.Problem(esh.Surface(some), [esh.BodyClass("a", [esh.Size("s", 1e-6, 1000)])]), device=device)
        for some in (meshes, [esh.SurfaceMesh(whole.vertices, whole.faces)])
    ]
    found, expected = (cKDTree(one.position).query(one.position, 2)[0][:, 1] for one in placements)
    assert found.min() > 0.94 * expected.min()
    assert found.mean() > 0.985 * expected.mean()
    assert placements[0].report.coverage_error < 1.5 * placements[1].report.coverage_error
    assert placements[0].report.converged


@pytest.mark.parametrize("apart", [0.02, 0.035, 0.045])
def test_errors_across_a_narrow_gap_are_those_of_one_mesh(apart):
    """Of borders as those of two halves of a ball with other numbers of corners, errors of what is even were ten times as high."""
    count = 1500
    gap = apart * np.sqrt(2.0 / np.sqrt(3.0) / count)
    asked = [esh.BodyClass("a", [esh.Size("s", 1e-6, count)])]
    surfaces = [surface((16, 32), (16, 23), shift=gap), esh.Surface(sheet(32, 32, 0.0, 1.0))]
    found, expected = (esh.solve(esh.Problem(some, asked), device="cpu").report.coverage_error for some in surfaces)
    assert found < 1.3 * expected
