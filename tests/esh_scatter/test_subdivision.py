"""Which vertex of a mesh that is subdivided further in renders is which of those in the viewport."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.targets.subdivision import levels, read_subdivision  # noqa: E402

pytestmark = pytest.mark.usefixtures("bare_file")


def faces_of_all_kinds():
    """Quads, a triangle and a pentagon, one edge and one vertex by themselves; all is uneven."""
    corners = [
        (0, 0, 0),
        (2, 0, 0.2),
        (2, 2, 0),
        (0, 2, 0.4),
        (4, 0, 0),
        (4, 2, 0.3),
        (6, 1, 0),
        (1, 4, 0),
        (3, 4, 0.2),
    ]
    corners += [(-2, 1, 0), (9, 9, 9), (8, 8, 8), (7, 7, 6)]
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata(corners, [(11, 12)], [(0, 1, 2, 3), (1, 4, 2), (4, 6, 5, 8, 2), (3, 2, 8, 7), (0, 3, 9)])
    item = bpy.data.objects.new("Ground", mesh)
    bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item
    return item


def places(item):
    bpy.context.view_layer.update()
    mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    return np.array([vertex.co for vertex in mesh.vertices])


def divide(item, level, rendered, kind="SUBSURF"):
    modifier = item.modifiers.new("Divided", kind)
    if kind == "MULTIRES":
        for _ in range(rendered):
            bpy.ops.object.multires_subdivide(modifier=modifier.name, mode="CATMULL_CLARK")
    modifier.levels, modifier.render_levels = level, rendered
    bpy.context.view_layer.update()
    return modifier


def numbers_at(found, vertex, times):
    step, square = found.finer_numbers(vertex)
    return vertex + (times - 1) * (step + (times - 1) * square)


@pytest.mark.parametrize("kind", ["SUBSURF", "MULTIRES", "SIMPLE"])
@pytest.mark.parametrize("level", [0, 1, 2, 3])
def test_every_vertex_is_found_where_it_is_among_those_of_finer_levels(kind, level):
    item = faces_of_all_kinds()
    divided = divide(item, level, 5, "MULTIRES" if kind == "MULTIRES" else "SUBSURF")
    if kind == "SIMPLE":
        divided.subdivision_type = "SIMPLE"
    here, found = places(item), read_subdivision(item, bpy.context)
    for finer in range(level + 1, 6):
        divided.levels = finer
        there = places(item)
        assert found is not None and found.finer_counts()[finer - level - 1] == len(there)
        number = numbers_at(found, np.arange(len(here)), 2 ** (finer - level))
        assert len(np.unique(number)) == len(number)
        many = np.tile(np.arange(len(here)), (3, 1))
        np.testing.assert_array_equal(numbers_at(found, many, 2 ** (finer - level)), np.tile(number, (3, 1)))
        if level or kind == "SIMPLE":
            np.testing.assert_allclose(there[number], here, atol=1e-6)
        else:  # smoothing moves what was not smooth before
            np.testing.assert_array_equal(number, np.arange(len(here)))


@pytest.mark.parametrize("before", ["MIRROR", "SOLIDIFY", "ARRAY", "BEVEL", "TRIANGULATE", "SUBSURF", "WAVE"])
@pytest.mark.parametrize("level", [1, 2])
def test_what_makes_the_coarse_mesh_does_not_matter(before, level):
    item = faces_of_all_kinds()
    first = item.modifiers.new("Before", before)
    if before == "SUBSURF":
        first.render_levels = first.levels
    divided = divide(item, level, 3)
    here, found = places(item), read_subdivision(item, bpy.context)
    divided.levels = 3
    there = places(item)
    assert found is not None and len(there) in found.finer_counts()
    np.testing.assert_allclose(there[numbers_at(found, np.arange(len(here)), 2 ** (3 - level))], here, atol=1e-6)


@pytest.mark.parametrize("after", ["MIRROR", "SOLIDIFY", "ARRAY", "TRIANGULATE"])
@pytest.mark.parametrize("level", [0, 1, 2])
def test_nothing_is_known_of_what_is_numbered_anew_afterwards(after, level):
    item = faces_of_all_kinds()
    divide(item, level, 3)
    assert read_subdivision(item, bpy.context) is not None
    later = item.modifiers.new("After", after)
    bpy.context.view_layer.update()
    assert read_subdivision(item, bpy.context) is None
    later.show_viewport = later.show_render = False
    bpy.context.view_layer.update()
    assert read_subdivision(item, bpy.context) is not None


def test_nothing_is_known_where_more_than_the_last_level_may_differ_in_renders():
    item = faces_of_all_kinds()
    divide(item, 1, 2)
    assert read_subdivision(item, bpy.context) is not None
    item.modifiers.new("Wave", "WAVE").show_viewport = False
    assert read_subdivision(item, bpy.context) is not None, "other places, but the same vertices"
    mirror = item.modifiers.new("Mirror", "MIRROR")
    item.modifiers.move(2, 0)
    mirror.show_viewport = False
    bpy.context.view_layer.update()
    assert read_subdivision(item, bpy.context) is None
    item.modifiers.remove(mirror)
    second = divide(item, 1, 1)
    assert read_subdivision(item, bpy.context) is None
    second.levels = second.render_levels = 0
    bpy.context.view_layer.update()
    assert read_subdivision(item, bpy.context) is not None


def test_nothing_is_known_of_what_is_not_divided():
    item = faces_of_all_kinds()
    assert read_subdivision(item, bpy.context) is None
    divided = divide(item, 1, 2)
    divided.show_viewport = divided.show_render = False
    assert read_subdivision(item, bpy.context) is None


def test_levels_of_more_vertices_than_can_be_numbered_are_left_out():
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=100, y_subdivisions=100)
    item = bpy.context.object
    divide(item, 3, 4)
    counts = read_subdivision(item, bpy.context).finer_counts()
    assert len(counts) == 5 and 2**29 < counts[-1] < 2**31


def test_levels_are_those_that_the_scene_allows_and_none_where_a_modifier_is_hidden():
    item, render = faces_of_all_kinds(), bpy.context.scene.render
    divided = divide(item, 2, 4)
    assert levels(item, render) == [(2, 4)]
    divided.show_viewport = False
    assert levels(item, render) == [(0, 4)]
    render.use_simplify, render.simplify_subdivision, render.simplify_subdivision_render = True, 1, 3
    assert levels(item, render) == [(0, 3)]
    divided.show_viewport = True
    assert levels(item, render) == [(1, 3)]
    bpy.context.view_layer.update()
    found = read_subdivision(item, bpy.context)
    assert found.level == 1
    divided.show_viewport = divided.show_render = False
    assert levels(item, render) == []
