"""Results follow their targets, and show as much as the inputs of their modifiers say."""

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
from esh.esh_scatter.result.display import followed_targets, get_inputs, our_modifier, set_inputs  # noqa: E402
from esh.esh_scatter.result.exchange import _read_result  # noqa: E402
from esh.esh_scatter.result.replaced_data import Replaced, owned_by  # noqa: E402
from esh.esh_scatter.result.standing_now import standing_now  # noqa: E402
from mathutils import Matrix, Quaternion, Vector  # noqa: E402
from mathutils.bvhtree import BVHTree  # noqa: E402

pytestmark = pytest.mark.usefixtures("bare_file")


def new_object(name, vertices, faces, link=True):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    item = bpy.data.objects.new(name, mesh)
    if link:
        bpy.context.scene.collection.objects.link(item)
    return item


def hills():
    along = np.linspace(0.0, 20.0, 11)
    corners = [(x, y, 1.5 * math.sin(0.5 * x) + 0.1 * y) for y in along for x in along]
    quads = [(i + 11 * j, i + 1 + 11 * j, i + 12 + 11 * j, i + 11 + 11 * j) for j in range(10) for i in range(10)]
    return new_object("Ground", corners, quads)


def asked():
    tree, stone = bpy.data.objects["Tree"], bpy.data.objects["Stone"]
    return [
        esh.ScatterClass("tree", [esh.ScatterSize("t", 60, tree)], standing=esh.Standing(align_to_normal=0.0)),
        esh.ScatterClass(
            "stone", [esh.ScatterSize("s", 90, stone)], standing=esh.Standing(align_to_normal=1.0, offset=0.1)
        ),
    ]


@pytest.fixture
def scattered():
    new_object("Tree", [(0.1, 0, 0), (-0.1, 0.12, 0), (-0.1, -0.12, 0), (0, 0, 2)], [(0, 1, 2), (0, 1, 3)])
    new_object("Stone", [(0.06, 0, 0), (-0.04, 0.05, 0), (-0.04, -0.05, 0)], [(0, 1, 2)])
    return esh.scatter(hills(), asked(), device="cpu", max_steps=5)


def shown(item):
    """Name and matrix of every instance, in the order of the points."""
    found = []
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.is_instance and instance.parent.original == item:
            found.append((instance.object.original.name, instance.matrix_world.copy()))
    return found


def matrices(item):
    return np.array([matrix for _, matrix in shown(item)])


def classes_of(item):
    return np.array([name == "Stone" for name, _ in shown(item)])


def test_a_result_that_was_just_made_stands_where_it_was_placed(scattered):
    placed = scattered.instances
    matrix, stones = matrices(scattered.object), classes_of(scattered.object)
    for number, own in enumerate((~stones, stones)):
        np.testing.assert_allclose(matrix[own][:, :3, 3], placed.position[placed.source == number], atol=2e-5)


@pytest.mark.parametrize("targets", [1, 2])
def test_far_from_the_origin_it_is_not_turned_by_the_rounding_of_coordinates(targets):
    """At the coordinates of a map the corners of triangles are rounded to half a meter in the world, and were in their edges."""
    grounds = [hills() for _ in range(targets)]
    for number, ground in enumerate(grounds):
        ground.location = (500_000.0 + 20.0 * number, 5_000_000.0, 0.0)
        ground.rotation_euler.z = 0.4
    bpy.context.view_layer.update()
    # The names tell apart which object is which class's.
    tree = new_object("Tree", [(0.1, 0, 0), (-0.1, 0.12, 0), (-0.1, -0.12, 0), (0, 0, 2)], [(0, 1, 2), (0, 1, 3)])
    stone = new_object("Stone", [(0.06, 0, 0), (-0.04, 0.05, 0), (-0.04, -0.05, 0)], [(0, 1, 2)])
    classes = [esh.ScatterClass(name, [esh.ScatterSize("s", 60, item)]) for name, item in (("t", tree), ("s", stone))]
    result = esh.scatter(grounds, classes, device="cpu", max_steps=3)
    placed = result.instances
    expected = np.array([Quaternion(q).to_matrix() for q in placed.rotation.astype(float)])
    matrix, stones = matrices(result.object), classes_of(result.object)
    for number, own in enumerate((~stones, stones)):
        np.testing.assert_allclose(matrix[own][:, :3, :3], expected[placed.source == number], atol=1e-5)
        np.testing.assert_array_equal(matrix[own][:, :3, 3], placed.position[placed.source == number])


