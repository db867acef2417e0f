"""X and Delete in Edit Mode of a result remove what is selected as the button does, and are Blender's own anywhere else."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter import registration  # noqa: E402
from esh.esh_scatter.operators import keys  # noqa: E402
from esh.esh_scatter.result.attributes import PLACED_AT  # noqa: E402
from esh.esh_scatter.targets.mesh_attributes import read_attribute  # noqa: E402

pytestmark = pytest.mark.usefixtures("empty_file")


def keys_of_ours():
    keymap = bpy.context.window_manager.keyconfigs.addon.keymaps.find("Mesh", space_type="EMPTY")
    items = keymap.keymap_items if keymap else ()
    return sorted((item.type, item.value, item.any, item.shift) for item in items if item.idname.startswith("esh."))


def cone(name):
    bpy.ops.mesh.primitive_cone_add(vertices=24, radius1=0.4, depth=1.0, location=(80, 0, 0))
    bpy.context.object.name = name
    return bpy.context.object


@pytest.fixture
def two():
    """Two scatters on one ground; the sidebar shows the second."""
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=10, y_subdivisions=10)
    ground = bpy.context.object
    for name in ("Pine", "Beech"):
        made = bpy.context.scene.esh_scatter.add_scatter(ground)
        size = made.add_class().sizes[0]
        size.source_object, size.count = cone(name), 40
        made.device, made.max_steps = "CPU", 10
        bpy.ops.esh.scatter()
    return scatters()


def scatters():
    return list(bpy.context.scene.esh_scatter.scatters)


def edit(*items, select=()):
    """Go into Edit Mode of some meshes, and select points of the first."""
    bpy.ops.object.select_all(action="DESELECT")
    for item in items:
        item.select_set(True)
        item.data.vertices.foreach_set("select", np.zeros(len(item.data.vertices), bool))
    chosen = np.zeros(len(items[0].data.vertices), bool)
    chosen[list(select)] = True
    items[0].data.vertices.foreach_set("select", chosen)
    bpy.context.view_layer.objects.active = items[0]
    bpy.ops.object.mode_set(mode="EDIT")


def test_there_is_one_of_each_key_however_often_it_is_enabled():
    both = [("DEL", "PRESS", False, False), ("X", "PRESS", False, False)]
    assert keys_of_ours() == both
    for _ in range(2):
        registration.unregister()
        assert keys_of_ours() == []
        registration.register()
        keys.attach()
        assert keys_of_ours() == both


def test_where_there_are_no_keys_nothing_is_missing(monkeypatch):
    monkeypatch.setattr(keys, "_keyconfig", lambda: None)
    keys.attach()
    keys.detach()


def test_places_of_what_is_deleted_stay_free(two):
    first, second = two
    place = read_attribute(first.result.data, "position")[[7, 20], :2]
    assert not bpy.ops.esh.instances_delete.poll(), "outside Edit Mode X deletes objects"
    edit(first.result, select=(7, 20))
    assert bpy.ops.esh.instances_delete() == {"FINISHED"}
    assert first.result.mode == "EDIT" and bpy.context.scene.esh_scatter.active == second
    assert bpy.ops.esh.instances_delete() == {"CANCELLED"}, "nothing is selected any more"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert [len(one.free_places) for one in scatters()] == [2, 0], "of the scatter whose points they are"
    assert len(first.result.data.vertices) == 38 and first.changes() == ["instances set by hand"]
    bpy.context.scene.esh_scatter.scatter_index = 0
    bpy.ops.esh.scatter()
    now = read_attribute(scatters()[0].result.data, "position")[:, :2]
    assert len(now) == 40 and np.linalg.norm(now[:, None] - place, axis=2).min() > 0.75


def test_of_two_results_that_are_edited_together_each_keeps_its_places(two):
    first, second = two
    edit(first.result, second.result, select=(3,))
    bpy.ops.mesh.select_all(action="SELECT")
    assert bpy.ops.esh.instances_delete() == {"FINISHED"}
    assert {first.result.mode, second.result.mode} == {"EDIT"}
    bpy.ops.object.mode_set(mode="OBJECT")
    assert [len(one.free_places) for one in scatters()] == [40, 40]


def test_everything_else_is_left_to_blender(two):
    first, second = two
    edit(first.target)
    assert not bpy.ops.esh.instances_delete.poll(), "the ground is edited"
    bpy.ops.object.mode_set(mode="OBJECT")
    edit(first.result, bpy.data.objects["Pine"], select=(3,))
    assert not bpy.ops.esh.instances_delete.poll(), "the tree is edited, too"
    bpy.ops.object.mode_set(mode="OBJECT")
    copy = first.result.copy()
    copy.data = first.result.data.copy()
    bpy.context.scene.collection.objects.link(copy)
    edit(copy, select=(3,))
    assert not bpy.ops.esh.instances_delete.poll(), "a copy is of no scatter"
    bpy.ops.object.mode_set(mode="OBJECT")
    # As a result of an earlier version, which does not know where its points were put.
    second.result.data.attributes.remove(second.result.data.attributes[PLACED_AT])
    edit(second.result, select=(3,))
    assert not bpy.ops.esh.instances_delete.poll()


@pytest.mark.parametrize("how", ["instances_delete", "instances_remove"])
def test_undo_in_edit_mode_brings_points_back_and_lets_go_of_their_places(two, how):
    """Blender's steps of Edit Mode hold the mesh alone, and no settings."""
    bpy.context.scene.esh_scatter.scatter_index = 0
    bpy.ops.ed.undo_push(message="scattered")
    before = read_attribute(two[0].result.data, "position")
    edit(two[0].result, select=(5, 6, 7))
    bpy.ops.ed.undo_push(message="edited")
    getattr(bpy.ops.esh, how)()
    bpy.ops.ed.undo_push(message="deleted")
    bpy.ops.ed.undo()
    bpy.ops.object.mode_set(mode="OBJECT")
    first = scatters()[0]
    assert np.array_equal(read_attribute(first.result.data, "position"), before)
    assert not first.free_places and not first.changes() and not bpy.ops.esh.instances_refill.poll()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.ed.redo()
    bpy.ops.object.mode_set(mode="OBJECT")
    first = scatters()[0]
    assert len(first.result.data.vertices) == 37 and len(first.free_places) == 3
    assert first.changes() == ["instances set by hand"] and bpy.ops.esh.instances_refill.poll()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.ed.undo()
    bpy.ops.object.mode_set(mode="OBJECT")
    scatters()[0].classes[0].sizes[0].count = 300
    bpy.ops.esh.scatter()
    first = scatters()[0]
    now = read_attribute(first.result.data, "position")[:, :2]
    assert len(now) == 300 and not len(first.free_places)
    nearest = np.linalg.norm(now[:, None] - before[[5, 6, 7], :2], axis=2).min(axis=0)
    assert nearest.min() < 0.7, "where they came back there may be others"
