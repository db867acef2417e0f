"""Figures of placements on surfaces, beside SciPy's."""

import time
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
import surface_meshes as meshes
import surface_metric as metric
import trimesh
import warp as wp
from esh.engine.device.devices import resolve_device
from esh.engine.device.launcher import Launcher
from esh.engine.heat import heat_mesh as heat_module
from esh.engine.heat.heat_mesh import HeatMesh
from esh.engine.problem.balance import Balance
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.placement import Placement
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.quality.bodies_on_surface import bodies_on_surface
from esh.engine.quality.kernels_sheets import on_one_sheet
from esh.engine.quality.measurement import measure
from esh.engine.quality.overlaps import MOST_OVERLAPS_PER_BODY, find_overlaps_on_surface
from esh.engine.quality.sheets import sheets_of
from esh.engine.solve import solve
from scipy.spatial import cKDTree


@pytest.fixture(scope="module")
def launcher():
    result = Launcher(resolve_device("cpu"))
    yield result
    result.close()


def random_points(surface, count, seed=0):
    rng = np.random.default_rng(seed)
    triangle = rng.choice(len(surface.triangle), count, p=surface.triangle_area / surface.area)
    weight = rng.dirichlet(np.ones(3), count)
    return surface.points(triangle, weight)


def placed(surface, points, area=1e-4):
    count = len(points.triangle)
    problem = Problem(surface, [BodyClass("a", [Size("s", area, count)])])
    mesh, triangle, barycentric = points.source()
    zero = np.zeros(count)
    tangent = np.cross(points.normal, [0.3, 0.5, 0.8])
    return Placement(
        problem,
        points.position,
        np.zeros(count, np.int32),
        np.zeros(count, np.int32),
        zero,
        zero,
        zero,
        normal=points.normal,
        tangent=tangent / np.linalg.norm(tangent, axis=1, keepdims=True),
        mesh=mesh,
        triangle=triangle,
        barycentric=barycentric,
    )


def on_vertices(launcher, heat, points):
    """What the vertices get of bodies of charge 1."""
    triangle = launcher.array(points.triangle.astype(np.int32), wp.int32)
    return heat.deposit.charges(triangle, launcher.array(points.barycentric, wp.vec3d), np.ones(len(points.triangle)))


@pytest.mark.parametrize("shape", ["torus", "rock"])
def test_coverage_errors_are_those_of_finite_elements_by_scipy(launcher, shape):
    mesh = getattr(meshes, shape)()
    surface = Surface(SurfaceMesh(*mesh))
    points = random_points(surface, 700)
    density = meshes.gradient(mesh[0])
    other = metric.SurfaceMetric(*mesh, 700)
    heat = HeatMesh(launcher, surface, 700)
    charges = on_vertices(launcher, heat, points)
    target = heat.target(lambda points: density(points.position))
    assert charges.numpy().sum() == pytest.approx(700.0)
    for k, expected in zip((1.0, 2.0, 4.0), other.coverage(points.position, density, (1.0, 2.0, 4.0)), strict=True):
        assert heat.error(charges, 700.0, target, 700, k) == pytest.approx(expected, rel=0.02)


def hull():
    """Of 30 points; two of its triangles have corners of 2 and 5 degrees."""
    mesh = trimesh.convex.convex_hull(np.random.default_rng(2).random((30, 3)))
    return np.array(mesh.vertices), np.array(mesh.faces)


@pytest.mark.parametrize("mesh", [hull(), meshes.thin_box(1024)], ids=["hull", "thin box"])
def test_slivers_are_no_walls_to_heat(mesh):
    """Coverage errors of even bodies were five to nine times too high."""
    problem = Problem(Surface(SurfaceMesh(*mesh)), [BodyClass("a", [Size("s", 1e-6, 1024)])])
    placement = solve(problem, device="cpu")
    expected = metric.SurfaceMetric(*mesh, 1024).coverage(placement.position, lambda place: np.ones(len(place)), (1.0,))
    assert placement.report.coverage_error == pytest.approx(expected[0], rel=0.3)


