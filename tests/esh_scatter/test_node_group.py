"""The node group puts the right object on every point, turned and scaled by the point's attributes."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.classes.node_tree import parts_of, remove_group  # noqa: E402
from esh.esh_scatter.result.attributes import INSTANCE_INDEX, ROTATION, SCALE  # noqa: E402
from esh.esh_scatter.result.display import set_inputs  # noqa: E402
from esh.esh_scatter.result.node_group import build_node_group  # noqa: E402
from esh.esh_scatter.result.node_group_contents import (  # noqa: E402
    Finer,
    Followed,
    Rest,
    followed_in,
    made_of,
    placed_objects,
    show_input,
)
from esh.esh_scatter.targets.target import RESULT_TAG  # noqa: E402
from mathutils import Matrix, Quaternion  # noqa: E402

pytestmark = pytest.mark.usefixtures("bare_file")


def source(name, *, location=(0, 0, 0), turn=0.0, scale=1.0):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    item.location, item.rotation_euler, item.scale = location, (0, 0, turn), (scale,) * 3
    return item


def point_object(index, rotation, scale):
    count = len(index)
    mesh = bpy.data.meshes.new("Points")
    mesh.vertices.add(count)
    mesh.vertices.foreach_set("co", np.array([(i, 0, 0) for i in range(count)], np.float32).ravel())
    for name, kind, field, values in (
        (INSTANCE_INDEX, "INT", "value", np.array(index, np.int32)),
        (ROTATION, "QUATERNION", "value", np.array(rotation, np.float32)),
        (SCALE, "FLOAT_VECTOR", "vector", np.array(scale, np.float32)),
    ):
        mesh.attributes.new(name, kind, "POINT").data.foreach_set(field, values.ravel())
    item = bpy.data.objects.new("Points", mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def instances(item):
    """Name and matrix of every instance, by the point that it stands on."""
    found = {}
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.is_instance and instance.parent.original == item:
            matrix = instance.matrix_world.copy()
            key = round(matrix.translation.x)
            assert key not in found, "one instance on each point"
            found[key] = (instance.object.original.name, matrix)
    return found


def test_every_point_gets_its_object_turned_and_scaled():
    sources = [source("Z"), source("A", location=(50, 60, 70)), source("M", turn=0.4, scale=2.0)]
    index = [2, 0, 1, 1, 0, 2, 0]
    rng = np.random.default_rng(5)
    rotation = rng.normal(size=(len(index), 4))
    rotation /= np.linalg.norm(rotation, axis=1, keepdims=True)
    scale = rng.uniform(0.5, 2.0, (len(index), 1)).repeat(3, axis=1)
    item = point_object(index, rotation, scale)
    item.modifiers.new("Scatter", "NODES").node_group = build_node_group("Group", sources)
    found = instances(item)
    assert [found[point][0] for point in range(len(index))] == [sources[number].name for number in index]
    for point, number in enumerate(index):
        # The source's own turn and scale come first; where it stands does not matter.
        own = Matrix.Rotation(0.4, 4, "Z") @ Matrix.Scale(2.0, 4) if sources[number].name == "M" else Matrix.Identity(4)
        given = Matrix.LocRotScale((point, 0, 0), Quaternion(rotation[point]), scale[point].tolist())
        np.testing.assert_allclose(np.array(found[point][1]), np.array(given @ own), atol=1e-5)


def test_sources_stay_live():
    tree = source("Tree")
    item = point_object([0, 0], [(1, 0, 0, 0)] * 2, [(1, 1, 1)] * 2)
    item.modifiers.new("Scatter", "NODES").node_group = build_node_group("Group", [tree])
    assert instances(item)[1][1].to_scale().x == pytest.approx(1.0)
    tree.scale = (3, 3, 3)
    bpy.context.view_layer.update()
    assert instances(item)[1][1].to_scale().x == pytest.approx(3.0)


def test_a_point_whose_index_has_no_source_stays_empty():
    item = point_object([0, 7, -1], [(1, 0, 0, 0)] * 3, [(1, 1, 1)] * 3)
    item.modifiers.new("Scatter", "NODES").node_group = build_node_group("Group", [source("Tree")])
    assert set(instances(item)) == {0}


def test_classes_whose_names_are_longer_than_nodes_keep_are_shown_and_hidden_each_by_itself():
    """Of names of models that are bought, only the ends differ."""
    item = point_object([0, 1], [(1, 0, 0, 0)] * 2, [(1, 1, 1)] * 2)
    of_class = item.data.attributes.new("class_index", "INT", "POINT")
    of_class.data.foreach_set("value", np.array([0, 1], np.int32))
    classes = ["Meadow Grass Tall Variation LOD0 High Quality Atlas Plant 0001", "Сосна обыкновенная, высокая, 20 лет"]
    classes += [name[:-1] + "2" for name in classes]
    modifier = item.modifiers.new("Scatter", "NODES")
    modifier.node_group = build_node_group("Group", [source("Grass"), source("Pine")], classes)
    assert set(instances(item)) == {0, 1}
    set_inputs(modifier, {show_input(classes[0]): False, show_input(classes[3]): False})
    assert set(instances(item)) == {1}


def test_the_group_is_marked_as_ours_whatever_its_name_and_no_entry_of_add_modifier():
    source("Taken")
    first, second = build_node_group("Taken", []), build_node_group("Taken", [])
    assert first != second and first.get(RESULT_TAG) and second.get(RESULT_TAG)
    assert not first.is_modifier and first.users == 0


def nodes_in(group):
    """How many nodes a group has, and its parts, each once."""
    return {one.name: len(one.nodes) for one in [group, *inner(group)]}


def inner(group):
    found = parts_of(group)
    return dict.fromkeys(found + [deeper for part in found for deeper in inner(part)])


def test_no_tree_is_so_large_that_building_it_is_noticed():
    """With every node Blender looks at all nodes of a tree anew: 350 in one tree took two seconds, in which the window stood still."""
    tree = source("Tree")
    few = nodes_in(build_node_group("Few", [tree], ["A"], [Followed(tree, 3)]))
    many = build_node_group("Many", [tree] * 20, [f"Class {n}" for n in range(20)], [Followed(tree, 3)])
    assert max(few.values()) <= 30
    # One for each source, and one for each class.
    assert len(many.nodes) == few["Few"] + 2 * 19
    assert placed_objects(many) == [tree] * 20


def test_only_a_target_that_is_subdivided_has_nodes_for_finer_levels():
    tree = source("Tree")
    rest = Rest((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    told = [Followed(tree, 3, False, rest), Followed(tree, 9, True, rest, Finer(3, (25, 81)))]
    one, both = build_node_group("G", [], (), told[:1]), build_node_group("G", [], (), told)
    more = set(inner(both)) - set(inner(one)) - {parts_of(both)[0]}
    assert not any("Finer" in part.name or "Divided" in part.name for part in inner(one))
    names = ["Triangle of Divided Target", "Vertex of Finer Level", "Vertices of Finer Levels"]
    assert sorted(part.name for part in more) == [f".ESH Scatter {name}" for name in names]
    assert all(len(part.nodes) <= 30 for part in more)
    assert [found[1:] for found in followed_in(both)] == [asked[1:] for asked in told]
    assert len({made_of((), [asked]) for asked in (*told, told[1]._replace(finer=Finer(3, (25,))))}) == 3


def test_parts_are_shared_and_go_with_the_last_group_that_has_them():
    tree, collection = source("Tree"), bpy.data.collections.new("Trees")
    one, two = (build_node_group("G", [tree, collection], ["A"], [Followed(tree, 3)]) for _ in range(2))
    own = set(inner(one)) ^ set(inner(two))
    # What they follow is their own.
    assert sorted(part.name.partition(".0")[0] for part in own) == [".ESH Scatter Follow"] * 2
    assert placed_objects(two) == [tree, collection]
    remove_group(one)
    assert set(bpy.data.node_groups) == {two, *inner(two)}
    remove_group(two)
    assert not bpy.data.node_groups
