"""Surfaces as they are asked for: bad meshes, sides that look the wrong way, parts, points and densities."""

import numpy as np
import pytest
import trimesh
from esh.engine.errors import ProblemError
from esh.engine.problem.body_class import BodyClass
from esh.engine.problem.domain import Domain
from esh.engine.problem.line import Line
from esh.engine.problem.problem import Problem
from esh.engine.problem.size import Size
from esh.engine.problem.surface import Surface, SurfaceMesh
from esh.engine.problem.surface_density import SurfaceAttribute, SurfaceImage, SurfaceTriplanar
from esh.engine.quality.measurement import REPEATED
from esh.engine.solve import solve

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def box():
    mesh = trimesh.creation.box(extents=(1.0, 2.0, 3.0))
    return np.array(mesh.vertices), np.array(mesh.faces)


@pytest.mark.parametrize(
    ("vertices", "triangles", "sentence"),
    [
        (SQUARE, np.zeros((0, 3), int), '`triangles` of mesh "m" must have at least one triangle'),
        (SQUARE, [[0, 1, 4]], "must be indices of its 4 vertices; got 4"),
        (SQUARE, [[0, 1, -1]], "must be indices of its 4 vertices; got -1"),
        (SQUARE, [[0, 1, 1.5]], "must be whole numbers"),
        (SQUARE, [[0, 1, np.inf]], "must be indices of its 4 vertices; got inf"),
        (SQUARE, np.array([[0, 1, 2**64 - 1]], np.uint64), "must be indices of its 4 vertices; got about 1e19"),
        (SQUARE, [[0, 1, 2, 3]], r"must be an array of numbers of shape \[n, 3\]"),
        (SQUARE[:, :2], HALVES, r"`vertices` of mesh \"m\" must be an array of numbers of shape \[n, 3\]"),
        (np.where(SQUARE == 1, np.nan, SQUARE), HALVES, "must be finite"),
        ("rock", HALVES, "must be an array of numbers"),
    ],
)
def test_what_is_no_mesh_is_refused_in_a_sentence(vertices, triangles, sentence):
    with pytest.raises(ProblemError, match=sentence):
        SurfaceMesh(vertices, triangles, "m")


def test_vertices_that_no_triangle_has_may_be_anything():
    vertices = np.concatenate([SQUARE, [[np.nan, 0, 0]]])
    assert Surface(SurfaceMesh(vertices, HALVES)).area == pytest.approx(1.0)


def test_triangles_without_an_area_are_left_out_and_points_keep_their_numbers():
    triangles = np.array([[0, 0, 1], [0, 1, 2], [1, 1, 1], [0, 2, 3]])
    surface = Surface(SurfaceMesh(SQUARE, triangles))
    assert surface.area == pytest.approx(1.0)
    assert surface.source.tolist() == [1, 3]
    points = surface.points([1], [[0.2, 0.3, 0.5]])
    mesh, triangle, barycentric = points.source()
    assert (mesh[0], triangle[0]) == (0, 3)
    np.testing.assert_allclose(barycentric @ SQUARE[triangles[3]], points.position)


def test_triangles_that_a_mesh_has_twice_count_once_but_for_its_two_sides():
    vertices = np.concatenate([SQUARE, SQUARE])
    again = np.concatenate([HALVES, HALVES[:, [2, 0, 1]], HALVES + 4])
    surface = Surface(SurfaceMesh(vertices, again))
    assert surface.source.tolist() == [0, 1]
    assert surface.area == pytest.approx(1.0)
    # Another mesh may have another density there, and an outer side is not an inner one.
    assert Surface([SurfaceMesh(SQUARE, HALVES)] * 2).area == pytest.approx(2.0)
    assert Surface(SurfaceMesh(SQUARE, np.concatenate([HALVES, HALVES[:, ::-1]]))).area == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("other", "count"),
    [
        (SurfaceMesh(SQUARE, HALVES), 2),
        (SurfaceMesh(SQUARE[[2, 3, 0, 1]], HALVES), 2),
        (SurfaceMesh(SQUARE, HALVES[:1]), 1),
        (SurfaceMesh(SQUARE, HALVES[:, ::-1]), 0),
        (SurfaceMesh(SQUARE + [1, 0, 0], HALVES), 0),
        (SurfaceMesh(SQUARE[[1, 2, 3, 0]], HALVES), 0),
    ],
)
def test_the_report_says_where_a_mesh_lies_on_its_copy(other, count):
    surface = Surface([SurfaceMesh(SQUARE, HALVES), other])
    assert surface.repeated == count
    problem = Problem(surface, [BodyClass("c", [Size("s", 0.001, 100)])])
    assert (REPEATED in solve(problem, device="cpu", max_steps=2).report.notes) == (count > 0)


def test_a_mesh_of_lines_and_points_is_refused():
    with pytest.raises(ProblemError, match="must have an area"):
        Surface(SurfaceMesh(SQUARE, [[0, 0, 1], [1, 1, 1]]))