def test_a_rare_class_is_measured_on_a_mesh_of_its_own(launcher, monkeypatch):
    """Its heat went over the mesh for all bodies, by 900 steps: a report of 20,000 and 3 bodies took 77 s on slivers."""
    surface = Surface(SurfaceMesh(*meshes.square(10)))
    few, many = random_points(surface, 3, 1), random_points(surface, 4096, 2)
    triangle, weight = (np.concatenate([getattr(many, of), getattr(few, of)]) for of in ("triangle", "barycentric"))
    classes = [BodyClass(name, [Size("s", 1e-6, count)]) for name, count in (("many", 4096), ("few", 3))]
    both = replace(
        placed(surface, surface.points(triangle, weight), 1e-6),
        problem=Problem(surface, classes),
        class_index=np.repeat([0, 1], [4096, 3]).astype(np.int32),
    )
    steps = []
    chebyshev = heat_module._chebyshev

    def counted(half):
        steps.append(len(chebyshev(half)))
        return chebyshev(half)

    monkeypatch.setattr(heat_module, "_chebyshev", counted)
    error = measure(both, launcher).classes[1].coverage_error
    assert max(steps) < 400
    alone = HeatMesh(launcher, surface, 4099)
    assert error == pytest.approx(alone.error(on_vertices(launcher, alone, few), 3.0, alone.target(), 3), rel=0.02)


def test_heat_is_neither_lost_nor_made_and_spreads_as_a_gaussian(launcher):
    vertices, faces = meshes.square(40)
    surface = Surface(SurfaceMesh(vertices, faces))
    heat = HeatMesh(launcher, surface, 400)
    middle = np.argmin(np.linalg.norm(vertices[faces].mean(axis=1) - [0.5, 0.5, 0.0], axis=1))
    charge = on_vertices(launcher, heat, surface.points(np.array([middle]), np.ones((1, 3)) / 3.0))
    width, root = 0.06, heat._root.numpy()
    spread = heat._spread(charge, 1.0, heat.mixed([], []), 0.5 * width**2).numpy() / root
    assert (spread * root**2).sum() == pytest.approx(1.0, abs=1e-4)
    assert spread.max() == pytest.approx(1.0 / (2.0 * np.pi * width**2), rel=0.03)


def test_spacing_and_overlaps_are_those_of_all_pairs_of_one_side(launcher):
    mesh = meshes.thin_box(300)
    surface = Surface(SurfaceMesh(*mesh))
    points = random_points(surface, 300, 1)
    report = measure(placed(surface, points, 1e-3), launcher)
    apart = np.linalg.norm(points.position[:, None] - points.position, axis=2)
    other_side = points.normal @ points.normal.T < -0.1
    apart[other_side | np.eye(300, dtype=bool)] = np.inf
    hexagonal = np.sqrt(2.0 / np.sqrt(3.0) * surface.area / 300)
    assert report.smallest_spacing == pytest.approx(apart.min() / hexagonal, rel=1e-3)
    assert report.overlaps == (apart < 2.0 * (1.0 - 1e-3) * np.sqrt(1e-3 / np.pi)).sum() // 2
    assert report.covered == pytest.approx(0.3 / surface.area, rel=1e-3)


def test_the_deepest_overlap_is_told_with_its_bodies_and_its_place(launcher):
    """Of discs on a plane, beside arithmetic of their centers; two that are fixed do not count."""
    surface = Surface(SurfaceMesh(*meshes.square(6)))
    points = random_points(surface, 200, 7)
    radius = 0.03
    placement = placed(surface, points, np.pi * radius**2)
    fixed = np.zeros(200, bool)
    fixed[::3] = True
    report = measure(replace(placement, fixed=fixed), launcher)
    depth = 2.0 * radius - np.linalg.norm(points.position[:, None] - points.position, axis=2)
    depth[np.eye(200, dtype=bool) | (fixed[:, None] & fixed)] = 0.0
    # What only touches does not count.
    depth[depth < 1e-3 * 2.0 * radius] = 0.0
    i, j = np.unravel_index(np.argmax(depth), depth.shape)
    assert report.overlaps == (depth > 0.0).sum() // 2 > 100
    assert report.deepest_pair == (min(i, j), max(i, j))
    assert report.deepest_overlap == pytest.approx(depth.max(), rel=1e-4)
    np.testing.assert_allclose(report.deepest_place, points.position[[i, j]].mean(axis=0))
    assert set(report.overlapping) == set(np.flatnonzero(depth.any(axis=1)).tolist())
    deepest = depth.max(axis=1)[list(report.overlapping)]
    assert (np.diff(deepest) <= 1e-7).all()


