"""A surface cut into facets and tiles, and which of its parts are one."""

import numpy as np
import pytest
import trimesh
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.surface import facets as facets_module
from esh.engine.surface import kernels_facets
from esh.engine.surface.facets import FACET, MOST_SLENDER, TILE, TILE_AT_BEND, Facets
from esh.engine.surface.parts import joined_parts


@pytest.fixture(scope="module")
def launcher():
    result = Launcher(resolve_device("cpu"))
    yield result
    result.close()


def cut(launcher, vertices, triangles, unit=1.0):
    surface = Surface(SurfaceMesh(vertices, triangles))
    return Facets(launcher, surface, unit, surface.part, surface.open_side)


def slivers():
    vertices = np.array([[0.0, 0, 0], [40, 0, 0], [40, 1, 0], [0, 30, 0], [20, 15, 12]])
    return vertices, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]])


def plate(x, y, cells=4):
    a, b = np.meshgrid(np.linspace(*x, cells + 1), np.linspace(*y, cells + 1), indexing="ij")
    number = np.arange(a.size).reshape(a.shape)
    corner = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], -1).reshape(-1, 4)
    faces = np.concatenate([corner[:, [0, 1, 2]], corner[:, [0, 2, 3]]])
    return np.stack([a.ravel(), b.ravel(), 0 * a.ravel()], axis=1), faces


def test_facets_cover_the_surface_and_none_is_long_or_slender(launcher):
    facets = cut(launcher, *slivers())
    assert facets.area.sum() == pytest.approx(facets.surface.area, rel=1e-9)
    side = np.linalg.norm(facets.corner - np.roll(facets.corner, 1, axis=1), axis=2).max(axis=1)
    assert side.max() <= FACET + 1e-9
    slender = side**2 / (2.0 * facets.area)
    assert (slender[side > TILE] <= MOST_SLENDER * (1 + 1e-9)).all()
    assert (side / facets.cuts).max() <= TILE * (1 + 1e-5)
    # Each lies where its weights say.
    place = facets.surface.position[facets.surface.triangle[facets.triangle]] - facets.middle
    np.testing.assert_allclose(np.einsum("fck,fkd->fcd", facets.weight, place), facets.corner, atol=1e-9)


@pytest.mark.parametrize("tip", [(4000.0, 0.05), (2000.0, 0.05), (-30.0, 0.4)], ids=["needle", "flat", "leaning"])
def test_needles_have_as_many_facets_as_they_are_long(launcher, tip):
    """Cut in halves again and again, the needle had 177,147."""
    vertices = np.array([[0.0, 0, 0], [4000, 0, 0], [*tip, 0]])
    facets = cut(launcher, vertices, np.array([[0, 1, 2]]))
    assert 4000.0 / TILE < facets.count < 8.0 * 4000.0 / TILE
    assert facets.area.sum() == pytest.approx(facets.surface.area, rel=1e-9)
    side = np.linalg.norm(facets.corner - np.roll(facets.corner, 1, axis=1), axis=2).max(axis=1)
    assert side.max() <= TILE * (1 + 1e-9)
    # None lies on another, or is turned over.
    first, second = facets.corner[:, 1] - facets.corner[:, 0], facets.corner[:, 2] - facets.corner[:, 0]
    assert (np.cross(first, second)[:, 2] > 0.0).all()
    place = facets.surface.position[facets.surface.triangle[facets.triangle]] - facets.middle
    np.testing.assert_allclose(np.einsum("fck,fkd->fcd", facets.weight, place), facets.corner, atol=1e-9)


def test_needles_that_share_a_long_side_are_cut_alike_along_it(launcher):
    vertices = np.array([[0.0, 0, 0], [100, 0, 0], [100, 0.3, 0], [100, -0.4, 0]])
    facets = cut(launcher, vertices, np.array([[0, 1, 2], [0, 3, 1]]))
    corner = facets.corner + facets.middle
    ends = [
        np.unique(corner[facets.triangle == k][np.abs(corner[facets.triangle == k][..., 1]) < 1e-9, 0]) for k in (0, 1)
    ]
    np.testing.assert_allclose(*ends, atol=1e-9)
    assert len(ends[0]) > 70


def test_tiles_are_finer_where_the_surface_ends(launcher):
    # Cells of 1.2 units: their sides and diagonals are those of tiles elsewhere.
    vertices, triangles = plate((0.0, 9.6), (0.0, 9.6), cells=8)
    facets = cut(launcher, vertices, triangles)
    at_end = (vertices[triangles][:, :, :2] % 9.6 < 1e-9).any(axis=(1, 2))[facets.triangle]
    side = np.linalg.norm(facets.corner - np.roll(facets.corner, 1, axis=1), axis=2).max(axis=1)
    assert (side[at_end] / facets.cuts[at_end]).max() <= TILE_AT_BEND * (1 + 1e-5)
    assert (facets.cuts[~at_end] == 2).all() and (~at_end).sum() > 20