def test_it_moves_turns_and_grows_with_its_target(scattered):
    ground, item = bpy.data.objects["Ground"], scattered.object
    before, stones = matrices(item), classes_of(item)
    motion = Matrix.Translation((3, -2, 5)) @ Matrix.Rotation(0.7, 4, "Z")
    ground.matrix_world = motion
    bpy.context.view_layer.update()
    expected = np.array(motion) @ before
    np.testing.assert_allclose(matrices(item), expected, atol=1e-4)
    # Tilted, what follows the slope leans with it, and what stands upright does not.
    tilt = Matrix.Rotation(0.4, 4, "X")
    ground.matrix_world = tilt
    bpy.context.view_layer.update()
    after = matrices(item)
    np.testing.assert_allclose(after[stones], (np.array(tilt) @ before)[stones], atol=1e-4)
    np.testing.assert_allclose(after[~stones][:, :3, 3], (np.array(tilt) @ before)[~stones][:, :3, 3], atol=1e-4)
    np.testing.assert_allclose(after[~stones][:, :3, 2], np.broadcast_to([0, 0, 1], ((~stones).sum(), 3)), atol=1e-4)
    ground.matrix_world = Matrix.Scale(2.0, 4)
    bpy.context.view_layer.update()
    trees = matrices(item)[~stones]
    np.testing.assert_allclose(trees[:, :3, 3], 2.0 * before[~stones][:, :3, 3], atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(trees[:, :3, 0], axis=1), 1.0, atol=1e-4)


def test_it_bends_with_its_target_and_keeps_what_was_moved_by_hand(scattered):
    ground, item = bpy.data.objects["Ground"], scattered.object
    item.data.vertices[7].co.z += 1.0
    item.data.update()
    stones = classes_of(item)
    before = matrices(item)
    for vertex in ground.data.vertices:
        vertex.co.z += 2.0 + 0.3 * vertex.co.x
    ground.data.update()
    bpy.context.view_layer.update()
    after = matrices(item)
    trees = ~stones
    lifted = before[trees][:, :3, 3].copy()
    lifted[:, 2] += 2.0 + 0.3 * lifted[:, 0]
    moved = np.zeros(trees.sum(), bool)
    moved[7] = True
    # What stands away from the ground turns with it: exactly where nothing does.
    np.testing.assert_allclose(after[trees][~moved, :3, 3], lifted[~moved], atol=1e-3)
    assert np.linalg.norm(after[trees][7, :3, 3] - lifted[7]) < 0.5
    # A face that rises along x leans what follows the slope, and pulls its offset with it.
    assert np.all(after[stones][:, 0, 2] < before[stones][:, 0, 2])


@pytest.mark.parametrize("align", [0.0, 0.5, 1.0])
def test_what_stands_on_its_lowest_point_does_so_while_the_ground_bends(align):
    """Its origin is above the ground: what stood upright was pulled sideways by the slope, off the point that it stands on."""
    tree = new_object("Tree", [(0.1, 0, -1), (-0.1, 0.12, -1), (-0.1, -0.12, -1), (0, 0, 1)], [(0, 1, 3), (0, 2, 1)])
    standing = esh.Standing(align_to_normal=align, stand_on="lowest", scale_jitter=0.3)
    asked = [esh.ScatterClass("tree", [esh.ScatterSize("t", 60, tree)], standing=standing)]
    ground = new_object("Ground", [(0, 0, 0), (20, 0, 0), (20, 20, 0), (0, 20, 0)], [(0, 1, 2, 3)])
    item = esh.scatter(ground, asked, device="cpu", max_steps=5).object
    foot = matrices(item) @ (0.0, 0.0, -1.0, 1.0)
    np.testing.assert_allclose(foot[:, 2], 0.0, atol=1e-5)
    for vertex in ground.data.vertices:
        vertex.co.z += 0.6 * vertex.co.x
    ground.data.update()
    bpy.context.view_layer.update()
    after, told = matrices(item), standing_now(item, bpy.context)
    foot[:, 2] = 0.6 * foot[:, 0]
    np.testing.assert_allclose(after @ (0.0, 0.0, -1.0, 1.0), foot, atol=1e-4)
    np.testing.assert_allclose(told.position, after[:, :3, 3], atol=1e-4)
    np.testing.assert_allclose(told.axes, after[:, :3, :3], atol=1e-4)


def test_it_stays_where_there_is_no_target_any_more_or_none_is_followed(scattered):
    ground, item = bpy.data.objects["Ground"], scattered.object
    before = matrices(item)
    ground.location.z = 5.0
    set_inputs(our_modifier(item), {"Follow": False})
    bpy.context.view_layer.update()
    np.testing.assert_allclose(matrices(item), before, atol=1e-5)
    set_inputs(our_modifier(item), {"Follow": True})
    bpy.context.view_layer.update()
    np.testing.assert_allclose(matrices(item)[:, 2, 3], before[:, 2, 3] + 5.0, atol=1e-4)
    bpy.data.objects.remove(ground)
    bpy.context.view_layer.update()
    np.testing.assert_allclose(matrices(item), before, atol=1e-5)