def test_nothing_overlaps_where_nothing_does(launcher):
    surface = Surface(SurfaceMesh(*meshes.square(6)))
    report = measure(placed(surface, random_points(surface, 5, 1), 1e-8), launcher)
    assert (report.overlaps, report.deepest_overlap, report.deepest_pair, report.overlapping) == (0, 0.0, None, ())


def test_distances_are_those_of_neighbors_on_one_sheet(launcher):
    """Two squares that look up, one close above the other: what lies above has nothing to do with what lies below."""
    vertices, faces = meshes.square(8)
    height = 0.05
    surface = Surface([SurfaceMesh(vertices, faces), SurfaceMesh(vertices + [0.0, 0.0, height], faces)])
    count = 2 * len(faces)
    points = surface.points(np.arange(count), np.full((count, 3), 1.0 / 3.0))
    # Middles of triangles: the two of each of the eight by eight squares are nearest to each other.
    nearest = np.sqrt(2.0) / 3.0 / 8.0
    assert height < nearest
    report = measure(placed(surface, points, 1e-3), launcher)
    assert report.closest == pytest.approx(nearest, rel=1e-5)
    assert report.usual == pytest.approx(nearest, rel=1e-5)


@pytest.mark.parametrize(("lift", "met"), [(0.0, True), (0.2, False)])
def test_spacing_and_overlaps_are_those_across_the_foot_of_a_box_that_stands_on_the_ground(launcher, lift, met):
    ground, box = trimesh.creation.box((3.0, 3.0, 1.0)), trimesh.creation.box((1.0, 1.0, 1.0))
    box.apply_translation((0.0, 0.0, 0.5 + lift))
    top = ground.faces[ground.face_normals[:, 2] > 0.9]
    surface = Surface([SurfaceMesh(ground.vertices - (0.0, 0.0, 0.5), top), SurfaceMesh(box.vertices, box.faces)])
    count, radius = 600, 0.12
    points = random_points(surface, count, 5)
    report = measure(placed(surface, points, np.pi * radius**2), launcher)
    way = points.position[:, None] - points.position
    apart = np.linalg.norm(way, axis=2) + 1e-30
    # How far it leaves both planes, together: no farther than they are turned, and 60 degrees.
    leaves = np.arcsin(np.minimum(np.abs(np.einsum("ijk,ik->ij", way, points.normal)) / apart, 1.0))
    cosine = points.normal @ points.normal.T
    seen = (cosine >= -0.1) & (leaves + leaves.T <= np.arccos(np.clip(cosine, -1.0, 1.0)) + np.pi / 3.0)
    on_box = points.source()[0] == 1
    one_part = on_box[:, None] == on_box
    apart[np.eye(count, dtype=bool) | ~seen] = np.inf
    near = apart < 2.0 * radius * (1.0 - 1e-3)
    assert (near & ~one_part).sum() > 20
    assert report.overlaps == (near if met else near & one_part).sum() // 2
    assert report.closest == pytest.approx((apart if met else np.where(one_part, apart, np.inf)).min(), rel=1e-3)


def test_slivers_and_large_triangles_are_measured(launcher):
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 1e-5, 0]])
    surface = Surface(SurfaceMesh(vertices, [[0, 1, 4], [0, 4, 3], [4, 2, 3], [1, 2, 4]]))
    points = random_points(surface, 500, 2)
    error = measure(placed(surface, points), launcher).coverage_error
    # Independent random points.
    assert 0.2 < error < 0.45


def square(corner, side=1.0, cells=4, height=0.0):
    """A flat square of its own."""
    vertices, faces = meshes.square(cells)
    return SurfaceMesh(vertices * [side, side, 1.0] + [*corner, height], faces)