@pytest.mark.parametrize(("degrees", "finer"), [(4.0, False), (12.0, True), (90.0, True)])
def test_tiles_are_finer_where_the_surface_bends(launcher, degrees, finer):
    vertices, triangles = plate((0.0, 9.6), (0.0, 9.6), cells=8)
    over = np.maximum(vertices[:, 0] - 4.8, 0.0)
    angle = np.radians(degrees)
    vertices = np.column_stack([vertices[:, 0] - over * (1.0 - np.cos(angle)), vertices[:, 1], -over * np.sin(angle)])
    facets = cut(launcher, vertices, triangles)
    x = np.column_stack(plate((0.0, 9.6), (0.0, 9.6), cells=8)[0].T)[triangles][:, :, 0][facets.triangle]
    y = vertices[triangles][:, :, 1][facets.triangle]
    inside = (y.min(axis=1) > 0.1) & (y.max(axis=1) < 9.5)
    beside = (np.abs(x - 4.8) < 1e-9).any(axis=1) & inside
    assert beside.sum() > 20
    assert (facets.cuts[beside] > 2).all() == finer


def test_fine_tiles_are_not_too_many(launcher, monkeypatch):
    vertices, triangles = plate((0.0, 9.6), (0.0, 9.6), cells=8)
    fine = cut(launcher, vertices, triangles).cuts
    monkeypatch.setattr(facets_module, "MOST_AT_BENDS", 600)
    few = cut(launcher, vertices, triangles).cuts
    assert few.min() == fine.min() == 2 < few.max() < fine.max()


def test_open_sides_follow_their_triangles(launcher):
    facets = cut(launcher, *slivers())
    end = np.roll(facets.corner, -2, axis=1) - np.roll(facets.corner, -1, axis=1)
    length = np.linalg.norm(end, axis=2)[facets.open_side].sum()
    vertices, triangles = slivers()
    surface = facets.surface
    side = np.linalg.norm(vertices[triangles][:, [2, 0, 1]] - vertices[triangles][:, [1, 2, 0]], axis=2)
    assert length == pytest.approx(side[surface.open_side].sum(), rel=1e-9)


def test_a_place_on_a_tile_is_found_again(launcher):
    facets = cut(launcher, *slivers(), unit=0.9)
    on_device = facets.for_kernels()
    count = facets.tile_count
    position, normal = launcher.empty(count, wp.vec3), launcher.empty(count, wp.vec3)
    label = launcher.empty(count, wp.int32)
    launcher.launch(kernels_facets.locate_tiles, count, [facets.count, on_device], [position, normal, label])
    facet, weight = facets.tiles(np.arange(facets.count))
    expected = np.einsum("nk,nkd->nd", weight, facets.corner[facet])
    np.testing.assert_allclose(position.numpy(), expected, atol=2e-5)
    # Several points of a tile lie around its middle, and stand for it.
    facet, weight = facets.tiles(np.arange(facets.count), 3)
    inner = np.einsum("nk,nkd->nd", weight, facets.corner[facet]).reshape(count, 9, 3)
    np.testing.assert_allclose(inner.mean(axis=1), expected, atol=1e-9)
    corners = [launcher.empty(facets.corner_count, kind) for kind in (wp.vec3, wp.vec3, wp.int32)]
    launcher.launch(kernels_facets.locate_corners, facets.corner_count, [facets.count, on_device], corners)
    far = np.linalg.norm(corners[0].numpy() - expected[corners[2].numpy()], axis=1)
    assert far.max() < TILE


def test_finer_cuts_change_only_their_facets(launcher):
    facets = cut(launcher, *slivers())
    before = facets.cuts.copy()
    facets.cut_finer(np.array([3]), 4)
    assert facets.cuts[3] == 4 * before[3]
    assert facets.tile_count == (facets.cuts**2).sum()
    np.testing.assert_allclose(np.bincount(facets.tiles(np.arange(facets.count))[0], facets.tile_area), facets.area)


def joined(launcher, *meshes, unit=0.1):
    surface = Surface([SurfaceMesh(*mesh) for mesh in meshes])
    return surface, *joined_parts(launcher, surface, unit)[:2]


def test_plates_that_touch_are_one_whatever_their_corners(launcher):
    surface, label, open_side = joined(launcher, plate((0, 1), (0, 1), 4), plate((1, 2), (0, 1), 7))
    assert label.max() == 0
    corner = surface.position[surface.triangle]
    for k in range(3):
        middle = 0.5 * (corner[:, (k + 1) % 3] + corner[:, (k + 2) % 3])
        inside = (middle[:, 0] > 0.5) & (middle[:, 0] < 1.5)
        at_seam = inside & (np.abs(middle[:, 1] - 0.5) < 0.499)
        assert not open_side[at_seam, k].any()
    assert open_side.sum() == 3 * 4 + 3 * 7


