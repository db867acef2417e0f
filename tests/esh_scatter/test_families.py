"""Objects that belong together are placed as one: a trunk with its leaves, what an empty shows or holds."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.editing import families  # noqa: E402
from mathutils import Matrix  # noqa: E402

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


def instanced(by=None):
    """Names of what results show as instances, and where, shape ``[n, 3]``; or what some objects show."""
    names, places = [], []
    for one in bpy.context.evaluated_depsgraph_get().object_instances:
        showing = one.parent.original if one.is_instance else None
        if showing is not None and (showing in by if by else showing.get("esh_scatter")):
            names.append(one.object.name)
            places.append(one.matrix_world.translation[:])
    return names, np.array(places)


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


def test_a_tree_whose_trunk_has_its_origin_in_its_middle_is_not_sunk_in(ground):
    """Seen from the whole tree, its origin is near the ground."""
    trunk = box("Trunk", 1.0, (-40.0, 0.0, 0.0))
    box("Leaves", 1.0, (-40.0, 0.0, 1.5), trunk)
    roots = box("Stump", 1.0, (-50.0, 0.0, 0.0))
    roots.data.transform(Matrix.Translation((0.0, 0.0, 0.3)))
    box("Twig", 0.2, (-50.0, 0.0, 1.5), roots)
    select(trunk, roots, ground, active=ground)
    bpy.ops.esh.scatter_selection(most=20)
    scatter = bpy.context.scene.esh_scatter.active
    assert [(c.name, c.stand_on) for c in scatter.classes] == [("Stump", "ORIGIN"), ("Trunk", "LOWEST")]
    names, place = instanced()
    heights = {name: set(place[np.array(names) == name][:, 2].round(4)) for name in set(names)}
    assert heights == {"Trunk": {0.5}, "Leaves": {2.0}, "Stump": {0.0}, "Twig": {1.5}}


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
    assert scatter.left_out() == [f'Trunk is left out: "{gone}" was deleted; choose something else to place']
    if gone == "Leaves":
        select(trunk, ground, active=ground)
        bpy.ops.esh.classes_from_selection()
        assert scatter.classes[1].sizes[0].source_object == trunk, "nothing hangs on it any more"


def hang(name, data, parent, place=(0.0, 0.0, 1.0)):
    """Hang an object of any kind on another."""
    item = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(item)
    item.parent, item.location = parent, place
    return item


def test_a_lamp_that_hangs_on_a_post_comes_along_and_takes_no_ground(ground):
    """Posts came without their lamps, in silence."""
    post = box("Post", 0.4)
    bpy.context.view_layer.update()
    scatter = bpy.context.scene.esh_scatter
    areas = []
    for _ in range(2):
        select(post, ground, active=ground)
        assert bpy.ops.esh.scatter_selection(most=20) == {"FINISHED"}
        areas.append(scatter.active.report["classes"][0]["sizes"][0]["area"])
        names, place = instanced()
        if "Lamp" not in bpy.data.objects:
            lamp = hang("Lamp", bpy.data.lights.new("Lamp", "POINT"), post)
            bpy.data.objects.remove(scatter.active.result)  # which stays when its scatter is removed
            bpy.ops.esh.scatter_remove()
    assert areas[0] == areas[1] and names.count("Post") == names.count("Lamp") == 20
    posts, lamps = (place[np.array(names) == name] for name in ("Post", "Lamp"))
    np.testing.assert_allclose(np.linalg.norm(lamps[:, None] - posts[None], axis=-1).min(axis=1), 1.0, atol=1e-4)
    lamp.location.z = 2.0
    bpy.context.view_layer.update()
    assert not scatter.active.changes(), "it shows at once where it hangs now"
    bpy.data.objects.remove(lamp)
    select(post, ground, active=ground)
    bpy.ops.esh.classes_from_selection()
    assert scatter.active.classes[1].sizes[0].source_object == post


def test_a_lamp_is_placed_only_with_what_takes_ground(ground):
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    holder = empty("Holder")
    bpy.context.scene.collection.objects.link(lamp)
    lamp.parent = holder
    assert families.heads_in([lamp, holder], [ground]) == []


def test_a_metaball_that_hangs_on_an_object_is_named(ground):
    from esh.esh_scatter.operators import edit

    post = box("Post", 0.4)
    drop = bpy.data.metaballs.new("Drop")
    drop.elements.new()
    hang("Drop", drop, post)
    told = []
    operator = type("Told", (), {"report": lambda _self, kind, text: told.append((kind, text))})()
    edit.warn_of_unplaced(operator, [post, ground], [post])
    assert told == [({"WARNING"}, "Left out: geometry nodes show no metaballs; convert to a mesh: Drop")]
    select(post, ground, active=ground)
    assert bpy.ops.esh.scatter_selection(most=10) == {"FINISHED"}
    edit.warn_of_unplaced(operator, [], [ground])
    assert len(told) == 1
    alone = hang("Puddle", drop, None)
    edit.warn_of_unplaced(operator, [post, alone], [ground])
    assert told[1:] == [({"WARNING"}, "Left out; convert to a mesh: Puddle")]


def test_leaves_alone_are_placed_alone_and_what_hangs_on_the_ground_is_no_part_of_it(ground):
    trunk = box("Trunk", 0.4)
    leaves = box("Leaves", 1.0, parent=trunk)
    stone = box("Stone", 0.3, parent=ground)
    assert families.as_placed(families.heads_in([leaves, stone, ground], [ground]), [ground]) == [leaves, stone]


def test_what_an_empty_shows_is_placed_as_one_as_the_empty_stands(ground):
    shown = bpy.data.collections.new("Bush")
    for name, height in (("Twig", 0.0), ("Leaf", 2.0)):
        part = box(name, 0.5, (0.0, 0.0, height))
        bpy.context.collection.objects.unlink(part)
        shown.objects.link(part)
    instance = empty("Instance", shown)
    instance.scale = (1.0, 1.0, 1.5)
    select(instance, ground, active=ground)
    assert bpy.ops.esh.scatter_selection(most=10) == {"FINISHED"}
    scatter = bpy.context.scene.esh_scatter.active
    (body_class,) = scatter.classes
    assert (body_class.name, body_class.sizes[0].source_object) == ("Instance", instance)
    assert body_class.align_to_normal == 0.0, "it is higher than wide"
    assert instanced()[0].count("Twig") == instanced()[0].count("Leaf") == 10 and not scatter.changes()

    def heights():
        names, place = instanced()
        return sorted(set(place[np.array(names) == "Leaf"][:, 2].round(4)))

    assert heights() == [3.0]
    instance.scale.z = 2.0
    bpy.context.view_layer.update()
    assert heights() == [4.0] and scatter.changes() == ["Instance edited"]
    bpy.ops.esh.scatter()
    part.location.z = 1.0
    bpy.context.view_layer.update()
    assert scatter.changes() == ["Instance edited"], "what it shows was changed"
    bpy.ops.esh.scatter()
    instance.location.x += 5.0
    bpy.context.view_layer.update()
    assert not scatter.changes(), "where it stands is of no matter"
    select(instance, active=instance)
    bpy.ops.object.delete()
    assert scatter.left_out() == ['Instance is left out: "Instance" was deleted; choose something else to place']


def test_where_a_tree_stands_is_of_no_matter_but_how_it_stands_is(ground):
    """All trees of the scatter went along when the one that is placed was moved aside."""
    trunk = box("Trunk", 0.4, (-40.0, 0.0, 0.0))
    leaves = box("Leaves", 1.0, (-40.0, 0.0, 2.0), trunk)
    select(trunk, ground, active=ground)
    bpy.ops.esh.scatter_selection(most=10)
    scatter = bpy.context.scene.esh_scatter.active
    scatter.result.matrix_world = scatter.result.matrix_world @ Matrix.Rotation(0.4, 4, "Z")
    bpy.context.view_layer.update()
    names, before = instanced()
    trunk.location = (-50.0, 7.0, 3.0)
    bpy.context.view_layer.update()
    np.testing.assert_allclose(instanced()[1], before, atol=1e-4)
    assert not scatter.changes()
    bpy.ops.esh.instances_make_real()
    real = [item for item in bpy.data.objects if item.type == "EMPTY"]
    real_names, place = instanced(by=real)
    trunks, before = place[np.array(real_names) == "Trunk"], before[np.array(names) == "Trunk"]
    own = np.array([item.matrix_world.translation[:] for item in real])
    assert np.linalg.norm(own[:, None] - trunks[None], axis=-1).min(axis=1).max() < 1e-4, "each is where its tree is"
    assert np.linalg.norm(before[:, None] - trunks[None], axis=-1).min(axis=1).max() < 1e-4, "and where it was"
    bpy.ops.esh.instances_from_real()
    leaves.location.x += 1.0
    bpy.context.view_layer.update()
    assert scatter.changes() == ["Trunk edited"], "the tree has another shape"


def test_a_part_that_is_moved_in_a_collection_as_one_is_an_edit(ground):
    both = bpy.data.collections.new("Both")
    for name, x in (("Left", 50.0), ("Right", 52.0)):
        item = box(name, 0.5, (x, 0.0, 0.0))
        bpy.context.collection.objects.unlink(item)
        both.objects.link(item)
    both.instance_offset = (51.0, 0.0, 0.0)
    scatter = bpy.context.scene.esh_scatter.add_scatter(ground)
    size = scatter.add_class().sizes[0]
    size.source_kind, size.source_collection, size.count = "ASSET", both, 5
    bpy.ops.esh.scatter()
    for item in both.objects:
        item.location.x += 3.0
    both.instance_offset.x += 3.0
    bpy.context.view_layer.update()
    assert not scatter.changes(), "all of it went"
    both.objects["Left"].location.x -= 1.0
    bpy.context.view_layer.update()
    assert scatter.changes() == ["Both edited"]
    # Of a collection of variants, each stands on points of its own.
    size.source_kind = "COLLECTION"
    bpy.ops.esh.scatter()
    both.objects["Left"].location.x -= 1.0
    bpy.context.view_layer.update()
    assert not scatter.changes()


def test_an_empty_is_placed_only_with_what_hangs_on_it(ground):
    alone, holder = empty("Alone"), empty("Model")
    wheel = box("Wheel", 0.5, parent=holder)
    assert families.heads_in([alone, holder, wheel], [ground]) == [holder]
    (made,) = families.as_placed([holder], [ground])
    assert list(made.objects) == [wheel]
    select(alone, ground, active=ground)
    assert not bpy.ops.esh.scatter_selection.poll()


@pytest.mark.parametrize("kind", ["ARMATURE", "LATTICE", "LIGHT"])
@pytest.mark.parametrize("both", [False, True])
def test_a_rig_is_placed_with_the_mesh_that_hangs_on_it(ground, kind, both):
    """It was refused, though all of a character hangs on it."""
    data = {
        "ARMATURE": lambda: bpy.data.armatures.new("Rig"),
        "LATTICE": lambda: bpy.data.lattices.new("Rig"),
        "LIGHT": lambda: bpy.data.lights.new("Rig", "POINT"),
    }[kind]()
    rig = bpy.data.objects.new("Rig", data)
    bpy.context.scene.collection.objects.link(rig)
    rig.location = (-40.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    body = box("Body", 1.0, (-40.0, 0.0, 2.0), rig)
    if kind == "ARMATURE":
        body.modifiers.new("Armature", "ARMATURE").object = rig
    select(rig, *([body] if both else []), ground, active=ground)
    assert bpy.ops.esh.scatter_selection(most=10) == {"FINISHED"}
    (body_class,) = bpy.context.scene.esh_scatter.active.classes
    assert (body_class.name, body_class.count) == ("Rig", 10)
    names, place = instanced()
    assert names.count("Body") == 10 and names.count("Rig") == (10 if kind == "LIGHT" else 0)
    np.testing.assert_allclose(place[np.array(names) == "Body"][:, 2], 2.0, atol=1e-4)


def test_a_preset_takes_families_too(ground):
    trunk = box("Trunk", 0.4)
    box("Leaves", 1.0, (0.0, 0.0, 2.0), trunk)
    select(trunk, ground, active=ground)
    from esh.esh_scatter.editing.preset_files import BUILT_IN

    bpy.ops.esh.preset_apply(filepath=str(BUILT_IN / "mixed_forest.json"))
    first = bpy.context.scene.esh_scatter.active.classes[0].sizes[0]
    assert first.source_kind == "ASSET" and {item.name for item in first.source.objects} == {"Trunk", "Leaves"}
