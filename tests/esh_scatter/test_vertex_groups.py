"""Vertex groups are read as Blender's own list of every vertex has them, whatever the object's modifiers, and nothing stays behind."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.targets import vertex_groups  # noqa: E402
from esh.esh_scatter.targets.vertex_groups import _copying_group, list_weights, read_vertex_groups  # noqa: E402


@pytest.fixture
def ball():
    """A sphere with three groups of different vertices; some are in all, some in none."""
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2)
    item = bpy.context.object
    rng = np.random.default_rng(3)
    for name in ("grass", "position", "0"):
        group = item.vertex_groups.new(name=name)
        for vertex in rng.permutation(len(item.data.vertices))[:15].tolist():
            group.add([vertex], float(rng.random()), "REPLACE")
    return item


def evaluated(item):
    return item.evaluated_get(bpy.context.evaluated_depsgraph_get())


def listed(item, name):
    """Weights as Blender's list of every vertex has them."""
    group = item.vertex_groups[name].index
    made = evaluated(item).to_mesh()
    return np.array([sum(e.weight for e in vertex.groups if e.group == group) for vertex in made.vertices], np.float32)


def everything():
    return {kind: set(getattr(bpy.data, kind)) for kind in ("meshes", "objects", "scenes", "node_groups", "worlds")}


def add_nothing(item):
    pass


def add_subdivision(item):
    item.modifiers.new("Subdivision", "SUBSURF").levels = 1


def add_mirror_and_cut(item):
    item.modifiers.new("Mirror", "MIRROR").use_axis = (True, False, False)
    item.modifiers.new("Decimate", "DECIMATE").ratio = 0.5


def enter_edit_mode(item):
    bpy.ops.object.mode_set(mode="EDIT")


def enter_weight_paint(item):
    bpy.ops.object.mode_set(mode="WEIGHT_PAINT")


def subdivide_and_enter_weight_paint(item):
    add_subdivision(item)
    enter_weight_paint(item)


def add_to_another_scene(item):
    bpy.data.scenes.new("Other").collection.objects.link(item)


@pytest.mark.parametrize(
    "change",
    [
        add_nothing,
        add_subdivision,
        add_mirror_and_cut,
        enter_edit_mode,
        enter_weight_paint,
        subdivide_and_enter_weight_paint,
        add_to_another_scene,
    ],
)
def test_weights_are_those_of_every_vertex(ball, change):
    change(ball)
    names = ["0", "grass", "position"]
    before, active = everything(), (bpy.context.scene, bpy.context.view_layer, bpy.context.mode)
    read = read_vertex_groups(evaluated(ball), evaluated(ball).to_mesh(), names, bpy.context)
    assert list(read) == names
    for name, weights in read.items():
        assert 0.0 < weights.max() <= 1.0 and (weights == 0.0).any()
        np.testing.assert_array_equal(weights, listed(ball, name))
    assert everything() == before
    assert (bpy.context.scene, bpy.context.view_layer, bpy.context.mode) == active


@pytest.mark.parametrize("nodes", [False, True])
def test_while_weights_are_painted_nothing_is_made_in_the_file(ball, monkeypatch, nodes):
    if nodes:
        # They may bring groups of others, by which the numbers of groups are other ones.
        ball.modifiers.new("Nodes", "NODES")
    enter_weight_paint(ball)
    made = []
    monkeypatch.setattr(vertex_groups, "_copying_group", lambda count: made.append(count) or _copying_group(count))
    read = read_vertex_groups(evaluated(ball), evaluated(ball).to_mesh(), ["grass"], bpy.context)
    np.testing.assert_array_equal(read["grass"], listed(ball, "grass"))
    assert bool(made) == nodes == (not vertex_groups.can_be_listed(evaluated(ball)))


def test_no_group_is_no_work_and_a_group_without_weights_is_zero(ball):
    before = everything()
    assert read_vertex_groups(evaluated(ball), ball.data, [], bpy.context) == {}
    ball.vertex_groups.new(name="empty")
    bpy.context.view_layer.update()
    for mode in ("OBJECT", "WEIGHT_PAINT"):
        bpy.ops.object.mode_set(mode=mode)
        read = read_vertex_groups(evaluated(ball), evaluated(ball).to_mesh(), ["empty"], bpy.context)
        np.testing.assert_array_equal(read["empty"], 0.0)
    assert everything() == before


def test_meshes_without_vertices_or_without_any_weights_are_listed():
    bpy.ops.wm.read_homefile(use_empty=True)
    for count in (0, 3):
        mesh = bpy.data.meshes.new("Loose")
        mesh.from_pydata([(float(number), 1.0, 2.0) for number in range(count)], [], [])
        item = bpy.data.objects.new("Loose", mesh)
        item.vertex_groups.new(name="empty")
        (weights,) = list_weights(mesh, [0])
        np.testing.assert_array_equal(weights, np.zeros(count, np.float32))
