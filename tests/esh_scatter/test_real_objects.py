"""Instances made real stand exactly where they stood, and what is done to them comes back as pins."""

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
import esh  # noqa: E402
from esh.esh_scatter.operators.run_operator import before_a_run  # noqa: E402
from esh.esh_scatter.result import real_objects  # noqa: E402
from esh.esh_scatter.result.display import get_inputs, our_modifier, set_inputs  # noqa: E402
from esh.esh_scatter.solving import live  # noqa: E402
from esh.esh_scatter.targets.mesh_attributes import read_attribute  # noqa: E402
from mathutils import Matrix  # noqa: E402


def box(name, width, height, bumpy=False):
    mesh = bpy.data.meshes.new(name)
    top = [(0, 0, height), (width, 0, height), (width, width, height + bumpy), (0, width, height)]
    if not height:
        mesh.from_pydata(top, [], [(0, 1, 2), (0, 2, 3)])
    else:
        corners = [(x, y, 0.0) for x, y in ((0, 0), (width, 0), (width, width), (0, width))] + top
        faces = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
        mesh.from_pydata(corners, [], faces)
    return bpy.data.objects.new(name, mesh)


@pytest.fixture
def scatter(empty_file):
    """Stretched and turned trees, cabins that are collections, planks that are long, sheds that are empties, on a slope."""
    ground = box("Ground", 20.0, 0.0, bumpy=True)
    bpy.context.scene.collection.objects.link(ground)
    settings = bpy.context.scene.esh_scatter.add_scatter(ground)
    settings.device, settings.max_steps = "CPU", 5
    tree = box("Tree", 0.5, 2.0)
    tree.scale, tree.rotation_euler, tree.location = (1.0, 1.5, 0.8), (0.1, 0.0, 0.4), (5.0, 5.0, 5.0)
    tree.delta_location = (1.0, 2.0, 3.0)
    tree.hide_render = True
    parts = bpy.data.collections.new("Cabin")
    wall, roof = box("Wall", 1.0, 1.0), box("Roof", 1.2, 0.3)
    roof.location.z = 1.0
    parts.objects.link(wall)
    parts.objects.link(roof)
    parts.instance_offset = (0.5, 0.5, 0.0)
    plank = box("Plank", 0.2, 0.1)
    plank.scale.x = 9.0
    shed = bpy.data.objects.new("Shed", None)
    shed.instance_type, shed.instance_collection = "COLLECTION", parts
    shed.scale, shed.rotation_euler, shed.location = (0.6, 0.4, 0.9), (0.1, 0.0, 0.5), (3.0, 4.0, 5.0)
    shed.hide_viewport = True
    for name, source, count in (("Pine", tree, 12), ("Cabin", parts, 4), ("Plank", plank, 6), ("Shed", shed, 5)):
        one = settings.add_class()
        one.name, one.tilt, one.scale_jitter, one.align_to_normal = name, 0.3, 0.3, 0.7
        size = one.sizes[0]
        size.count = count
        if source is parts:
            size.source_kind, size.source_collection = "ASSET", source
        else:
            size.source_object = source
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    return settings


def instances(of=None):
    """What is instanced, by the name of the data and place: matrices, sorted."""
    found = []
    bpy.context.view_layer.update()
    for one in bpy.context.evaluated_depsgraph_get().object_instances:
        shown = one.is_instance or one.object.original.get(real_objects.POINT) is not None
        if shown and one.object.type == "MESH":
            found.append((one.object.original.data.name, *np.array(one.matrix_world).round(4).ravel().tolist()))
    return sorted(found)


def in_order(rows):
    return np.array([row[1:] for row in rows])


def test_every_real_object_is_where_its_instance_was(scatter):
    before = instances()
    assert bpy.ops.esh.instances_make_real() == {"FINISHED"}
    collection = real_objects.real_objects_of(scatter.result)
    assert len(collection.objects) == 27
    names = sorted(item.name for item in collection.objects)
    counts = {"Cabin": 4, "Pine": 12, "Plank": 6, "Shed": 5}
    assert names == [f"{name} {number:04d}" for name, count in counts.items() for number in range(1, count + 1)]
    after = instances()
    assert len(after) == len(before) == 12 + 2 * 4 + 6 + 2 * 5
    assert [row[0] for row in after] == [row[0] for row in before]
    assert np.abs(in_order(after) - in_order(before)).max() < 2e-4
    assert scatter.result.hide_viewport and scatter.result.hide_render
    pine = collection.objects["Pine 0001"]
    assert pine.data == bpy.data.meshes["Tree"] and not pine.hide_render and pine.parent is None
    for name in ("Cabin 0001", "Shed 0001"):
        assert collection.objects[name].instance_collection == bpy.data.collections["Cabin"]