@pytest.mark.parametrize("way", ["moved", "turned", "scaled", "mirrored"])
def test_it_goes_with_a_target_whose_mesh_has_other_vertices_now(scattered, way):
    """As in renders, where a surface is subdivided more finely than in the viewport: objects stood where the target had been."""
    ground, item = bpy.data.objects["Ground"], scattered.object
    before = matrices(item)
    finer = ground.modifiers.new("Finer", "SUBSURF")
    finer.subdivision_type = "SIMPLE"
    bpy.context.view_layer.update()
    np.testing.assert_allclose(matrices(item), before, atol=1e-5)
    ground.location = (5.0, 1.0, 2.0)
    ground.rotation_euler = (0.2, 0.1, 0.7) if way == "turned" else (0.0, 0.0, 0.0)
    ground.scale = {"scaled": (1.5, 0.8, 1.2), "mirrored": (-1.0, 1.0, 1.0)}.get(way, (1.0, 1.0, 1.0))
    bpy.context.view_layer.update()
    after, told = matrices(item), standing_now(item, bpy.context)
    finer.show_viewport = False
    bpy.context.view_layer.update()
    expected = matrices(item)
    assert np.abs(expected[:, :3, 3] - before[:, :3, 3]).max() > 3.0
    np.testing.assert_allclose(after, expected, atol=2e-5)
    order = np.linalg.norm(told.position[None] - after[:, None, :3, 3], axis=2).argmin(axis=1)
    np.testing.assert_allclose(told.position[order], after[:, :3, 3], atol=2e-5)
    np.testing.assert_allclose(told.axes[order], after[:, :3, :3], atol=2e-4)


def bent_in_other_ways(ground, way):
    """Have a target bend; return what does so once it is called."""
    if way == "shape keys":
        ground.shape_key_add(name="Basis")
        bent = ground.shape_key_add(name="Bent")
        bent.value = 0.0
        for point in bent.data:
            point.co.z += 0.05 * point.co.x**2
            point.co.y += 0.4 * math.sin(0.7 * point.co.x)
        return lambda: setattr(bent, "value", 1.0)
    if way == "wave":
        wave = ground.modifiers.new("Wave", "WAVE")
        wave.height, wave.width, wave.narrowness = 0.0, 8.0, 0.25
        wave.time_offset = -40.0
        return lambda: setattr(wave, "height", 1.0)
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for name, start in (("Lower", 0.0), ("Upper", 10.0)):
        bone = rig.data.edit_bones.new(name)
        bone.head, bone.tail = (start, 10.0, 0.0), (start + 10.0, 10.0, 0.0)
    bpy.ops.object.mode_set(mode="OBJECT")
    for name, side in (("Lower", -1.0), ("Upper", 1.0)):
        group = ground.vertex_groups.new(name=name)
        for vertex in ground.data.vertices:
            group.add([vertex.index], min(max(0.5 + 0.25 * side * (vertex.co.x - 10.0), 0.0), 1.0), "REPLACE")
    ground.modifiers.new("Armature", "ARMATURE").object = rig
    rig.pose.bones["Upper"].rotation_mode = "XYZ"
    return lambda: setattr(rig.pose.bones["Upper"], "rotation_euler", (0.2, 0.1, 0.3))


def heights_above(ground, places):
    """Return how far places are from a target as it is now, shape ``[n]``, and where it looks to there."""
    bpy.context.view_layer.update()
    mesh = ground.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    tree = BVHTree.FromPolygons([v.co for v in mesh.vertices], [list(face.vertices) for face in mesh.polygons])
    found = [tree.find_nearest(ground.matrix_world.inverted() @ Vector(place)) for place in places]
    normal = np.array([(ground.matrix_world.to_3x3().inverted().transposed() @ one[1]).normalized() for one in found])
    nearest = np.array([ground.matrix_world @ one[0] for one in found])
    return np.linalg.norm(nearest - places, axis=1), normal


@pytest.mark.parametrize("way", ["shape keys", "wave", "armature"])
@pytest.mark.parametrize(("level", "rendered", "far"), [(0, 2, 0.2), (1, 2, 0.06), (1, 4, 0.06), (2, 3, 0.02)])
def test_it_bends_with_a_target_that_is_subdivided_further_in_renders(scattered, way, level, rendered, far):
    """They followed in the viewport, and were left behind in the picture; faces are 2 m wide before they are divided."""
    ground, item = bpy.data.objects["Ground"], scattered.object
    bend = bent_in_other_ways(ground, way)
    divided = ground.modifiers.new("Divided", "SUBSURF")
    # To which level, may be said afterwards.
    divided.levels, divided.render_levels = level, max(level, 1)
    assert esh.scatter(ground, asked(), device="cpu", max_steps=5).object == item
    before = matrices(item)
    divided.levels = rendered
    bpy.context.view_layer.update()
    if level:
        # Vertices of a level are where they were in a finer one.
        np.testing.assert_allclose(matrices(item), before, atol=1e-6)
    divided.levels = level
    bend()
    bpy.context.view_layer.update()
    seen = matrices(item)
    assert np.abs(seen - before)[:, :3, 3].max() > 0.5
    divided.levels = rendered
    bpy.context.view_layer.update()
    after, stones = matrices(item), classes_of(item)
    if level:
        np.testing.assert_allclose(after, seen, atol=1e-5)
    away, _ = heights_above(ground, after[~stones][:, :3, 3])
    assert away.max() < far
    foot = after[stones][:, :3, 3] - 0.1 * after[stones][:, :3, 2]
    away, normal = heights_above(ground, foot)
    assert away.max() < far
    along = (normal * after[stones][:, :3, 2]).sum(axis=1)
    assert np.median(along) > 0.98 and along.min() > (0.95 if level else 0.75)
    told = standing_now(item, bpy.context)
    order = np.linalg.norm(told.position[None] - after[:, None, :3, 3], axis=2).argmin(axis=1)
    np.testing.assert_allclose(told.position[order], after[:, :3, 3], atol=2e-5)
    np.testing.assert_allclose(told.axes[order], after[:, :3, :3], atol=2e-4)


