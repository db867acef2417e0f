"""The footprint is the area of the outline seen from above, to 1 %."""

import math

import pytest

bpy = pytest.importorskip("bpy")

from esh.engine.errors import EshError  # noqa: E402
from esh.esh_scatter.classes.object_outline import measure_footprint  # noqa: E402
from esh.esh_scatter.targets import checksums  # noqa: E402

pytestmark = pytest.mark.usefixtures("bare_file")


def footprint():
    return measure_footprint(bpy.context.object, bpy.context, "`area`")


def area():
    return footprint().area


def test_the_long_axis_is_found_wherever_it_points_and_wherever_the_origin_is():
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(7.0, -3.0, 0.0))
    for vertex in bpy.context.object.data.vertices:
        vertex.co.x += 0.5
    bpy.context.object.scale = (4.0, 1.0, 1.0)
    for angle in (0.0, 0.5, 1.4, 2.6):
        bpy.context.object.rotation_euler = (0.0, 0.0, angle)
        found = footprint()
        assert found.is_long
        assert found.length == pytest.approx(4.0, rel=0.02)
        assert found.width == pytest.approx(1.0, rel=0.05)
        assert math.sin(found.angle - angle) == pytest.approx(0.0, abs=0.01)
        assert found.center == pytest.approx((2.0 * math.cos(angle), 2.0 * math.sin(angle)), abs=0.03)
    bpy.context.object.scale = (2.4, 1.0, 1.0)
    assert not footprint().is_long


def test_cube_turned_and_scaled():
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    assert area() == pytest.approx(4.0, rel=1e-6)
    bpy.context.object.rotation_euler = (0, 0, 0.6)
    bpy.context.object.scale = (1, -3, 1)
    assert area() == pytest.approx(12.0, rel=0.01)
    bpy.context.object.rotation_euler = (math.pi / 4, 0, 0)
    bpy.context.object.scale = (1, 1, 1)
    assert area() == pytest.approx(4.0 * math.sqrt(2.0), rel=0.01)


def test_cylinder_and_a_ring_whose_hole_is_free():
    bpy.ops.mesh.primitive_cylinder_add(vertices=256, radius=1.5)
    assert area() == pytest.approx(math.pi * 2.25, rel=0.01)
    bpy.ops.mesh.primitive_torus_add(major_radius=2.0, minor_radius=0.5, major_segments=256, minor_segments=32)
    assert area() == pytest.approx(math.pi * (2.5**2 - 1.5**2), rel=0.01)


def test_what_stands_upright_takes_the_ground_of_a_disc_around_it():
    bpy.ops.mesh.primitive_plane_add(size=0.6, rotation=(math.pi / 2, 0, 0.5))
    for vertex in bpy.context.object.data.vertices:
        vertex.co.x += 0.3
    found = footprint()
    assert found.is_around and not found.is_long
    assert found.area == pytest.approx(math.pi * 0.3**2, rel=1e-5)
    assert found.center == pytest.approx((0.3 * math.cos(0.5), 0.3 * math.sin(0.5)), abs=1e-6)
    assert [math.hypot(x - found.center[0], y - found.center[1]) for x, y in found.corners] == pytest.approx(
        len(found.corners) * [0.3 / math.cos(math.pi / 16)]
    )
    assert found.lowest == pytest.approx(-0.3)


def test_what_stands_upright_as_a_line_takes_no_ground():
    mesh = bpy.data.meshes.new("Line")
    mesh.from_pydata([(0, 0, 0), (0, 0, 1), (0, 0, 2)], [], [(0, 1, 2)])
    item = bpy.data.objects.new("Line", mesh)
    bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item
    with pytest.raises(EshError, match="Line"):
        area()


def test_what_is_no_object_is_a_sentence():
    for item in (None, "Cube", bpy.context.scene):
        with pytest.raises(EshError, match="`item` must be an object or a collection"):
            measure_footprint(item)


def test_what_is_hidden_from_renders_beside_a_model_takes_no_ground():
    """A box that it collides with, for example; of what is hidden as a whole all counts."""
    asset = bpy.data.collections.new("Asset")
    bpy.context.scene.collection.children.link(asset)
    for size in (1.0, 3.0):
        bpy.ops.mesh.primitive_cube_add(size=size)
        asset.objects.link(bpy.context.object)
    model, box = asset.objects
    assert measure_footprint(asset).area == pytest.approx(9.0, rel=0.01)
    before = checksums.of_collection(asset)
    box.hide_render = True
    assert measure_footprint(asset).area == pytest.approx(1.0, rel=0.01)
    assert checksums.of_collection(asset) != before
    model.hide_render = True
    assert measure_footprint(asset).area == pytest.approx(9.0, rel=0.01)