def test_the_share_of_the_viewport_hides_none_and_stays(scatter):
    modifier = our_modifier(scatter.result)
    set_inputs(modifier, {"Share": 0.2, "Display": "Points"})
    bpy.ops.esh.instances_make_real()
    assert len(real_objects.real_objects_of(scatter.result).objects) == 27
    inputs = get_inputs(modifier)
    assert inputs["Share"] == pytest.approx(0.2) and inputs["Display"] == "Points"


def test_without_changes_all_is_as_it_was(scatter, capfd):
    before, points = instances(), read_attribute(scatter.result.data, "position").tobytes()
    objects = len(bpy.data.objects)
    bpy.ops.esh.instances_make_real()
    assert not bpy.ops.esh.instances_make_real.poll(), "they are real already"
    assert bpy.ops.esh.instances_from_real() == {"FINISHED"}
    assert "The instances are as they were" in capfd.readouterr().out
    assert instances() == before and read_attribute(scatter.result.data, "position").tobytes() == points
    assert len(bpy.data.objects) == objects and real_objects.real_objects_of(scatter.result) is None
    assert not scatter.result.hide_viewport and "pinned" not in scatter.result.data.attributes
    assert not scatter.outdated


def test_what_was_moved_turned_and_scaled_stays_so_in_the_next_run(scatter):
    bpy.ops.esh.instances_make_real()
    collection = real_objects.real_objects_of(scatter.result)
    bpy.context.view_layer.update()
    moved, turned, scaled = (collection.objects[f"Pine {number:04d}"] for number in (1, 2, 3))
    moved.location += Matrix.Translation((1.5, -0.5, 0.0)).to_translation()
    axis = Matrix(real_rotation(scatter, 1)).col[2]
    turned.matrix_basis = (
        Matrix.Translation(turned.location)
        @ Matrix.Rotation(0.5, 4, axis)
        @ Matrix.Translation(-turned.location)
        @ turned.matrix_basis
    )
    scaled.scale = [1.4 * value for value in scaled.scale]
    bpy.context.view_layer.update()
    wanted = [np.array(item.matrix_world) for item in (moved, turned, scaled)]
    assert bpy.ops.esh.instances_from_real() == {"FINISHED"}
    shown = in_order([row for row in instances() if row[0] == "Tree"]).reshape(-1, 4, 4)
    for matrix in wanted:
        assert np.abs(shown - matrix).max(axis=(1, 2)).min() < 1e-3, "it shows as it was put"
    pinned = read_attribute(scatter.result.data, "pinned")
    assert np.flatnonzero(pinned).tolist() == [0, 1, 2] and scatter.outdated
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    shown = in_order([row for row in instances() if row[0] == "Tree"]).reshape(-1, 4, 4)
    assert len(shown) == 12 and not scatter.outdated
    for matrix in wanted:
        there = np.abs(shown[:, :2, 3] - matrix[:2, 3]).max(axis=1)
        assert there.min() < 0.02, "the next run leaves it there"
        size = np.linalg.norm(matrix[:3, 0])
        assert np.linalg.norm(shown[there.argmin(), :3, 0]) == pytest.approx(size, rel=1e-3)


def test_mirrored_objects_stand_unmirrored_and_do_not_block_the_next_run(scatter):
    bpy.ops.esh.instances_make_real()
    bpy.context.view_layer.update()
    mirrored = real_objects.real_objects_of(scatter.result).objects["Pine 0002"]
    before = np.array(mirrored.matrix_world)
    mirrored.scale.x *= -1.0
    bpy.context.view_layer.update()
    assert bpy.ops.esh.instances_from_real() == {"FINISHED"}
    assert (read_attribute(scatter.result.data, "scale") > 0.0).all()
    pinned = np.flatnonzero(read_attribute(scatter.result.data, "pinned"))
    assert len(pinned) == 1
    np.testing.assert_allclose(read_attribute(scatter.result.data, "position")[pinned[0]], before[:3, 3], atol=1e-3)
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert scatter.report["fixed_overlaps"] == 0 and read_attribute(scatter.result.data, "pinned").sum() == 1


def real_rotation(scatter, point):
    from mathutils import Quaternion

    return Quaternion(read_attribute(scatter.result.data, "rotation")[point].tolist()).to_matrix()


