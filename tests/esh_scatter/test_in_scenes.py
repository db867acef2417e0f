"""Which scenes an object is in, as it is found at once for what is seen."""

import time

import bpy
import pytest
from esh.esh_scatter.targets.in_scenes import in_a_scene, in_several_scenes, is_in, is_in_layer


@pytest.fixture
def item(empty_file):
    """An object in a collection of the scene."""
    found = bpy.data.objects.new("Thing", bpy.data.meshes.new("Thing"))
    collection = bpy.data.collections.new("Things")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(found)
    bpy.context.view_layer.update()
    return found


@pytest.mark.parametrize("how", ["seen", "hidden", "disabled", "excluded"])
def test_what_is_in_the_scene_is_found_seen_or_not(item, how):
    scene, layer = bpy.context.scene, bpy.context.view_layer
    if how == "hidden":
        item.hide_set(True)
    item.hide_viewport = how == "disabled"
    layer.layer_collection.children["Things"].exclude = how == "excluded"
    layer.update()
    assert is_in(scene, item) and in_a_scene(item) and not in_several_scenes(item)
    assert is_in_layer(layer, item) == (how != "excluded")
    assert item.visible_get() == (how == "seen"), "also where it is in no view layer"


def test_what_was_deleted_is_in_none(item):
    item.use_fake_user = True
    bpy.data.collections["Things"].objects.unlink(item)
    bpy.context.view_layer.update()
    assert not is_in(bpy.context.scene, item) and not in_a_scene(item)


def test_other_scenes_are_told_apart_also_before_they_were_updated(item):
    here, other = bpy.context.scene, bpy.data.scenes.new("Other")
    assert not is_in(other, item) and not in_several_scenes(item)
    other.collection.objects.link(item)
    assert is_in(other, item) and in_several_scenes(item)
    assert is_in_layer(here.view_layers[0], item)
    bpy.data.collections["Things"].objects.unlink(item)
    assert not is_in(here, item) and in_a_scene(item) and not in_several_scenes(item)
    assert [one.name for one in here.objects] == [one.name for one in bpy.context.view_layer.objects]


def test_ten_thousand_other_objects_take_no_time(item):
    scene = bpy.context.scene
    mesh = bpy.data.meshes.new("Speck")
    for number in range(10_000):
        scene.collection.objects.link(bpy.data.objects.new(f"Speck {number}", mesh))
    last = bpy.data.objects.new("Last", mesh)
    scene.collection.objects.link(last)
    bpy.context.view_layer.update()

    def seconds(found):
        start = time.perf_counter()
        for _ in range(100):
            assert found()
        return time.perf_counter() - start

    by_name = seconds(lambda: scene.objects.get(last.name) == last)
    assert seconds(lambda: is_in(scene, last)) < 0.2 * by_name
    assert seconds(lambda: is_in_layer(bpy.context.view_layer, last)) < 0.2 * by_name