@pytest.mark.parametrize("extent", [1e-12, 1e15])
def test_extents_beyond_float32_are_refused(extent):
    with pytest.raises(ProblemError, match="extent must lie between"):
        Surface(SurfaceMesh(SQUARE * extent, HALVES))


def sheet(across, along, low, high, tilt=0.0):
    """A sheet of 1 m along y, between two places along x, that rises or folds back behind 0.5 m."""
    x, y = np.meshgrid(np.linspace(low, high, across + 1), np.linspace(0.0, 1.0, along + 1), indexing="ij")
    ahead = np.maximum(x - 0.5, 0.0)
    corner = np.stack([(x - ahead + np.cos(tilt) * ahead).ravel(), y.ravel(), (np.sin(tilt) * ahead).ravel()], axis=1)
    i, j = (index.ravel() for index in np.indices((across, along)))
    one = i * (along + 1) + j
    other = one + along + 1
    return corner, np.concatenate(
        [np.stack([one, other, other + 1], axis=1), np.stack([one, other + 1, one + 1], axis=1)]
    )


@pytest.mark.parametrize("tilt", [0.0, 0.5 * np.pi, -0.5 * np.pi])
@pytest.mark.parametrize("along", [9, 17, 100])
def test_meshes_that_touch_look_to_one_side(along, tilt):
    """Whether their corners match or not: of the smaller ones all bodies were on the back."""
    (vertices, triangles), other = sheet(4, 9, 0.0, 0.5), sheet(6, along, 0.5, 1.0, tilt)
    surface = Surface([SurfaceMesh(vertices, triangles[:, ::-1]), SurfaceMesh(*other)])
    assert np.flatnonzero(surface.turned).tolist() == list(range(len(triangles)))
    assert not Surface([SurfaceMesh(vertices, triangles), SurfaceMesh(*other)]).turned.any()


def test_what_lies_on_another_mesh_and_ends_where_it_does_looks_as_it_looked():
    surface = Surface([SurfaceMesh(*sheet(4, 9, 0.0, 0.5)), SurfaceMesh(*sheet(6, 17, 0.5, 0.9, np.pi))])
    assert not surface.turned.any()