def test_plates_at_a_right_angle_are_one_and_plates_apart_are_not(launcher):
    flat, faces = plate((0, 1), (0, 1))
    upright = flat[:, [2, 1, 0]]
    assert joined(launcher, (flat, faces), (upright, faces))[1].max() == 0
    assert joined(launcher, (flat, faces), (flat + [1.1, 0, 0], faces))[1].max() == 1
    assert joined(launcher, (flat, faces), (flat + [0, 0, 0.05], faces))[1].max() == 1


def test_shells_in_one_another_are_apart_and_a_sticker_is_no_part_of_what_it_lies_on(launcher):
    mesh = trimesh.creation.icosphere(subdivisions=2)
    shell = np.array(mesh.vertices), np.array(mesh.faces)
    assert joined(launcher, shell, (shell[0] * 0.9, shell[1]))[1].max() == 1
    under = plate((0, 4), (0, 4))
    on = plate((1, 3), (1, 3))
    assert joined(launcher, under, (on[0] + [0, 0, 1e-4], on[1]))[1].max() == 1


def test_crumbs_see_each_other(launcher):
    flat, faces = plate((0, 0.1), (0, 0.1), 1)
    crumbs = [(flat + [0.2 * k, 0, 0], faces) for k in range(20)]
    assert joined(launcher, *crumbs)[1].max() == 0
    label = joined(launcher, plate((0, 4), (5, 9)), *crumbs)[1]
    assert label.max() == 1


@pytest.mark.parametrize("more", [[], [plate((0, 4), (5, 9))]])
def test_facets_of_a_crumb_come_one_after_the_other_so_that_each_gets_its_share(launcher, more):
    box = trimesh.creation.box((0.05, 0.05, 0.05))
    crumbs = [(np.array(box.vertices) + [0.2 * k, 0.3 * (k % 3), 0], np.array(box.faces)) for k in range(20)]
    surface = Surface([SurfaceMesh(*mesh) for mesh in more + crumbs])
    facets = Facets(launcher, surface, 0.1, *joined_parts(launcher, surface, 0.1)[:4])
    part = surface.part[facets.triangle]
    assert facets.label.max() == len(more)
    assert (np.diff(part) != 0).sum() == 19 + len(more)
    assert (np.diff(facets.label) != 0).sum() == len(more)


@wp.kernel
def step_and_compare(
    first: int,
    facet: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.vec2),
    way: wp.array(dtype=wp.vec3),
    facets: kernels_facets.Facets,
    # outputs
    within: wp.array(dtype=wp.int32),
    shown: wp.array(dtype=wp.vec3),
    stepped: wp.array(dtype=wp.vec3),
    on: wp.array(dtype=wp.int32),
):
    """Where points end on their facet, and where a step along the surface ends."""
    i = first + wp.tid()
    inside = kernels_facets.step_within(facet[i], weight[i], way[i], facets)
    within[i] = inside.facet
    shown[i] = inside.position
    new = kernels_facets.step_along(facet[i], weight[i], way[i], facets)
    stepped[i] = new.position
    on[i] = new.facet


def test_who_stays_on_a_facet_goes_as_along_the_surface(launcher):
    """To the last bit; and so do ways that lead out of the facet's plane, and beyond its sides."""
    mesh = trimesh.creation.icosphere(subdivisions=2)
    surface = Surface(SurfaceMesh(np.array(mesh.vertices), np.array(mesh.faces)))
    count, n = len(surface.triangle), 4000
    facets = Facets(launcher, surface, 0.1, np.zeros(count, int), np.zeros((count, 3), bool))
    rng = np.random.default_rng(5)
    facet = rng.integers(0, count, n).astype(np.int32)
    way = rng.normal(size=(n, 3)) * rng.choice([0.1, 1.0, 3.0], (n, 1))
    along = way - (way * facets.normal[facet]).sum(axis=1, keepdims=True) * facets.normal[facet]
    way = np.where(rng.random((n, 1)) < 0.8, along, way).astype(np.float32)
    given = [
        launcher.array(facet, wp.int32),
        launcher.array(rng.dirichlet(np.ones(3), n)[:, :2].astype(np.float32), wp.vec2),
        launcher.array(way, wp.vec3),
        facets.for_kernels(),
    ]
    within, shown, stepped, on = (launcher.empty(n, kind) for kind in (wp.int32, wp.vec3, wp.vec3, wp.int32))
    launcher.launch(step_and_compare, n, given, [within, shown, stepped, on])
    stays = within.numpy() >= 0
    assert 0.2 < stays.mean() < 0.95
    np.testing.assert_array_equal(on.numpy()[stays], facet[stays])
    np.testing.assert_array_equal(shown.numpy()[stays], stepped.numpy()[stays])
    assert (on.numpy() != facet)[~stays].mean() > 0.5
