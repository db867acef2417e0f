"""The chart from above: how much surface lies in every cell, what is read there, and where points are found to."""

import numpy as np
import pytest
from esh.engine.errors import ProblemError
from esh.engine.surface.chart import SMALLEST_COSINE, Chart
from esh.engine.surface.top_view import TopView
from esh.engine.surface.triangle_mesh import TriangleMesh


def triangles(position, triangle, **more):
    """A mesh of triangles whose corners have the normals of their faces, and corner numbers of their own."""
    position, triangle = np.array(position, np.float64), np.array(triangle, np.int32)
    edge = position[triangle[:, 1:]] - position[triangle[:, :1]]
    normal = np.cross(edge[:, 0], edge[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    corner = np.arange(triangle.size, dtype=np.int32).reshape(-1, 3)
    face = np.arange(len(triangle), dtype=np.int32)
    corner_normal = normal.repeat(3, axis=0).astype(np.float32)
    return TriangleMesh('target "Ground"', position, triangle, corner, face, corner_normal, **more)


def slope(degrees=0.0, width=10.0, height=5.0, **more):
    """A rectangle, seen from above ``width`` by ``height``, that rises along x."""
    rise = width * np.tan(np.radians(degrees))
    corners = [(2, 3, 0), (2 + width, 3, rise), (2 + width, 3 + height, rise), (2, 3 + height, 0)]
    return triangles(corners, [(0, 1, 2), (0, 2, 3)], **more)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0])
def test_cells_hold_the_area_of_the_surface(degrees):
    chart = Chart(slope(degrees), resolution=64)
    assert chart.shape == (32, 64)
    np.testing.assert_allclose([*chart.origin, *chart.size], [2, 3, 10, 5])
    expected = 50.0 / np.cos(np.radians(degrees))
    assert chart.area.sum() == pytest.approx(expected, rel=1e-9)
    np.testing.assert_allclose(chart.stretch, 1.0 / np.cos(np.radians(degrees)))


def test_a_cliff_counts_as_no_steeper_than_the_steepest():
    assert Chart(slope(88.0), resolution=16).area.sum() == pytest.approx(50.0 / SMALLEST_COSINE)


def test_a_disc_has_cells_only_where_it_is():
    angle = np.arange(200) * (2.0 * np.pi / 200)
    corners = [(0.0, 0.0, 0.0), *np.stack([3.0 * np.cos(angle), 3.0 * np.sin(angle), 0.0 * angle], axis=1).tolist()]
    fan = [(0, 1 + i, 1 + (i + 1) % 200) for i in range(200)]
    chart = Chart(triangles(corners, fan), resolution=256)
    assert chart.area.sum() == pytest.approx(9.0 * np.pi, rel=0.005)
    assert not chart.area[0, 0] and chart.area[128, 128] > 0.0