@pytest.mark.parametrize("shape", ["cube", "hills"])
def test_what_was_placed_on_a_mesh_that_is_subdivided_in_renders_only_is_nearer_to_what_is_seen_there(shape):
    """Its vertices move towards the smooth surface: objects sink by less than they stood above it."""
    if shape == "cube":
        bpy.ops.mesh.primitive_cube_add()
    ground = bpy.context.object if shape == "cube" else hills()
    divided = ground.modifiers.new("Divided", "SUBSURF")
    divided.levels, divided.render_levels = 0, 2
    stone = new_object("Stone", [(0.06, 0, 0), (-0.04, 0.05, 0), (-0.04, -0.05, 0)], [(0, 1, 2)])
    stones = [esh.ScatterClass("stone", [esh.ScatterSize("s", 300, stone, area=0.001)])]
    item = esh.scatter(ground, stones, surface="whole", device="cpu", max_steps=5).object
    before = matrices(item)[:, :3, 3]
    divided.levels = 2
    stayed, _ = heights_above(ground, before)
    moved, _ = heights_above(ground, matrices(item)[:, :3, 3])
    assert moved.mean() < 0.9 * stayed.mean() and moved.max() < stayed.max()


@pytest.mark.parametrize("surface", ["above", "whole"])
def test_each_of_several_targets_is_followed_to_the_level_that_it_has_in_renders(surface):
    grounds = [hills() for _ in range(3)]
    for number, (ground, levels) in enumerate(zip(grounds, ((1, 2), (0, 0), (0, 1)), strict=True)):
        ground.location.x = 30.0 * number
        ground.shape_key_add(name="Basis")
        divided = ground.modifiers.new("Divided", "SUBSURF")
        divided.levels, divided.render_levels = levels
        divided.subdivision_type = "SIMPLE"
    grounds[0].scale.x = -1.0
    bpy.context.view_layer.update()
    stone = new_object("Stone", [(0.06, 0, 0), (-0.04, 0.05, 0), (-0.04, -0.05, 0)], [(0, 1, 2)])
    standing = esh.Standing(align_to_normal=1.0)
    asked = [esh.ScatterClass("stone", [esh.ScatterSize("s", 90, stone)], standing=standing)]
    item = esh.scatter(grounds, asked, surface=surface, device="cpu", max_steps=3).object
    told = [one.finer for one in followed_targets(our_modifier(item))]
    assert [one and (one.level, one.vertices[0]) for one in told] == [(1, 1681), None, (0, 441)]
    before = matrices(item)
    for ground in grounds:
        bent = ground.shape_key_add(name="Bent")
        bent.value = 1.0
        for point in bent.data:
            point.co.z += 0.05 * point.co.x**2
    bpy.context.view_layer.update()
    seen = matrices(item)
    for ground in grounds:
        ground.modifiers[0].levels = ground.modifiers[0].render_levels
    bpy.context.view_layer.update()
    after = matrices(item)
    assert all((np.abs(seen - before)[abs(before[:, 0, 3] - x) < 11.0, 2, 3] > 1.0).any() for x in (-10, 40, 70))
    np.testing.assert_allclose(after, seen, atol=2e-5)


def test_a_target_of_which_coarser_levels_or_a_mirror_leave_nothing_to_follow_goes_as_a_whole(scattered):
    ground, item = bpy.data.objects["Ground"], scattered.object
    divided = ground.modifiers.new("Divided", "SUBSURF")
    divided.levels = 2
    esh.scatter(ground, asked(), device="cpu", max_steps=5)
    assert all(f"esh_finer_{name}_{k}" in item.data.attributes for name in ("step", "square") for k in range(3))
    before = matrices(item)
    for vertex in ground.data.vertices:
        vertex.co.z += 1.0
    for level, height in ((1, 0.0), (2, 1.0), (3, 1.0)):
        divided.levels = level
        bpy.context.view_layer.update()
        np.testing.assert_allclose(matrices(item)[:, 2, 3], before[:, 2, 3] + height, atol=1e-4)
    ground.modifiers.new("Mirror", "MIRROR")
    esh.scatter(ground, asked(), device="cpu", max_steps=5)
    assert followed_targets(our_modifier(item))[0].finer is None
    assert not any(name.startswith("esh_finer") for name in item.data.attributes.keys())  # noqa: SIM118 - data is not iterable


def parent(item, to):
    item.parent = to
    item.matrix_parent_inverse = to.matrix_world.inverted()


