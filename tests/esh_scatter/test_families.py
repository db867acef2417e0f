"""Objects that belong together are placed as one: a trunk with its leaves, what an empty shows or holds."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.editing import families  # noqa: E402

pytestmark = pytest.mark.usefixtures("empty_file")


def box(name, size, place=(0.0, 0.0, 0.0), parent=None):
    bpy.ops.mesh.primitive_cube_add(size=size, location=place)
    item = bpy.context.object
    item.name = name
    if parent is not None:
        item.parent, item.matrix_parent_inverse = parent, parent.matrix_world.inverted()
    return item


@pytest.fixture
def ground():
    bpy.ops.mesh.primitive_plane_add(size=30.0)
    return bpy.context.object


def empty(name, collection=None):
    item = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(item)
    if collection is not None:
        item.instance_type, item.instance_collection = "COLLECTION", collection
    return item


def select(*items, active):
    bpy.context.view_layer.update()
    for item in bpy.context.scene.objects:
        item.select_set(item in items)
    bpy.context.view_layer.objects.active = active


def instanced():
    """Names of what is shown as instances, and where, shape ``[n, 3]``."""
    shown = bpy.context.evaluated_depsgraph_get().object_instances
    found = [(one.object.name, one.matrix_world.translation[:]) for one in shown if one.is_instance]
    return [name for name, _ in found], np.array([place for _, place in found])


@pytest.mark.parametrize("picked", ["both", "trunk"])
def test_a_trunk_with_leaves_that_hang_on_it_stays_a_tree(ground, picked):
    trunk = box("Trunk", 0.4, (-40.0, 0.0, 0.0))
    leaves = box("Leaves", 1.0, (-40.0, 0.0, 2.0), trunk)
    select(trunk, *([leaves] if picked == "both" else []), ground, active=ground)
    bpy.ops.esh.scatter_selection(most=20)
    scatter = bpy.context.scene.esh_scatter.active
    assert [c.name for c in scatter.classes] == ["Trunk"]
    assert scatter.classes[0].sizes[0].source_kind == "ASSET"
    names, place = instanced()
    assert names.count("Trunk") == names.count("Leaves") == scatter.classes[0].count == 20
    trunks, tops = (place[np.array(names) == name] for name in ("Trunk", "Leaves"))
    gap = np.linalg.norm(tops[:, None] - trunks[None], axis=-1).min(axis=1)
    np.testing.assert_allclose(gap, 2.0, atol=1e-4, err_msg="leaves stay above their trunks")
    before = len(bpy.data.collections)
    bpy.ops.esh.classes_from_selection()
    assert len(bpy.data.collections) == before, "the same family has one collection"


@pytest.mark.parametrize("gone", ["Trunk", "Leaves"])
def test_a_tree_of_which_something_was_deleted_is_not_scattered_in_silence(ground, gone):
    trunk = box("Trunk", 0.4, (-40.0, 0.0, 0.0))
    box("Leaves", 1.0, (-40.0, 0.0, 2.0), trunk)
    select(trunk, ground, active=ground)
    bpy.ops.esh.scatter_selection(most=10)
    scatter = bpy.context.scene.esh_scatter.active
    assert not scatter.left_out()
    select(bpy.data.objects[gone], active=bpy.data.objects[gone])
    bpy.ops.object.delete()
    assert scatter.left_out() == [f'Trunk is left out: "{gone}" was deleted; choose another object to place']
    if gone == "Leaves":
        select(trunk, ground, active=ground)
        bpy.ops.esh.classes_from_selection()
        assert scatter.classes[1].sizes[0].source_object == trunk, "nothing hangs on it any more"


def test_leaves_alone_are_placed_alone_and_what_hangs_on_the_ground_is_no_part_of_it(ground):
    trunk = box("Trunk", 0.4)
    leaves = box("Leaves", 1.0, parent=trunk)
    stone = box("Stone", 0.3, parent=ground)
    assert families.as_placed(families.heads_in([leaves, stone, ground], [ground]), [ground]) == [leaves, stone]


def test_what_an_empty_shows_is_placed_as_one(ground):
    shown = bpy.data.collections.new("Bush")
    part = box("Twig", 0.5)
    bpy.context.collection.objects.unlink(part)
    shown.objects.link(part)
    select(empty("Instance", shown), ground, active=ground)
    assert bpy.ops.esh.scatter_selection(most=10) == {"FINISHED"}
    scatter = bpy.context.scene.esh_scatter.active
    assert (scatter.classes[0].name, scatter.classes[0].sizes[0].source_collection) == ("Bush", shown)
    assert instanced()[0].count("Twig") >= 10


def test_an_empty_is_placed_only_with_what_hangs_on_it(ground):
    alone, holder = empty("Alone"), empty("Model")
    wheel = box("Wheel", 0.5, parent=holder)
    assert families.heads_in([alone, holder, wheel], [ground]) == [holder]
    (made,) = families.as_placed([holder], [ground])
    assert list(made.objects) == [wheel]
    select(alone, ground, active=ground)
    assert not bpy.ops.esh.scatter_selection.poll()


def test_a_preset_takes_families_too(ground):
    trunk = box("Trunk", 0.4)
    box("Leaves", 1.0, (0.0, 0.0, 2.0), trunk)
    select(trunk, ground, active=ground)
    from esh.esh_scatter.editing.preset_files import BUILT_IN

    bpy.ops.esh.preset_apply(filepath=str(BUILT_IN / "mixed_forest.json"))
    first = bpy.context.scene.esh_scatter.active.classes[0].sizes[0]
    assert first.source_kind == "ASSET" and {item.name for item in first.source.objects} == {"Trunk", "Leaves"}
