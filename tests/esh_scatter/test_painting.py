"""Painting a density: what is made for it, and that it is not lost."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.editing.painting import can_be_painted, unsaved_images  # noqa: E402
from esh.esh_scatter.targets import checksums  # noqa: E402


@pytest.fixture
def scatter(empty_file):
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata([(0, 0, 0), (8, 0, 1), (8, 4, 1), (0, 4, 0)], [], [(0, 1, 2, 3)])
    ground = bpy.data.objects.new("Ground", mesh)
    bpy.context.scene.collection.objects.link(ground)
    ground.location = (5.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    made = bpy.context.scene.esh_scatter.add_scatter(ground)
    made.add_class().name = "Pine"
    return made


def test_a_vertex_group_is_made_and_weights_are_painted(scatter):
    assert bpy.ops.esh.layer_paint(kind="VERTEX_GROUP") == {"FINISHED"}
    layer = scatter.active_class.active_layer
    assert (layer.kind, layer.vertex_group) == ("VERTEX_GROUP", "Pine")
    assert scatter.target.mode == "WEIGHT_PAINT" and scatter.target.vertex_groups.active.name == "Pine"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert bpy.ops.esh.layer_paint(kind="SELECTED") == {"FINISHED"}
    assert len(scatter.active_class.layers) == len(scatter.target.vertex_groups) == 1


def test_while_something_hidden_is_in_a_mode_of_its_own_it_is_said_and_nothing_is_changed(scatter):
    """Blender keeps what is hidden in its mode: there was a traceback, and a layer for nothing."""
    bpy.ops.mesh.primitive_cube_add()
    sculpted = bpy.context.object
    bpy.ops.object.mode_set(mode="SCULPT")
    sculpted.hide_viewport = True
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match='"Cube" is hidden, but not in Object Mode: show it first') as raised:
        bpy.ops.esh.layer_paint(kind="VERTEX_GROUP")
    assert "Traceback" not in str(raised.value)
    assert not len(scatter.active_class.layers) and not len(scatter.target.vertex_groups)
    sculpted.hide_viewport = False
    bpy.context.view_layer.update()
    assert bpy.ops.esh.layer_paint(kind="VERTEX_GROUP") == {"FINISHED"} and sculpted.mode == "OBJECT"


def test_a_color_attribute_is_made_black_and_its_colors_are_painted(scatter):
    assert bpy.ops.esh.layer_paint(kind="ATTRIBUTE") == {"FINISHED"}
    layer, colors = scatter.active_class.active_layer, scatter.target.data.color_attributes
    assert (layer.kind, layer.attribute) == ("ATTRIBUTE", "Pine") and scatter.target.mode == "VERTEX_PAINT"
    assert colors.active_color == colors["Pine"] and all(one.color[:] == (0, 0, 0, 1) for one in colors["Pine"].data)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert bpy.ops.esh.layer_paint(kind="SELECTED") == {"FINISHED"} and len(colors) == 1
    bpy.ops.object.mode_set(mode="OBJECT")
    layer.attribute = scatter.target.data.attributes.new("moist", "FLOAT", "POINT").name
    assert not can_be_painted(layer, scatter.target), "numbers are not painted"
    layer.attribute = "wet"
    assert bpy.ops.esh.layer_paint(kind="SELECTED") == {"FINISHED"} and "wet" in scatter.target.data.color_attributes


def test_colors_are_painted_for_a_class_whose_name_is_longer_than_an_attribute_keeps(scatter):
    scatter.active_class.name = "Сосна обыкновенная, высокая, 20 лет, у реки"
    assert bpy.ops.esh.layer_paint(kind="ATTRIBUTE") == {"FINISHED"}
    layer = scatter.active_class.active_layer
    assert layer.attribute in scatter.target.data.color_attributes and scatter.active_class.name.startswith(
        layer.attribute
    )


def test_an_image_is_made_black_and_lies_as_seen_from_above(scatter):
    assert bpy.ops.esh.layer_paint(kind="IMAGE", resolution=64) == {"FINISHED"}
    layer, mesh = scatter.active_class.active_layer, scatter.target.data
    assert scatter.target.mode == "TEXTURE_PAINT"
    assert bpy.context.scene.tool_settings.image_paint.canvas == layer.image
    assert tuple(layer.image.size) == (64, 64) and not any(layer.image.pixels[:3])
    # A black brush would do nothing.
    paint = bpy.context.scene.tool_settings.image_paint
    shared = getattr(paint, "unified_paint_settings", None) or bpy.context.scene.tool_settings.unified_paint_settings
    assert shared.color[:] == (1.0, 1.0, 1.0) and not any(shared.secondary_color)
    # And painted on again, the brush keeps the color that somebody has chosen.
    shared.color = (0.25, 0.25, 0.25)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert bpy.ops.esh.layer_paint(kind="SELECTED") == {"FINISHED"} and shared.color[0] == 0.25
    bpy.ops.object.mode_set(mode="OBJECT")
    uv = np.empty(2 * len(mesh.loops), np.float32)
    mesh.uv_layers[layer.uv_map].uv.foreach_get("vector", uv)
    np.testing.assert_allclose(uv.reshape(-1, 2), [(0, 0), (1, 0), (1, 1), (0, 1)], atol=1e-6)
    # An image that lay over the target is laid just so by the map.
    other = scatter.active_class.add_layer("IMAGE", image=layer.image)
    assert other.image_mapping == "POSITION" and bpy.ops.esh.layer_paint(kind="SELECTED") == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    assert (other.image_mapping, other.uv_map) == ("UV", layer.uv_map) and len(mesh.uv_layers) == 1


def test_painted_images_are_packed_when_the_file_is_saved(scatter, tmp_path):
    image = bpy.data.images.new("mask", 8, 8, is_data=True)
    layer = scatter.active_class.add_layer("IMAGE", image=image)
    unrelated = bpy.data.images.new("unrelated", 8, 8)
    for painted in (image, unrelated):
        painted.pixels[0] = 0.5
        painted.update()
    assert unsaved_images(scatter) == [image]
    layer.kind = "NOISE"
    assert unsaved_images(scatter) == []
    # Flow is lost as densities are.
    flow = bpy.data.images.new("flow", 8, 8, is_data=True)
    flow.pixels[0] = 0.5
    flow.update()
    scatter.active_class.direction_image = flow
    assert unsaved_images(scatter) == []
    scatter.active_class.direction_kind, layer.kind = "IMAGE", "IMAGE"
    assert unsaved_images(scatter) == [flow, image]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "painted.blend"))
    assert unsaved_images(scatter) == [] and not unrelated.packed_file and flow.packed_file
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "painted.blend"))
    image = bpy.context.scene.esh_scatter.active.active_class.layers[0].image
    assert image.pixels[0] == pytest.approx(0.5, abs=0.01)


def test_why_nothing_can_be_painted_is_said(scatter):
    scatter.active_class.add_layer("IMAGE")
    scatter.active_class.add_layer("NOISE")
    with pytest.raises(RuntimeError, match="Select a layer that follows an image, a vertex group or a color attribute"):
        bpy.ops.esh.layer_paint(kind="SELECTED")
    scatter.target.hide_viewport = True
    with pytest.raises(RuntimeError, match='"Ground" must be visible'):
        bpy.ops.esh.layer_paint(kind="IMAGE")
    scatter.target = None
    with pytest.raises(RuntimeError, match="Choose a target first"):
        bpy.ops.esh.layer_paint(kind="IMAGE")


def test_why_a_mesh_of_another_file_is_not_painted_on_is_said(scatter, tmp_path):
    bpy.data.libraries.write(str(tmp_path / "ground.blend"), {scatter.target})
    with bpy.data.libraries.load(str(tmp_path / "ground.blend"), link=True) as (_, wanted):
        wanted.objects = ["Ground"]
    (linked,) = wanted.objects
    bpy.context.scene.collection.objects.link(linked)
    for target in (linked, linked.override_create()):
        scatter.target = target
        with pytest.raises(RuntimeError, match=r"belongs to another file\. To paint"):
            bpy.ops.esh.layer_paint(kind="IMAGE")


def test_without_a_layer_that_can_be_painted_an_image_is_made(scatter):
    body_class = scatter.active_class
    body_class.add_layer("SLOPE")
    assert bpy.ops.esh.layer_paint(resolution=16) == {"FINISHED"}
    assert [layer.kind for layer in body_class.layers] == ["SLOPE", "IMAGE"] and scatter.target.mode == "TEXTURE_PAINT"


def rough_ground(scatter):
    """Subdivision rounds the positions of such a ground otherwise once it has a UV map."""
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=12, y_subdivisions=12)
    ground = bpy.context.object
    for layer in list(ground.data.uv_layers):
        ground.data.uv_layers.remove(layer)
    for number, vertex in enumerate(ground.data.vertices):
        vertex.co.z = np.sin(1.7 * number)
    ground.modifiers.new("Subdivision", "SUBSURF")
    scatter.target, scatter.active_class.sizes[0].source_object = ground, scatter.target
    return ground


def as_ran(scatter):
    scatter.report_json, scatter.ran_with = "{}", scatter.fingerprint()


def test_a_uv_map_that_is_made_to_paint_is_no_change_of_shape(scatter):
    ground = rough_ground(scatter)
    ground.modifiers.new("Displace", "DISPLACE").strength = 0.1
    as_ran(scatter)
    other = bpy.context.scene.esh_scatter.add_scatter(ground)
    as_ran(other)
    bpy.context.scene.esh_scatter.scatter_index = 0
    scatter = bpy.context.scene.esh_scatter.active
    number = checksums.of_shape(ground)
    assert bpy.ops.esh.layer_paint(kind="IMAGE", resolution=16) == {"FINISHED"} and len(ground.data.uv_layers) == 1
    assert checksums.of_shape(ground) != number, "what this test is about"
    assert scatter.changes() == ["density of Pine"] and not other.changes()
    bpy.ops.object.mode_set(mode="OBJECT")
    ground.data.vertices[5].co.z += 0.5
    ground.data.update()
    assert other.changes() == ["shape or place of the target"]


def test_a_uv_map_that_is_made_to_paint_hides_no_change_of_before(scatter):
    ground = rough_ground(scatter)
    as_ran(scatter)
    ground.data.vertices[5].co.z += 0.5
    ground.data.update()
    assert bpy.ops.esh.layer_paint(kind="IMAGE", resolution=16) == {"FINISHED"}
    assert "shape or place of the target" in scatter.changes()


def test_a_uv_map_that_somebody_makes_is_no_change_of_the_shape_of_subdivided_ground(scatter):
    ground = rough_ground(scatter)
    as_ran(scatter)
    number = checksums.of_shape(ground)
    uv = ground.data.uv_layers.new(name="Unwrapped", do_init=False).uv
    for entry, loop in zip(uv, ground.data.loops, strict=True):
        entry.vector = ground.data.vertices[loop.vertex_index].co.xy / 20.0
    ground.data.update()
    assert checksums.of_shape(ground) != number, "what this test is about"
    assert scatter.changes() == []