@pytest.mark.parametrize(
    ("parts", "one"),
    [
        # Side by side with other triangles; with a gap; a sticker on it; one above the other; two crumbs.
        ([square((0.0, 0.0)), square((1.0, 0.0), cells=7)], True),
        ([square((0.0, 0.0)), square((1.1, 0.0))], False),
        ([square((0.0, 0.0)), square((0.3, 0.3), 0.4, height=1e-3)], False),
        ([square((0.0, 0.0)), square((0.0, 0.0), height=0.05)], False),
        ([square((0.0, 0.0), 10.0), square((5.0, 5.0), 0.3, height=0.1), square((6.0, 5.0), 0.3, height=0.1)], None),
    ],
)
def test_parts_are_one_sheet_where_their_borders_meet(parts, one):
    surface = Surface(parts)
    with closing(Launcher(resolve_device("cpu"))) as launcher:
        sheet, _ = sheets_of(surface, 200, launcher)
    first = [sheet[surface.source == start][0] for start in np.cumsum([0, *(len(p.triangles) for p in parts[:-1])])]
    if one is None:
        assert first[1] == first[2] != first[0]
    else:
        assert bool(first[0] == first[1]) is one


@wp.kernel
def look(
    way: wp.array(dtype=wp.vec3d),
    normal: wp.array(dtype=wp.vec3d),
    other: wp.array(dtype=wp.vec3d),
    found: wp.array(dtype=wp.int32),
):
    i = wp.tid()
    found[i] = int(on_one_sheet(way[i], wp.length(way[i]), normal[i], other[i]))


@pytest.mark.parametrize(
    ("way", "other", "sheet"),
    [
        ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), True),
        # Round a ridge, and across a fold.
        ((1.0, 0.0, -0.4), (0.7, 0.0, 0.7), True),
        ((1.0, 0.0, 0.6), (-0.8, 0.0, 0.6), True),
        # On a rough surface; above it; on its other side.
        ((1.0, 0.0, 0.3), (0.0, 0.0, 1.0), True),
        ((0.5, 0.0, 0.8), (0.0, 0.0, 1.0), False),
        ((0.5, 0.0, 0.8), (0.3, 0.0, 0.95), False),
        ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), False),
    ],
)
def test_what_lies_above_a_sheet_does_not_overlap_what_lies_on_it(way, other, sheet):
    other = np.array(other) / np.linalg.norm(other)
    given = [wp.array([v], dtype=wp.vec3d, device="cpu") for v in (way, (0.0, 0.0, 1.0), tuple(other))]
    found = wp.zeros(1, dtype=wp.int32, device="cpu")
    wp.launch(look, dim=1, inputs=given, outputs=[found], device="cpu")
    assert bool(found.numpy()[0]) is sheet


def test_every_vertex_of_a_cut_surface_is_one_place_and_each_place_one_vertex(launcher):
    # Two corners of the last triangle are so near that they count as one.
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [-1, 0.5, 0], [0, 1 + 4e-7, 0]])
    surface = Surface(SurfaceMesh(vertices, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [4, 3, 5]]))
    assert len(surface.triangle) == 4
    heat = HeatMesh(launcher, surface, 500)
    vertex = heat._mesh.cut.vertex.numpy().reshape(4, -1)
    weight = heat._mesh.places
    place = np.einsum("pk,tkd->tpd", weight, surface.position[surface.triangle])
    assert heat._mesh.cut.cuts > 3
    np.testing.assert_array_equal(np.unique(vertex), np.arange(heat._mesh.vertex_count))
    rounded = np.round(place[:3].reshape(-1, 3), 9)
    where, number = np.unique(rounded, axis=0, return_inverse=True)
    pairs = np.unique(np.stack([vertex[:3].ravel(), number.ravel()], axis=1), axis=0)
    assert len(pairs) == len(where) == len(np.unique(vertex[:3]))