@pytest.mark.parametrize("together", ["child of the target", "children of an empty", "moved alike"])
def test_what_moves_target_and_result_moves_instances_once(scattered, together):
    ground, item = bpy.data.objects["Ground"], scattered.object
    before = matrices(item)
    motion = Matrix.Translation((5, 1, 2)) @ Matrix.Rotation(0.7, 4, "Z")
    if together == "moved alike":
        item.matrix_world, ground.matrix_world = motion @ item.matrix_world, motion @ ground.matrix_world
    else:
        empty = bpy.data.objects.new("Empty", None)
        bpy.context.scene.collection.objects.link(empty)
        mover = ground if together.startswith("child ") else empty
        for one in {item, ground} - {mover}:
            parent(one, mover)
        mover.matrix_world = motion
    bpy.context.view_layer.update()
    after = matrices(item)
    np.testing.assert_allclose(after, np.array(motion) @ before, atol=1e-4)
    told = standing_now(item, bpy.context)
    order = np.linalg.norm(told.position[None] - after[:, None, :3, 3], axis=2).argmin(axis=1)
    np.testing.assert_allclose(told.position[order], after[:, :3, 3], atol=2e-5)
    np.testing.assert_allclose(told.axes[order], after[:, :3, :3], atol=2e-4)


@pytest.mark.parametrize("follow", [True, False])
def test_a_run_puts_a_result_where_it_belongs_whatever_its_parent(scattered, follow):
    ground, item = bpy.data.objects["Ground"], scattered.object
    set_inputs(our_modifier(item), {"Follow": follow})
    parent(item, ground)
    ground.matrix_world = Matrix.Translation((5, 1, 2)) @ Matrix.Rotation(0.7, 4, "Z") @ Matrix.Scale(1.2, 4)
    bpy.context.view_layer.update()
    again = esh.scatter(ground, asked(), device="cpu", max_steps=5)
    bpy.context.view_layer.update()
    assert again.object == item and item.parent == ground
    found, stones = matrices(item), classes_of(item)
    for number, own in enumerate((~stones, stones)):
        placed = again.instances.position[again.instances.source == number]
        np.testing.assert_allclose(found[own][:, :3, 3], placed, atol=2e-5)
    # In Edit Mode points are where their instances are.
    np.testing.assert_allclose(np.array(item.matrix_world), np.eye(4), atol=1e-5)


def test_only_what_follows_nothing_moves_with_its_result(scattered):
    ground, item = bpy.data.objects["Ground"], scattered.object
    before = matrices(item)
    item.location = (3.0, 0.0, 1.0)
    bpy.context.view_layer.update()
    np.testing.assert_allclose(matrices(item), before, atol=1e-5)
    set_inputs(our_modifier(item), {"Follow": False})
    bpy.context.view_layer.update()
    np.testing.assert_allclose(matrices(item)[:, :3, 3], before[:, :3, 3] + [3.0, 0.0, 1.0], atol=1e-5)
    set_inputs(our_modifier(item), {"Follow": True})
    bpy.data.objects.remove(ground)
    bpy.context.view_layer.update()
    np.testing.assert_allclose(matrices(item)[:, :3, 3], before[:, :3, 3] + [3.0, 0.0, 1.0], atol=1e-5)
    np.testing.assert_allclose(
        standing_now(item, bpy.context).position.mean(axis=0), matrices(item)[:, :3, 3].mean(axis=0), atol=1e-4
    )


def test_how_the_target_stands_is_told_anew_with_every_run_and_builds_no_other_group(scattered):
    ground, item = bpy.data.objects["Ground"], scattered.object
    group = our_modifier(item).node_group
    made = [part.name for part in bpy.data.node_groups]
    ground.location.x = 4.0
    bpy.context.view_layer.update()
    again = esh.scatter(ground, asked(), device="cpu", max_steps=5, pinned=False).object
    assert again == item and our_modifier(item).node_group == group
    assert [part.name for part in bpy.data.node_groups] == made
    before = matrices(item)
    ground.modifiers.new("Finer", "SUBSURF")
    bpy.context.view_layer.update()
    np.testing.assert_allclose(matrices(item), before, atol=1e-5)
    ground.location.x = 7.0
    bpy.context.view_layer.update()
    np.testing.assert_allclose(matrices(item)[:, 0, 3], before[:, 0, 3] + 3.0, atol=1e-4)


@pytest.mark.parametrize("way", ["copies", "linked copies", "scene"])
def test_a_result_that_is_copied_with_its_target_follows_the_copy_of_that(scattered, way):
    item = scattered.object
    before = matrices(item)
    if way == "scene":
        bpy.ops.scene.new(type="FULL_COPY")
    else:
        for one in bpy.context.scene.objects:
            one.select_set(one in (item, bpy.data.objects["Ground"]))
        bpy.ops.object.duplicate(linked=way == "linked copies")
    copy, ground = (bpy.context.scene.objects[f"{name}.001"] for name in (item.name, "Ground"))
    ground.location.x = 40.0
    bpy.context.view_layer.update()
    np.testing.assert_allclose(matrices(copy)[:, 0, 3], before[:, 0, 3] + 40.0, atol=1e-4)
    along = np.sort(standing_now(copy, bpy.context).position[:, 0])
    np.testing.assert_allclose(along, np.sort(before[:, 0, 3]) + 40.0, atol=1e-4)
    if way != "scene":
        np.testing.assert_allclose(matrices(item), before, atol=1e-5)