def test_the_topmost_surface_is_seen_whichever_way_its_faces_look():
    low = [(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0)]
    # Above its left half lies another sheet, drawn from below.
    high = [(0, 0, 2), (2, 0, 2), (2, 4, 2), (0, 4, 2)]
    mesh = triangles(low + high, [(0, 1, 2), (0, 2, 3), (4, 6, 5), (4, 7, 6)])
    view = TopView(mesh)
    assert view.cast(np.array([[1.0, 1.0], [3.0, 1.0], [5.0, 1.0]]))[0].tolist() == [2, 0, -1]
    found = Chart(mesh, resolution=32).surface_points(np.array([[1.0, 1.0], [3.0, 1.0]]))
    np.testing.assert_allclose(found.position[:, 2], [2.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(found.normal, [[0, 0, 1], [0, 0, 1]], atol=1e-9)


def test_points_are_lifted_straight_up_onto_the_surface():
    chart = Chart(slope(40.0), resolution=64)
    position = np.random.default_rng(0).uniform(0.0, [10.0, 5.0], (300, 2))
    found = chart.surface_points(position)
    np.testing.assert_allclose(found.position[:, :2], position + [2.0, 3.0], atol=1e-9)
    np.testing.assert_allclose(found.position[:, 2], position[:, 0] * np.tan(np.radians(40.0)), atol=1e-9)
    expected = [-np.sin(np.radians(40.0)), 0.0, np.cos(np.radians(40.0))]
    np.testing.assert_allclose(found.normal, np.tile(expected, (300, 1)), atol=1e-6)
    np.testing.assert_allclose(found.rectangle_coordinates, position / [10.0, 5.0], atol=1e-9)


def test_points_beside_the_surface_come_to_its_nearest_point():
    mesh = triangles([(0, 0, 1), (4, 0, 1), (0, 4, 1)], [(0, 1, 2)])
    found = Chart(mesh, resolution=64).surface_points(np.array([[2.05, 2.05]])).position
    np.testing.assert_allclose(found, [[2.0, 2.0, 1.0]], atol=1e-5)


def test_what_the_mesh_says_is_interpolated_within_its_faces():
    weights = np.array([0, 1, 1, 0], np.float32)
    colors = np.tile(np.array([[1, 1, 1, 1], [0, 0, 0, 1]], np.float32), (3, 1))
    mesh = slope(
        vertex_group={"right": weights},
        attribute={"face": ("FACE", np.array([5, 7], np.float32)), "color": ("CORNER", colors)},
        uv_map={"map": np.array([(0, 0), (0, 1), (1, 1), (0, 0), (1, 1), (1, 0)], np.float32)},
        active_uv_map="map",
    )
    points = Chart(mesh, resolution=64).surface_points(np.array([[2.5, 1.0], [7.5, 2.0], [2.5, 4.0]]))
    np.testing.assert_allclose(points.vertex_group("right", "k"), [0.25, 0.75, 0.25], atol=1e-6)
    np.testing.assert_allclose(points.attribute("face", "k"), [5, 5, 7])
    # u of this map runs along y, v along x.
    np.testing.assert_allclose(points.uv("", "k"), [[0.2, 0.25], [0.4, 0.75], [0.8, 0.25]], atol=1e-6)
    first = points.weight @ [1, 0, 1]
    assert points.attribute("color", "k")[0] == pytest.approx(first[0], abs=1e-6)
    for ask in (points.uv, points.vertex_group, points.attribute):
        with pytest.raises(ProblemError, match=r'key: target "Ground" has no .* "gone"; it has "'):
            ask("gone", "key")


def test_coordinates_in_a_uv_map_are_those_of_the_mesh_that_is_seen_now():
    corners = np.array([(0, 0), (0, 1), (1, 1), (0, 0), (1, 1), (1, 0)], np.float32)
    first = Chart(slope(uv_map={"kept": corners, "moved": corners}, active_uv_map="kept"), resolution=16)
    before = first.points.uv("", "k"), first.points.uv("moved", "k"), first.points.rectangle_coordinates
    mesh = slope(uv_map={"kept": corners, "moved": corners + 1}, active_uv_map="moved")
    points = first.with_mesh(mesh).points
    assert points.uv("kept", "k") is before[0] and points.rectangle_coordinates is before[2]
    np.testing.assert_allclose(points.uv("", "k"), before[1] + 1, atol=1e-6)
    with pytest.raises(ProblemError, match="needs a UV map"):
        first.with_mesh(slope()).points.uv("kept", "k")
    with pytest.raises(ValueError, match="read-only"):
        before[0][0] = 0.0


def test_density_images_have_their_top_at_the_largest_y():
    chart = Chart(slope(0.0), resolution=64)
    image = chart.continued(chart.points.position[:, 1])
    assert image.shape == chart.shape
    np.testing.assert_allclose(image[:, 0], 3.0 + 5.0 * (np.arange(32)[::-1] + 0.5) / 32, atol=1e-5)


def test_beside_the_surface_values_go_on_without_an_edge():
    mesh = triangles([(0, 0, 0), (10, 0, 0), (0, 10, 0)], [(0, 1, 2)])
    chart = Chart(mesh, resolution=64)
    position = chart.points.position
    values = 2.0 + position[:, 0] - position[:, 1]
    image = chart.continued(values)
    np.testing.assert_array_equal(image[chart.area > 0.0], values.astype(np.float32))
    assert values.min() - 1e-5 <= image.min() and image.max() <= values.max() + 1e-5
    # Across the border it changes by a few cells' worth, where zeros would make a cliff of up to 12.
    inside = chart.area > 0.0
    steps = [np.abs(np.diff(image, axis=axis))[np.diff(inside, axis=axis)] for axis in (0, 1)]
    assert max(step.max() for step in steps) < 4 * 10.0 / 64
    np.testing.assert_array_equal(chart.continued(np.full(len(values), 0.3)), np.float32(0.3))


@pytest.mark.parametrize(
    ("corners", "words"),
    [
        ([(0, 0, 0), (1, 0, 0), (1, 0, 1)], "extent in x and y seen from above; in y it has none"),
        ([(0, 0, 0), (1, 1, 0), (1, 1, 1)], "all of them are vertical"),
    ],
)
def test_what_is_not_seen_from_above_is_said(corners, words):
    with pytest.raises(ProblemError, match=words):
        Chart(triangles(corners, [(0, 1, 2)]))


def test_whoever_lies_in_a_cell_with_surface_stays_where_it_is():
    """Of cells that the border cuts a part is beside the surface: what lay there was drawn to the border, into others."""
    chart = Chart(triangles([(0.0, 0.0, 0.0), (7.0, 1.0, 0.0), (2.0, 6.0, 2.0)], [(0, 1, 2)]), resolution=64)
    row, column = np.nonzero(chart.stretch)
    assert len(row) > 0.9 * (chart.area > 0.0).sum()
    rng = np.random.default_rng(0)
    chosen = np.tile(np.arange(len(row)), 20)
    x, y = rng.random((2, len(chosen)))
    position = np.column_stack([column[chosen] + x, chart.shape[0] - 1 - row[chosen] + y]) * chart.cell
    np.testing.assert_allclose(chart.surface_points(position).position[:, :2] - chart.origin, position, atol=1e-6)


def test_a_surface_as_narrow_as_its_cells_keeps_them():
    chart = Chart(triangles([(0.0, 0.0, 0.0), (7.0, 6.9, 0.0), (6.9, 7.0, 0.0)], [(0, 1, 2)]), resolution=64)
    np.testing.assert_array_equal(chart.stretch > 0.0, chart.area > 0.0)