def test_a_narrow_band_is_measured_alike_on_coarse_and_fine_meshes(launcher):
    """Its edges run through few large triangles; and a spot may lie between all points that are looked at."""

    def error(levels, density, count):
        surface = Surface(SurfaceMesh(*meshes.sphere(levels)))
        body_class = BodyClass("a", [Size("s", 1e-6, count)], density)
        return measure(solve(Problem(surface, [body_class]), device="cpu", max_steps=60), launcher).coverage_error

    def band(points):
        return (np.abs(points.position[:, 2]) < 0.02).astype(float)

    def spot(points):
        return (np.linalg.norm(points.position - meshes.sphere(3)[0][5], axis=1) < 0.02).astype(float)

    errors = [error(levels, band, 200) for levels in (3, 4, 6)]
    assert max(errors) < 0.03
    assert error(3, spot, 30) < 0.05


def test_who_stands_beside_the_edge_of_a_density_is_as_close_as_the_others_there_say(launcher):
    corner = np.array([(0, 0, 0), (4, 0, 0), (4, 1, 0), (0, 1, 0)], float)
    surface = Surface(SurfaceMesh(corner, np.array([(0, 1, 2), (0, 2, 3)])))
    x, y = np.array([0.3, 0.7, 1.1, 1.5]), 0.02
    weight = np.column_stack([1.0 - x / 4.0, x / 4.0 - y, np.full(4, y)])
    # The last one stands where nobody is asked for.
    density = [lambda points: 1.0 * (points.position[:, 0] < 1.4), lambda points: 1.0 * (points.position[:, 0] < 1.6)]
    found = []
    for own in density:
        points = surface.points(np.zeros(4, int), weight)
        problem = Problem(surface, [BodyClass("a", [Size("s", 1e-4, 4)], own)])
        found.append(measure(replace(placed(surface, points), problem=problem), launcher).smallest_spacing)
    assert found[0] == pytest.approx(found[1] * np.sqrt(1.6 / 1.4), rel=0.02)


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])
def test_the_report_after_a_run_is_that_of_the_placement_alone(device, launcher):
    """Meshes that heat has spread on in the run are there already: nothing else makes a GPU take what bodies are known by before."""
    parts = [meshes.square(12, (0.0, 0.5)), meshes.square(7, (0.5, 1.0))]
    surface = Surface([SurfaceMesh(*part) for part in parts])
    classes = [BodyClass("a", [Size("s", 1e-6, 600)], lambda points: 1.0 + points.position[:, 1])]
    placement = solve(Problem(surface, classes), device=device)
    report = placement.report
    alone = measure(replace(placement, report=None), launcher)
    assert report.coverage_error == pytest.approx(alone.coverage_error, rel=1e-3)
    assert report.smallest_spacing == pytest.approx(alone.smallest_spacing, rel=1e-3)
    assert report.coverage_error < 0.01


def test_many_small_bodies_among_a_few_large_ones_are_counted_quickly(launcher, slowness):
    """Each small one saw all others within a large one's reach: of 86,000 bodies counting took minutes."""
    corners = 10.0 * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    ground = Surface(SurfaceMesh(corners, [[0, 1, 2], [0, 2, 3]]))
    grass, trees = BodyClass("grass", [Size("tuft", 1e-3, 40_000)]), BodyClass("trees", [Size("tree", 30.0, 4)])
    # The paper's weighting brings grass close to trees in so few steps.
    placement = solve(Problem(ground, [grass, trees], Balance(rare_emphasis=0.0), seed=1), device="cpu", max_steps=3)
    position, radius = placement.position, np.sqrt(placement.area / np.pi)
    large = placement.class_index == 1
    small, least = position[~large], 2e-3 * radius.min()
    pairs = len(cKDTree(small).query_pairs(2.0 * radius.min() - least))
    covered = 0
    for place, own in zip(position[large], radius[large], strict=True):
        covered += np.count_nonzero(own + radius.min() - np.linalg.norm(small - place, axis=1) > least)
    assert pairs > 1000 and covered > 1000
    start = time.process_time()
    found = find_overlaps_on_surface(placement, bodies_on_surface(placement, launcher), launcher)
    took = time.process_time() - start
    assert took < 2.0 * slowness()
    # Of a large one so many are counted at most.
    assert found.count == pairs + (covered + 4 * MOST_OVERLAPS_PER_BODY) // 2