@pytest.mark.parametrize("copies", [2, 3])
def test_a_sheet_that_is_there_twice_is_not_turned_round(copies):
    """Both have the border's sides, which run the same way: half of all bodies were on the back."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0.0, 1.0, 9), np.linspace(0.0, 1.0, 9)))
    _, triangles = sheet(8, 8, 0.0, 1.0)
    mesh = SurfaceMesh(np.stack([x, y, 0.1 * np.sin(3.0 * x + y)], axis=1), triangles)
    surface = Surface([mesh] * copies)
    assert not surface.turned.any()
    assert surface.repeated == (copies - 1) * len(triangles)


def test_triangles_that_look_the_other_way_than_most_are_turned_round():
    vertices, triangles = box()
    rng = np.random.default_rng(0)
    wrong = rng.permutation(len(triangles))[:4]
    triangles[wrong] = triangles[wrong][:, ::-1]
    surface = Surface(SurfaceMesh(vertices, triangles))
    assert np.flatnonzero(surface.turned).tolist() == sorted(wrong.tolist())
    # Of a box around its origin they look outwards.
    middle = vertices[triangles].mean(axis=1)
    assert ((middle * surface.normal).sum(axis=1) > 0.0).all()
    points = surface.points(np.arange(12), np.tile([0.5, 0.3, 0.2], (12, 1)))
    mesh, triangle, barycentric = points.source()
    np.testing.assert_allclose(np.einsum("nk,nkd->nd", barycentric, vertices[triangles[triangle]]), points.position)
    again = surface.locate(mesh, triangle, barycentric)
    np.testing.assert_array_equal(again.triangle, points.triangle)
    np.testing.assert_allclose(again.barycentric, points.barycentric)


def test_edges_of_three_triangles_and_corners_alone_are_no_mistake():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
    surface = Surface(SurfaceMesh(vertices, [[0, 1, 2], [0, 1, 3], [0, 1, 4]]))
    assert surface.area == pytest.approx(1.5)
    assert surface.part.max() == 0


def test_parts_are_told_apart_by_shared_places_and_open_sides_by_single_triangles():
    twice = np.concatenate([SQUARE, SQUARE + [0, 0, 5]])
    surface = Surface(SurfaceMesh(twice, np.concatenate([HALVES, HALVES + 4])))
    assert surface.part.tolist() == [0, 0, 1, 1]
    assert surface.open_side.sum() == 8
    # Corners that lie in one place are one, whether they are numbered as one or not.
    apart = SQUARE[HALVES].reshape(-1, 3)
    assert Surface(SurfaceMesh(apart, np.arange(6).reshape(2, 3))).open_side.sum() == 4


def test_samples_stand_for_equal_areas():
    vertices, triangles = box()
    surface = Surface(SurfaceMesh(vertices, triangles))
    points = surface.sample(20_000)
    share = np.bincount(points.triangle, minlength=12) / 20_000
    np.testing.assert_allclose(share, surface.triangle_area / surface.area, atol=1e-4)
    assert (np.abs(points.barycentric.mean(axis=0) - 1 / 3) < 0.01).all()


def problem_of(density, mesh=None, **settings):
    mesh = mesh or SurfaceMesh(SQUARE, HALVES)
    return Problem(Surface(mesh), [BodyClass("moss", [Size("tuft", 0.001, 10)], density, **settings)])


@pytest.mark.parametrize(
    ("density", "sentence"),
    [
        (
            np.ones((4, 4)),
            r"must be a number or a function of points on a surface, such as SurfaceImage\(image\); got an image",
        ),
        (lambda points: np.zeros(len(points.triangle)), "must be above 0 somewhere on the surface"),
        (lambda points: points.position[:, 0] - 0.5, "must be 0 or more everywhere"),
        (lambda points: np.full(len(points.triangle), np.nan), "must be finite everywhere"),
        (lambda points: points.position, "must return one value per point"),
        (lambda points: None, "must return numbers; it returned None"),
        (lambda points: [object()] * len(points.triangle), "must return numbers; it returned"),
        (lambda points: ["a", [1.0]], "must return numbers; it returned"),
        (
            SurfaceAttribute("moos"),
            '`density` of class "moss" must name an attribute of the surface\'s meshes, which have none; got "moos"',
        ),
        (SurfaceImage(np.ones((2, 2))), '`density` of class "moss" needs a UV map, and mesh "mesh" has none'),
    ],
)
def test_what_is_no_density_on_a_surface_is_refused_in_a_sentence(density, sentence):
    with pytest.raises(ProblemError, match=sentence):
        problem_of(density)


def test_what_surfaces_do_not_have_yet_is_refused_in_a_sentence():
    stick = Size("stick", 0.001, 10, line=Line(0.1, 0.3))
    with pytest.raises(
        ProblemError, match=r'`line.direction` of size "stick" of class "a" must be "density", "none", "slope"'
    ):
        Problem(Surface(SurfaceMesh(SQUARE, HALVES)), [BodyClass("a", [stick])])
    with pytest.raises(ProblemError, match="needs a Surface as `domain`; got a Domain"):
        Problem(Domain((1.0, 1.0)), [BodyClass("a", [Size("s", 0.001, 10)], lambda points: points.position[:, 0])])


def test_counts_that_cover_follow_the_mean_of_the_density():
    vertices, triangles = box()
    surface = Surface(SurfaceMesh(vertices, triangles))
    half = BodyClass("a", [Size("s", 0.01)], lambda points: (points.position[:, 2] > 0.0).astype(float), count="cover")
    counted = Problem(surface, [half]).classes[0].body_count
    assert counted == pytest.approx(0.5 * 22.0 / 0.01, rel=2e-3)


def test_attributes_are_interpolated_by_vertex_and_constant_by_triangle():
    mesh = SurfaceMesh(SQUARE, HALVES, attributes={"x": SQUARE[:, 0], "side": [1.0, 3.0], "color": SQUARE * 255})
    surface = Surface(mesh)
    points = surface.sample(1000)
    np.testing.assert_allclose(points.attribute("x"), points.position[:, 0], atol=1e-12)
    np.testing.assert_array_equal(points.attribute("side"), np.where(points.triangle == 0, 1.0, 3.0))
    assert SurfaceAttribute("color")(points).max() > 100.0


def test_images_lie_on_uv_maps_the_right_way_up_and_along_three_axes():
    image = np.array([[0.0, 1.0], [2.0, 3.0]])
    mesh = SurfaceMesh(SQUARE, HALVES, uv=SQUARE[:, :2])
    points = Surface(mesh).points([0, 0, 1], [[0.5, 0.25, 0.25], [0, 0.5, 0.5], [0, 0.5, 0.5]])
    # At the middles of the pixels: (0.25, 0.25) is below on the left.
    at = Surface(mesh).points([0, 1], [[0.25, 0.5, 0.25], [0.25, 0.25, 0.5]])
    np.testing.assert_allclose(at.position[:, :2], [[0.75, 0.25], [0.25, 0.75]])
    np.testing.assert_allclose(SurfaceImage(image)(at), [3.0, 0.0])
    assert SurfaceImage(image)(points).shape == (3,)
    # Its borders go on as they are, where the map does not go beyond it.
    corner = Surface(mesh).points([0, 0], [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(corner.position[:, :2], [[0.0, 0.0], [1.0, 1.0]])
    np.testing.assert_allclose(SurfaceImage(image)(corner), [2.0, 1.0])
    twice = Surface(SurfaceMesh(SQUARE, HALVES, uv=2.0 * SQUARE[:, :2]))
    repeated = twice.points([0, 0], [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(SurfaceImage(image)(repeated), 1.5)
    # From above a triplanar image lies as it does through this map.
    np.testing.assert_allclose(SurfaceTriplanar(image, 1.0)(at), [3.0, 0.0])