def test_what_a_result_has_got_since_a_step_is_put_back_before_undo_and_taken_again_where_it_is_still_there(scattered):
    item = scattered.object
    before = owned_by(item)
    replaced = Replaced(item)
    replaced.add(before)
    item.data, our_modifier(item).node_group = item.data.copy(), our_modifier(item).node_group.copy()
    since = owned_by(item)
    set_inputs(our_modifier(item), {"Share": 0.5})
    assert not since.is_same(before)
    replaced.put_back()
    assert owned_by(item).is_same(before)
    assert replaced.take_again() and owned_by(item).is_same(since)
    replaced.put_back()
    bpy.data.meshes.remove(since.mesh.find())
    assert not replaced.take_again() and owned_by(item).is_same(before)
    assert get_inputs(our_modifier(item))["Share"] == 0.5
    assert followed_targets(our_modifier(item))[0].target == bpy.data.objects["Ground"]


def test_far_from_the_origin_what_has_other_vertices_and_did_not_move_stays_to_the_last_digit():
    ground = hills()
    ground.location, ground.rotation_euler.z = (500_000.0, 5_000_000.0, 0.0), 0.4
    bpy.context.view_layer.update()
    stone = new_object("Stone", [(0.06, 0, 0), (-0.04, 0.05, 0), (-0.04, -0.05, 0)], [(0, 1, 2)])
    item = esh.scatter(ground, [esh.ScatterClass("s", [esh.ScatterSize("s", 60, stone)])], max_steps=3).object
    before = matrices(item)
    ground.modifiers.new("Finer", "SUBSURF")
    bpy.context.view_layer.update()
    after = matrices(item)
    np.testing.assert_array_equal(after[:, :3, 3], before[:, :3, 3])
    np.testing.assert_allclose(after, before, atol=1e-5)


def test_standing_that_is_changed_at_once_is_followed(scattered):
    from esh.esh_scatter.result.kept_ground import stand_anew

    ground, item = bpy.data.objects["Ground"], scattered.object
    stand_anew(item, 1, esh.Standing(align_to_normal=0.0))
    ground.rotation_euler = (0.4, 0.0, 0.0)
    bpy.context.view_layer.update()
    up = matrices(item)[:, :3, 2]
    np.testing.assert_allclose(up, np.broadcast_to([0, 0, 1], up.shape), atol=1e-4)


def test_share_classes_scale_and_display(scattered):
    item = scattered.object
    modifier = our_modifier(item)

    def count(**values):
        before = get_inputs(modifier)
        set_inputs(modifier, {name.replace("_", " "): value for name, value in values.items()})
        bpy.context.view_layer.update()
        found = shown(item)
        set_inputs(modifier, before)
        bpy.context.view_layer.update()
        return len(found)

    assert count() == 150 == count(Share=1.0) and count(Share=0.0) == 0
    assert 40 < count(Share=0.5) < 110
    assert count(Show_tree=False) == 90 and count(Show_stone=False, Show_tree=False) == 0
    assert count(Display="Bounds") == 150 and count(Display="Points") == 1, "all points are one thing"
    set_inputs(modifier, {"Scale": 2.0, "Display": "Bounds"})
    bpy.context.view_layer.update()
    sizes = np.linalg.norm(matrices(item)[:, :3, 0], axis=1)
    np.testing.assert_allclose(sizes, 2.0, atol=1e-5)
    assert get_inputs(modifier)["Display"] == "Bounds"
    set_inputs(modifier, {"Display": "Points"})
    bpy.context.view_layer.update()
    dots = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).evaluated_geometry()
    assert len(dots.pointcloud.points) == 150


def test_only_what_the_camera_sees_is_shown(scattered):
    item = scattered.object
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(camera)
    camera.data.type, camera.data.ortho_scale = "ORTHO", 8.0
    camera.location = (10.0, 10.0, 30.0)
    bpy.context.scene.camera = camera
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = 200, 100
    everything = matrices(item)[:, :3, 3]
    # Whether a point is seen is told by where it stands, not by where its object's origin is lifted to.
    set_inputs(our_modifier(item), {"Culling": True, "Margin": 0.0})
    bpy.context.view_layer.update()
    seen = matrices(item)[:, :3, 3]
    inside = (np.abs(everything[:, 0] - 10) < 4) & (np.abs(everything[:, 1] - 10) < 2)
    assert len(seen) == inside.sum() > 0
    np.testing.assert_allclose(np.sort(seen, axis=0), np.sort(everything[inside], axis=0), atol=1e-4)
    # Wherever the result itself is: what follows a target stands there.
    item.location.x = 6.0
    bpy.context.view_layer.update()
    np.testing.assert_allclose(matrices(item)[:, :3, 3], seen, atol=1e-5)
    item.location.x = 0.0
    set_inputs(our_modifier(item), {"Margin": 0.25})
    bpy.context.view_layer.update()
    wider = (np.abs(everything[:, 0] - 10) < 6) & (np.abs(everything[:, 1] - 10) < 3)
    assert len(shown(item)) == wider.sum()
    set_inputs(our_modifier(item), {"Distance": 20.0})
    bpy.context.view_layer.update()
    assert len(shown(item)) == 0
    bpy.context.scene.camera = None
    set_inputs(our_modifier(item), {"Culling": False})
    bpy.context.view_layer.update()
    assert len(shown(item)) == 150


