"""Results that no scatter of the scene has made: copies that are made scatters of their own, and what new scatters leave alone."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.result.display import our_modifier  # noqa: E402
from esh.esh_scatter.result.result import is_copy  # noqa: E402

pytestmark = pytest.mark.usefixtures("registered")


@pytest.fixture
def registered():
    from esh.esh_scatter import registration

    bpy.ops.wm.read_factory_settings(use_empty=True)
    registration.register()
    yield
    registration.unregister()


@pytest.fixture
def scatter():
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=10, y_subdivisions=10)
    ground = bpy.context.object
    ground.name = "Ground"
    made = bpy.context.scene.esh_scatter.add_scatter(ground)
    for name in ("Pine", "Beech"):
        bpy.ops.mesh.primitive_cone_add(radius1=0.2, depth=1.0, location=(60, 0, 0))
        bpy.context.object.name = name
        body_class = made.add_class()
        body_class.name = name
        body_class.sizes[0].source_object, body_class.sizes[0].count = bpy.context.object, 40
    made.classes[0].add_layer("NOISE").use_curve = True
    made.classes[1].may_overlap = "Pine"
    made.device, made.max_steps, made.regularity = "CPU", 10, 0.7
    bpy.ops.esh.scatter()
    return made


def copied(*others, linked=False):
    """Copy the result, together with others; returns the copy, which is active."""
    bpy.ops.object.select_all(action="DESELECT")
    result = bpy.context.scene.esh_scatter.scatters[0].result
    for item in (result, *others):
        item.select_set(True)
    bpy.context.view_layer.objects.active = result
    bpy.ops.object.duplicate(linked=linked)
    assert bpy.context.object != result and is_copy(bpy.context.object, result)
    return bpy.context.object


def places(item):
    return np.array([vertex.co[:] for vertex in item.data.vertices])


def shown(item):
    found = bpy.context.evaluated_depsgraph_get().object_instances
    return sum(one.is_instance and one.parent.original == item for one in found)


@pytest.mark.parametrize("linked", [True, False])
def test_a_copy_becomes_a_scatter_with_the_same_settings_and_each_runs_by_itself(scatter, linked):
    result, copy = scatter.result, copied(linked=linked)
    before = places(copy)
    assert bpy.ops.esh.scatter_of_copy() == {"FINISHED"}
    first, own = bpy.context.scene.esh_scatter.scatters
    assert bpy.context.scene.esh_scatter.active == own
    assert (own.name, own.result, own.target, own.live) == (copy.name, copy, first.target, False)
    assert (own.regularity, own.max_steps) == (first.regularity, 10)
    assert [c.name for c in own.classes] == ["Pine", "Beech"] and own.classes[1].names_that_may_overlap == {"Pine"}
    assert own.classes[0].layers[0].curve != first.classes[0].layers[0].curve
    assert our_modifier(copy).node_group != our_modifier(result).node_group and copy.data != result.data
    np.testing.assert_array_equal(places(copy), before)
    assert (shown(result), shown(copy)) == (80, 80)

    own.keep_off_others, own.seed, own.classes[0].sizes[0].count = False, 5, 30
    bpy.ops.esh.scatter()
    assert own.result == copy and (shown(result), shown(copy)) == (80, 70)
    np.testing.assert_array_equal(places(result), before)
    kept = places(copy)
    bpy.context.scene.esh_scatter.scatter_index = 0
    first.classes[1].sizes[0].count = 20
    bpy.ops.esh.scatter()
    assert first.result == result and (shown(result), shown(copy)) == (60, 70)
    np.testing.assert_array_equal(places(copy), kept)
    assert not bpy.ops.esh.scatter_of_copy.poll()


def test_a_copy_that_follows_a_copy_of_the_target_is_scattered_on_that(scatter):
    copied(scatter.target)
    bpy.ops.esh.scatter_of_copy()
    own = bpy.context.scene.esh_scatter.active
    assert own.target == bpy.data.objects["Ground.001"]
    own.target.location.x = 50.0
    bpy.ops.esh.scatter()
    assert places(own.result)[:, 0].min() > 39.0 and own.name == own.result.name


def test_undo_takes_the_scatter_away_and_leaves_the_copy(scatter):
    bpy.ops.ed.undo_push(message="scattered")
    copied()
    bpy.ops.ed.undo_push(message="copied")
    bpy.ops.esh.scatter_of_copy("EXEC_DEFAULT", True)
    bpy.ops.ed.undo()
    settings = bpy.context.scene.esh_scatter
    assert len(settings.scatters) == 1 and bpy.ops.esh.scatter_of_copy.poll()
    bpy.ops.ed.redo()
    assert len(bpy.context.scene.esh_scatter.scatters) == 2
    assert bpy.context.scene.esh_scatter.scatters[1].result == bpy.context.object


@pytest.mark.parametrize("way", ["removed", "appended"])
def test_a_new_scatter_leaves_a_result_without_settings_as_it_is(scatter, tmp_path, way):
    target, kept = scatter.target.name, scatter.result.name
    if way == "removed":
        bpy.ops.esh.scatter_remove()
    else:
        path = str(tmp_path / "forest.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.read_homefile(use_empty=True)
        bpy.ops.wm.append(
            directory=f"{path}/Object/", files=[{"name": target}, {"name": kept}, {"name": "Pine"}], filename=kept
        )
    before = places(bpy.data.objects[kept])
    made = bpy.context.scene.esh_scatter.add_scatter(bpy.data.objects[target])
    assert made.name == "Ground Scatter 2"
    made.name = "Ground Scatter"
    size = made.add_class().sizes[0]
    size.source_object, size.count = bpy.data.objects["Pine"], 10
    made.device, made.max_steps = "CPU", 10
    bpy.ops.esh.scatter()
    assert made.result.name == made.name == "Ground Scatter 2" and shown(made.result) == 10
    np.testing.assert_array_equal(places(bpy.data.objects[kept]), before)
    made.name = "Grove"
    assert made.result.name == "Grove"


def appended(path, name, *, into_scene=True):
    """Append an object of a file to the empty scene; returns it, active."""
    with bpy.data.libraries.load(str(path)) as (_, to):
        to.objects = [name]
    item = to.objects[0]
    bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item
    return item


def test_a_result_that_is_appended_has_its_settings_with_it(scatter, tmp_path):
    """What it is scattered on, and what is placed, come along; settings were to be made anew."""
    name, before = scatter.result.name, places(scatter.result)
    path = tmp_path / "forest.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True)
    item = appended(path, name)
    assert bpy.ops.esh.scatter_of_copy.poll()
    assert bpy.ops.esh.scatter_of_copy() == {"FINISHED"}
    assert not bpy.ops.esh.scatter_of_copy.poll()
    own = bpy.context.scene.esh_scatter.active
    assert own.result == item and own.target == bpy.data.objects["Ground"]
    assert own.name == item.name == name and own.target.name in bpy.context.scene.objects
    assert (own.regularity, own.max_steps, own.device) == (pytest.approx(0.7), 10, "CPU")
    assert [c.name for c in own.classes] == ["Pine", "Beech"] and own.classes[1].names_that_may_overlap == {"Pine"}
    assert [c.sizes[0].source_object.name for c in own.classes] == ["Pine", "Beech"]
    assert own.classes[0].layers[0].kind == "NOISE" and own.classes[0].layers[0].curve is not None
    np.testing.assert_array_equal(places(item), before)
    own.classes[0].sizes[0].count = 25
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert own.result == item and len(places(item)) == 65


def test_settings_are_those_of_the_last_run(scatter, tmp_path):
    scatter.classes[0].sizes[0].count = 33
    kept = scatter.result.esh_made_with.scatters[0]
    assert kept.classes[0].sizes[0].count == 40
    bpy.ops.esh.scatter()
    kept = scatter.result.esh_made_with.scatters[0]
    assert len(scatter.result.esh_made_with.scatters) == 1 and kept.classes[0].sizes[0].count == 33
    curves = len(bpy.data.node_groups)
    bpy.ops.esh.scatter()
    assert len(bpy.data.node_groups) == curves


def test_a_result_of_another_scene_of_the_file_is_not_taken(scatter):
    result = scatter.result
    other = bpy.data.scenes.new("Other")
    bpy.context.window.scene = other
    other.collection.objects.link(result)
    bpy.context.view_layer.objects.active = result
    assert not bpy.ops.esh.scatter_of_copy.poll()


def test_a_result_that_is_appended_twice_is_no_copy_of_the_first_one(scatter, tmp_path):
    """Each has what it was made with, whatever the first one was changed to since, and its own target."""
    name, path = scatter.result.name, tmp_path / "forest.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True)
    made = []
    for number in range(2):
        item = appended(path, name)
        assert bpy.ops.esh.scatter_of_copy() == {"FINISHED"}
        own = bpy.context.scene.esh_scatter.active
        assert own.result == item and own.classes[0].sizes[0].count == 40
        assert own.target.name in bpy.context.scene.objects
        own.classes[0].sizes[0].count = 7 + number
        assert bpy.ops.esh.scatter() == {"FINISHED"}
        made.append((own.target, len(places(item))))
    assert made[0][0] != made[1][0] and [count for _, count in made] == [47, 48]


def test_an_override_of_a_linked_result_can_be_scattered_anew(scatter, tmp_path):
    name, path = scatter.result.name, tmp_path / "forest.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(str(path), link=True) as (_, to):
        to.objects = [name, "Ground"]
    for item in to.objects:
        bpy.context.scene.collection.objects.link(item)
    override = to.objects[0].override_create(remap_local_usages=True)
    bpy.context.view_layer.objects.active = override
    assert bpy.ops.esh.scatter_of_copy() == {"FINISHED"}
    own = bpy.context.scene.esh_scatter.active
    own.classes[0].sizes[0].count = 12
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert len(places(own.result)) == 52
