"""What was deleted in the viewport acts no longer, and the sidebar names it: obstacles, and what classes follow or look at."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.solving import live  # noqa: E402
from esh.esh_scatter.targets.mesh_attributes import read_attribute  # noqa: E402

pytestmark = pytest.mark.usefixtures("empty_file")


def cube(name, size, location):
    bpy.ops.mesh.primitive_cube_add(size=size, location=location)
    bpy.context.object.name = name
    return bpy.context.object


@pytest.fixture
def scatter():
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=20, y_subdivisions=20)
    settings = bpy.context.scene.esh_scatter.add_scatter(bpy.context.object)
    for name in ("Pine", "Beech"):
        size = settings.add_class().sizes[0]
        size.source_object, size.count = cube(name, 0.2, (50.0, 0.0, 0.0)), 80
        settings.classes[-1].name = name
    settings.device, settings.max_steps = "CPU", 10
    return settings


def delete(item):
    bpy.ops.object.select_all(action="DESELECT")
    item.select_set(True)
    bpy.context.view_layer.objects.active = item
    bpy.ops.object.delete()


def active():
    return bpy.context.scene.esh_scatter.active


def run():
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    return read_attribute(active().result.data, "position"), read_attribute(active().result.data, "class_index")


def near(position):
    """How many points are below the rock."""
    return int((np.abs(position[:, :2] + 5.0).max(axis=1) < 2.5).sum())


def test_a_deleted_obstacle_is_kept_off_no_longer(scatter):
    rock = cube("Rock", 5.0, (-5.0, -5.0, 0.0))
    scatter.obstacles.add().item = rock
    assert near(run()[0]) == 0 and not active().outdated and not active().left_out()
    delete(rock)
    scatter = active()
    assert scatter.outdated
    assert scatter.left_out() == ["Rock is left out: it was deleted; choose something else to avoid"]
    assert near(run()[0]) > 0 and not active().outdated
    active().obstacles[0].use = False
    assert not active().left_out()


@pytest.mark.parametrize("kind", ["DISTANCE", "INSIDE", "CAMERA", "look at"])
def test_a_class_is_left_out_whose_layer_or_view_leads_to_what_was_deleted(scatter, kind):
    pine = scatter.classes["Pine"]
    if kind == "CAMERA":
        bpy.ops.object.camera_add(location=(-5.0, -5.0, 10.0))
        pine.add_layer(kind, camera=bpy.context.object)
    elif kind == "look at":
        pine.look_at_object, pine.use_look_at = cube("Thing", 1.0, (-5.0, -5.0, 0.0)), True
    elif kind == "INSIDE":
        bpy.ops.curve.primitive_bezier_circle_add(radius=3.0, location=(-5.0, -5.0, 0.0))
        pine.add_layer(kind, source_object=bpy.context.object)
    else:
        pine.add_layer(kind, source_object=cube("Thing", 1.0, (-5.0, -5.0, 0.0)))
    item = pine.look_at_object if kind == "look at" else bpy.context.object
    item.name = "Thing"
    run()
    assert not active().outdated and not active().left_out()
    delete(item)
    what = {"DISTANCE": "object to be near", "INSIDE": "object to be inside", "CAMERA": "camera"}
    said = f'Pine is left out: "Thing" was deleted; choose another {what.get(kind, "object to look at")}'
    assert active().left_out() == [said] and active().changes() == ["without Pine"]
    assert len(run()[0]) == 80 and not active().outdated
    if kind == "look at":
        active().classes["Pine"].use_look_at = False
    else:
        active().classes["Pine"].layers[0].use = False
    assert not active().left_out() and len(run()[0]) == 160


def test_what_is_hidden_excluded_or_in_another_scene_acts_as_before(scatter):
    rock = cube("Rock", 5.0, (-5.0, -5.0, 0.0))
    scatter.obstacles.add().item = rock
    scatter.classes["Pine"].add_layer("DISTANCE", source_object=rock)
    rock.hide_viewport = True
    assert not scatter.left_out() and scatter.obstacles[0].ready
    rock.hide_viewport = False
    apart = bpy.data.collections.new("Apart")
    apart.objects.link(rock)
    bpy.context.scene.collection.children.link(apart)
    bpy.context.scene.collection.objects.unlink(rock)
    bpy.context.view_layer.layer_collection.children["Apart"].exclude = True
    assert not scatter.left_out() and scatter.obstacles[0].ready
    bpy.context.scene.collection.children.unlink(apart)
    assert not scatter.left_out() and scatter.obstacles[0].ready, "a collection in no scene may be shown by instances"
    bpy.data.scenes.new("Other").collection.children.link(apart)
    assert not scatter.left_out() and scatter.obstacles[0].ready


def test_live_stops_where_what_a_class_follows_is_deleted(scatter, follow):
    thing = cube("Thing", 1.0, (-5.0, -5.0, 0.0))
    scatter.classes["Pine"].add_layer("DISTANCE", source_object=thing)
    run()
    active().live = True
    follow()
    delete(thing)
    follow()
    assert not active().live
    assert '"Thing" was deleted' in live.status(bpy.context.scene, active())


def test_what_is_not_found_in_its_library_is_left_out_with_its_file(scatter, tmp_path):
    """Blender has an empty in its place, which was told of as edited, and refused for its type."""
    path = tmp_path / "props.blend"
    barrel, crate, wall = (cube(name, 0.2, (50.0, 0.0, 0.0)) for name in ("Barrel", "Crate", "Wall"))
    crates = bpy.data.collections.new("Crates")
    crates.objects.link(crate)
    bpy.data.libraries.write(str(path), {barrel, crates, wall})
    for item in (barrel, crate, wall):
        bpy.data.objects.remove(item)
    bpy.data.collections.remove(crates)
    with bpy.data.libraries.load(str(path), link=True) as (_, wanted):
        wanted.objects, wanted.collections = ["Barrel", "Wall"], ["Crates"]
    for item in wanted.objects:
        bpy.context.scene.collection.objects.link(item)
    scatter.classes["Beech"].active_size.source_object, wall = wanted.objects
    scatter.add_class().active_size.place(wanted.collections[0])
    scatter.obstacles.add().item = wall
    run()
    assert not active().left_out() and not active().outdated
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "street.blend"))
    path.rename(tmp_path / "moved.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "street.blend"))
    assert active().left_out() == [
        'Barrel is left out: "Barrel" was not found in props.blend; choose something else to place',
        'Crates is left out: "Crates" was not found in props.blend; choose something else to place',
        "Wall is left out: it was not found in props.blend; choose something else to avoid",
    ]
    assert active().changes() == ["obstacles", "without Barrel", "without Crates"]
    assert len(run()[0]) == 80 and not active().outdated
    active().target = bpy.data.objects["Barrel"]
    said = '"Barrel" was not found in props.blend; choose another target'
    assert active().obstacle(bpy.context.scene) == said
    (tmp_path / "moved.blend").rename(path)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "street.blend"))
    assert not active().left_out() and not active().outdated, "it is there again"