def test_inputs_stay_when_the_result_is_made_anew(scattered):
    item = scattered.object
    set_inputs(our_modifier(item), {"Share": 0.5, "Display": "Bounds", "Show stone": False, "Scale": 1.5})
    # As earlier versions called it.
    interface = our_modifier(item).node_group.interface
    next(one for one in interface.items_tree if one.name == "Share").name = "Viewport Share"
    assert get_inputs(our_modifier(item))["Share"] == 0.5
    ground = bpy.data.objects["Ground"]
    more = [
        esh.ScatterClass("new", [esh.ScatterSize("n", 5, bpy.data.objects["Tree"])]),
        esh.ScatterClass("stone", [esh.ScatterSize("s", 9, bpy.data.objects["Stone"])]),
    ]
    again = esh.scatter(ground, more, device="cpu", max_steps=5).object
    assert again == item
    found = get_inputs(our_modifier(item))
    assert (found["Share"], found["Display"], found["Show stone"], found["Scale"]) == (
        0.5,
        "Bounds",
        False,
        1.5,
    )
    assert found["Show new"] and "Show tree" not in found


def test_renders_are_whole_unless_they_are_told_otherwise(scattered, tmp_path):
    """Seen in what Cycles gets: the shadowless silhouette of what is rendered."""
    item = scattered.object
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", 22.0, (10.0, 10.0, 30.0)
    scene.camera = camera
    for name in ("Ground", "Tree", "Stone"):
        bpy.data.objects[name].hide_render = True
    scene.render.engine, scene.cycles.samples, scene.cycles.device = "CYCLES", 1, "CPU"
    scene.render.film_transparent, scene.render.resolution_x, scene.render.resolution_y = True, 96, 96
    scene.render.filepath = str(tmp_path / "seen.png")

    def covered(**values):
        set_inputs(our_modifier(item), {name.replace("_", " "): value for name, value in values.items()})
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        alpha = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(alpha)
        bpy.data.images.remove(image)
        return float(alpha[3::4].sum())

    whole = covered()
    assert whole > 0.0 and covered(Share=0.0, Display="Points") == pytest.approx(whole)
    assert covered(In_Renders=True, Display="Objects") == 0.0


def test_in_a_picture_it_stands_where_the_viewport_shows_it_on_a_target_that_bends_and_is_subdivided_further(
    scattered, tmp_path
):
    """Seen as Cycles does: what the picture shows is the same as where the target has the same level there."""
    ground = bpy.data.objects["Ground"]
    bend = bent_in_other_ways(ground, "shape keys")
    divided = ground.modifiers.new("Divided", "SUBSURF")
    esh.scatter(ground, asked(), device="cpu", max_steps=5)
    bend()
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    # From the side, so that heights are seen.
    camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", 30.0, (10.0, -30.0, 10.0)
    camera.rotation_euler = (math.pi / 2.0, 0.0, 0.0)
    scene.camera = camera
    for name in ("Ground", "Tree", "Stone"):
        bpy.data.objects[name].hide_render = True
    scene.render.engine, scene.cycles.samples, scene.cycles.device = "CYCLES", 1, "CPU"
    scene.render.film_transparent, scene.render.resolution_x, scene.render.resolution_y = True, 128, 128
    scene.render.filepath = str(tmp_path / "seen.png")

    def picture(rendered):
        divided.render_levels = rendered
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        alpha = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(alpha)
        bpy.data.images.remove(image)
        return alpha[3::4]

    expected = picture(1)
    assert 0.0 < expected.mean() < 0.5
    for finer in (2, 4):
        np.testing.assert_allclose(picture(finer), expected, atol=0.01)
    assert np.abs(picture(0) - expected).max() > 0.9, "of coarser ones nothing is known: objects are left behind"


@pytest.mark.parametrize("number", [0, 7, 8, 20])
def test_each_of_many_targets_is_followed_and_no_group_has_nodes_for_all(number):
    """With every node Blender looks at all of a tree: on 200 leaf cards it took 40 s to make one."""
    new_object("Stone", [(0.06, 0, 0), (-0.04, 0.05, 0), (-0.04, -0.05, 0)], [(0, 1, 2)])
    cards = [
        new_object(
            f"Card {k:02}", [(x, 3 * k, 0) for x in (0, 1)] + [(x, 3 * k + 1, 0) for x in (1, 0)], [(0, 1, 2, 3)]
        )
        for k in range(21)
    ]
    size = esh.ScatterSize("s", 84, bpy.data.objects["Stone"], area=0.01)
    result = esh.scatter(cards, [esh.ScatterClass("stone", [size])], surface="whole", device="cpu", max_steps=5)
    group = our_modifier(result.object).node_group
    assert [one.target for one in followed_targets(our_modifier(result.object))] == cards
    assert max(len(part.nodes) for part in bpy.data.node_groups) < 150 and group.users == 1
    before = np.array([matrix.translation for _, matrix in shown(result.object)])
    cards[number].location.z = 5.0
    after = np.array([matrix.translation for _, matrix in shown(result.object)])
    on_it = (before[:, 1] >= 3 * number) & (before[:, 1] <= 3 * number + 1)
    assert on_it.sum() == 4
    np.testing.assert_allclose(after - before, np.outer(on_it, [0.0, 0.0, 5.0]), atol=1e-5)