def test_deleted_objects_leave_their_places_free_and_copies_stay(scatter):
    bpy.ops.esh.instances_make_real()
    collection = real_objects.real_objects_of(scatter.result)
    for name in ("Pine 0001", "Cabin 0001"):
        bpy.data.objects.remove(collection.objects[name])
    copy = collection.objects["Pine 0002"].copy()
    copy.location.x += 1.0
    collection.objects.link(copy)
    assert bpy.ops.esh.instances_from_real() == {"FINISHED"}
    assert len(scatter.result.data.vertices) == 25 and len(scatter.free_places) == 2
    # Its roof is 1.2 m wide, and it is up to 30 % larger or smaller.
    assert 0.7 * 0.6 < scatter.free_places[1].radius < 1.3 * 0.65
    assert not {0, 12} & set(read_attribute(scatter.result.data, "id").tolist())
    assert list(collection.objects) == [copy] and real_objects.POINT not in copy
    assert real_objects.real_objects_of(scatter.result) is None
    assert "pinned" not in scatter.result.data.attributes


def test_changes_can_be_discarded_and_an_updated_result_is_said(scatter):
    before = instances()
    bpy.ops.esh.instances_make_real()
    collection = real_objects.real_objects_of(scatter.result)
    collection.objects["Pine 0001"].location.x += 1.0
    assert bpy.ops.esh.instances_from_real(changes="DISCARD") == {"FINISHED"}
    assert instances() == before
    bpy.ops.esh.instances_make_real()
    scatter.seed = 9
    # By a script, which nobody asks.
    given, named = scatter.arguments(bpy.context.scene)
    esh.scatter(*given, **named)
    with pytest.raises(RuntimeError, match="has been updated since"):
        bpy.ops.esh.instances_from_real()
    assert bpy.ops.esh.instances_from_real(changes="DISCARD") == {"FINISHED"}
    assert not scatter.result.hide_viewport and len(bpy.data.collections) == 1


def test_a_turn_about_the_own_axis_is_told_from_the_rest(scatter):
    bpy.ops.esh.instances_make_real()
    collection = real_objects.real_objects_of(scatter.result)
    before = read_attribute(scatter.result.data, "heading")[4]
    item = collection.objects["Pine 0005"]
    axis = Matrix(real_rotation(scatter, 4)).col[2]
    item.matrix_basis = (
        Matrix.Translation(item.location)
        @ Matrix.Rotation(math.pi / 3, 4, axis)
        @ Matrix.Translation(-item.location)
        @ item.matrix_basis
    )
    bpy.ops.esh.instances_from_real()
    assert read_attribute(scatter.result.data, "heading")[4] - before == pytest.approx(math.pi / 3, abs=1e-3)


def test_a_hidden_result_is_said_and_undo_takes_it_back(scatter):
    scatter.result.hide_viewport = True
    with pytest.raises(RuntimeError, match="is hidden"):
        bpy.ops.esh.instances_make_real()
    scatter.result.hide_viewport = False
    bpy.ops.ed.undo_push(message="before")
    objects = len(bpy.data.objects)
    bpy.ops.esh.instances_make_real()
    bpy.ops.ed.undo_push(message="real")
    bpy.ops.ed.undo()
    assert len(bpy.data.objects) == objects
    result = bpy.context.scene.esh_scatter.active.result
    assert not result.hide_viewport and real_objects.real_objects_of(result) is None


def test_a_run_beside_real_objects_leaves_them_as_objects_of_their_own(scatter):
    assert bpy.ops.esh.instances_make_real() == {"FINISHED"}
    collection = real_objects.real_objects_of(scatter.result)
    moved, count = collection.objects[0], len(collection.objects)
    moved.location.x += 0.5
    place = moved.location.copy()
    scatter.classes[0].sizes[0].count = 15
    title, _ = before_a_run(bpy.context, scatter)
    assert "Real Objects" in title
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert not scatter.result.hide_viewport and real_objects.real_objects_of(scatter.result) is None
    assert len(collection.objects) == count and moved.location == place and len(scatter.result.data.vertices) == 30
    assert before_a_run(bpy.context, scatter) is None


def test_live_leaves_real_objects_alone(scatter, follow):
    assert bpy.ops.esh.instances_make_real() == {"FINISHED"}
    before = read_attribute(scatter.result.data, "position").copy()
    scatter.live = True
    follow()
    scatter.classes[0].sizes[0].count = 15
    follow()
    np.testing.assert_array_equal(read_attribute(scatter.result.data, "position"), before)
    assert "real objects" in live.status(bpy.context.scene, scatter)
    scatter.live = False
    follow()


def test_what_is_edited_is_made_real_and_no_longer_edited(scatter):
    """The result is hidden then, and what is hidden cannot be edited: there was a traceback."""
    assert bpy.ops.esh.scatter() == {"FINISHED"} and bpy.ops.esh.instances_edit() == {"FINISHED"}
    assert scatter.result.mode == "EDIT" and bpy.ops.esh.instances_make_real() == {"FINISHED"}
    assert scatter.result.mode == "OBJECT" and not scatter.result.visible_get()
    assert real_objects.real_objects_of(scatter.result) is not None