def test_each_of_several_targets_is_followed_by_what_stands_on_it():
    square = [(0, 0, 0), (5, 0, 0), (5, 5, 0), (0, 5, 0)]
    left, right = (new_object(name, square, [(0, 1, 2, 3)]) for name in ("Left", "Right"))
    right.location.x = 8.0
    stone = new_object("Stone", [(0.06, 0, 0), (-0.04, 0.05, 0), (-0.04, -0.05, 0)], [(0, 1, 2)])
    bpy.context.view_layer.update()
    item = esh.scatter(
        [left, right], [esh.ScatterClass("stone", [esh.ScatterSize("s", 40, stone)])], max_steps=3
    ).object
    before = matrices(item)[:, :3, 3]
    right.location.z = 3.0
    bpy.context.view_layer.update()
    after = matrices(item)[:, :3, 3]
    on_right = before[:, 0] > 6.5
    assert on_right.any() and not on_right.all()
    np.testing.assert_allclose(after[:, 2], before[:, 2] + 3.0 * on_right, atol=1e-5)


@pytest.mark.parametrize("surface", ["above", "whole"])
@pytest.mark.parametrize("before", [(1.0, 1.0, 1.0), (-1.0, 1.0, 1.0)])
@pytest.mark.parametrize("after", [(1.0, 1.0, 1.0), (-1.0, 1.0, 1.0), (1.0, -2.0, 1.0), (-1.0, -1.0, -1.0)])
def test_objects_stand_on_the_same_side_of_a_target_that_is_mirrored(surface, before, after):
    """Its triangles go round the other way then; they hung from below, or were sunk into what is closed."""
    pin = new_object("Pin", [(0.05, 0, 0), (-0.05, 0.05, 0), (-0.05, -0.05, 0), (0, 0, 1)], [(0, 1, 2), (0, 1, 3)])
    still, ground = hills(), hills()
    still.location.x = 40.0
    ground.scale = before
    standing = esh.Standing(align_to_normal=1.0, random_turn=0.0)
    pins = [esh.ScatterClass("pin", [esh.ScatterSize("p", 40, pin)], standing=standing)]
    targets = [ground, still]
    # Of another seed one of them stands so near to a crease that it leans out of its face.
    result = esh.scatter(targets, pins, surface=surface, device="cpu", max_steps=5, seed=1).object
    places = matrices(result)
    ground.scale = after
    bpy.context.view_layer.update()
    now = matrices(result)
    own = places[:, 0, 3] < 25.0
    assert own.any() and not own.all()
    np.testing.assert_allclose(now[~own], places[~own], atol=1e-6)
    change = np.array(after) / np.array(before)
    np.testing.assert_allclose(now[own, :3, 3], places[own, :3, 3] * change, atol=1e-4)
    # Of what is scaled unevenly planes turn otherwise than lines.
    up = places[own, :3, 2] / change
    np.testing.assert_allclose(now[own, :3, 2], up / np.linalg.norm(up, axis=1)[:, None], atol=0.01)
    kept = standing_now(result, bpy.context)
    np.testing.assert_allclose(kept.axes[:, :, 2], now[:, :3, 2], atol=2e-4)


@pytest.mark.parametrize("align", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("after", [(-1.0, 1.0, 1.0), (1.0, -1.0, 1.0)])
def test_objects_on_a_smooth_target_stand_in_its_mirror_image_once_it_is_mirrored(after, align):
    """They lean out of their faces there, and are turned and moved by hand: all of it as a mirror shows it."""
    pin = new_object("Pin", [(0.05, 0, 0), (-0.05, 0.05, 0), (-0.05, -0.05, 0), (0, 0, 1)], [(0, 1, 2), (0, 1, 3)])
    ground = hills()
    ground.data.shade_smooth()
    standing = esh.Standing(align_to_normal=align, tilt=0.3, offset=0.2)
    pins = [esh.ScatterClass("pin", [esh.ScatterSize("p", 40, pin)], standing=standing)]
    result = esh.scatter(ground, pins, device="cpu", max_steps=5).object
    result.data.vertices[7].co.x += 0.3
    result.data.update()
    bpy.context.view_layer.update()
    places = matrices(result)
    ground.scale = after
    bpy.context.view_layer.update()
    now = matrices(result)
    np.testing.assert_allclose(now[:, :3, 3], places[:, :3, 3] * after, atol=2e-4)
    for axis, side in ((0, 1.0), (1, -1.0), (2, 1.0)):
        np.testing.assert_allclose(now[:, :3, axis], side * places[:, :3, axis] * after, atol=2e-5)
    kept = standing_now(result, bpy.context)
    np.testing.assert_allclose(kept.axes, now[:, :3, :3], atol=2e-4)
    # What is exported is what is shown.
    bodies, _ = _read_result(result)
    turned = np.array([Quaternion(one).to_matrix() for one in bodies.rotation.tolist()])
    np.testing.assert_allclose(turned, now[:, :3, :3], atol=2e-4)
