"""Objects that look at a point or an object: after a run, at once when that is changed or moved, and beside pins."""

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
from esh.engine.surface.instances import rotate  # noqa: E402
from esh.esh_scatter.solving import live  # noqa: E402
from esh.esh_scatter.targets import mesh_attributes  # noqa: E402

STAGE = (4.0, 30.0, 2.0)


pytestmark = pytest.mark.usefixtures("empty_file")


@pytest.fixture
def scatter():
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=10, y_subdivisions=10, location=(3.0, -5.0, 1.0))
    made = bpy.context.scene.esh_scatter.add_scatter(bpy.context.object)
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=(60.0, 0.0, 0.0))
    chair = bpy.context.object
    bpy.ops.object.empty_add(location=STAGE)
    bpy.context.object.name = "Stage"
    body_class = made.add_class()
    body_class.name = "Chair"
    size = body_class.sizes[0]
    size.source_object, size.count, size.area_kind, size.area, size.shape = chair, 80, "VALUE", 0.5, "DOT"
    body_class.align_to_normal = 0.0
    made.device, made.max_steps = "CPU", 8
    return made


def past(result, point, front=(0.0, -1.0, 0.0)):
    """How far objects look past a point, seen from above [rad], shape ``[n]``."""
    place = mesh_attributes.read_attribute(result.data, "position")
    rotation = mesh_attributes.read_attribute(result.data, "rotation").astype(float)
    looks = rotate(rotation, np.broadcast_to(np.array(front), (len(place), 3)))
    way = np.array(point[:2]) - place[:, :2]
    angle = np.arctan2(looks[:, 1], looks[:, 0]) - np.arctan2(way[:, 1], way[:, 0])
    return np.mod(angle + math.pi, 2.0 * math.pi) - math.pi


def test_a_class_looks_at_an_object_and_past_it_by_the_spread(scatter):
    chairs = scatter.classes[0]
    chairs.use_look_at, chairs.look_at_object = True, bpy.data.objects["Stage"]
    bpy.ops.esh.scatter()
    assert np.abs(past(scatter.result, STAGE)).max() < 1e-3 and not scatter.outdated
    for front, axis in (("NEGATIVE_X", (-1, 0, 0)), ("POSITIVE_Y", (0, 1, 0))):
        chairs.look_at_front = front
        assert np.abs(past(scatter.result, STAGE, axis)).max() < 1e-3, "at once"
    chairs.look_at_spread = 0.5
    away = past(scatter.result, STAGE, (0, 1, 0))
    assert 0.4 < np.abs(away).max() <= 0.501 and not scatter.outdated
    at_once = mesh_attributes.read_attribute(scatter.result.data, "rotation")
    bpy.ops.esh.scatter()
    np.testing.assert_allclose(mesh_attributes.read_attribute(scatter.result.data, "rotation"), at_once, atol=1e-5)


def test_switched_on_and_off_nothing_is_solved(scatter):
    bpy.ops.esh.scatter()
    before = {name: mesh_attributes.read_attribute(scatter.result.data, name) for name in ("rotation", "position")}
    chairs = scatter.classes[0]
    chairs.use_look_at, chairs.look_at_point = True, (3.0, -40.0, 0.0)
    assert np.abs(past(scatter.result, (3.0, -40.0))).max() < 1e-3 and not scatter.outdated
    chairs.use_look_at = False
    assert not scatter.outdated
    for name, values in before.items():
        np.testing.assert_array_equal(mesh_attributes.read_attribute(scatter.result.data, name), values, name)


def test_what_is_looked_at_is_followed_when_it_moves(scatter):
    chairs, stage = scatter.classes[0], bpy.data.objects["Stage"]
    chairs.use_look_at, chairs.look_at_object = True, stage
    bpy.ops.esh.scatter()
    stage.location = (-50.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    assert scatter.changes() == ["place of Stage"]
    bpy.ops.esh.scatter()
    assert not scatter.outdated and np.abs(past(scatter.result, (-50.0, 0.0))).max() < 1e-3


def test_live_turns_them_without_solving(scatter, follow):
    chairs, stage = scatter.classes[0], bpy.data.objects["Stage"]
    chairs.use_look_at, chairs.look_at_object = True, stage
    bpy.ops.esh.scatter()
    scatter.live = True
    try:
        follow()
        (one,) = live._followed.values()
        place = mesh_attributes.read_attribute(scatter.result.data, "position")
        stage.location = (-50.0, 0.0, 0.0)
        bpy.context.view_layer.update()
        one._looked = 0.0
        live._tick()
        assert not one.busy, "there is nothing to solve"
        assert np.abs(past(scatter.result, (-50.0, 0.0))).max() < 1e-3 and not scatter.outdated
        np.testing.assert_array_equal(mesh_attributes.read_attribute(scatter.result.data, "position"), place)
    finally:
        scatter.live = False
        live._tick()


def test_outlines_are_solved_anew_and_pinned_ones_keep_their_turn(scatter):
    chairs, stage = scatter.classes[0], bpy.data.objects["Stage"]
    chairs.sizes[0].area_kind, chairs.sizes[0].shape = "MESH", "AUTO"
    assert not chairs.is_round
    bpy.ops.esh.scatter()
    assert not scatter.outdated
    chairs.use_look_at, chairs.look_at_object = True, stage
    assert np.abs(past(scatter.result, STAGE)).max() < 1e-3, "it is seen at once"
    assert scatter.changes() == ["look at of Chair"], "the switch says it all"
    bpy.ops.esh.scatter()
    assert not scatter.outdated and np.abs(past(scatter.result, STAGE)).max() < 0.04
    scatter.result.data.vertices.foreach_set("select", [number < 5 for number in range(80)])
    bpy.ops.esh.instances_pin()
    pinned = mesh_attributes.read_attribute(scatter.result.data, "id")[:5]
    before = mesh_attributes.read_attribute(scatter.result.data, "rotation")[:5]
    chairs.look_at_front = "POSITIVE_X"
    bpy.ops.esh.scatter()
    row = {number: k for k, number in enumerate(mesh_attributes.read_attribute(scatter.result.data, "id").tolist())}
    rows = [row[number] for number in pinned.tolist()]
    after = mesh_attributes.read_attribute(scatter.result.data, "rotation")[rows]
    np.testing.assert_allclose(np.abs((before * after).sum(axis=1)), 1.0, atol=1e-5)
    others = np.setdiff1d(np.arange(80), rows)
    assert np.abs(past(scatter.result, STAGE, (1, 0, 0))[others]).max() < 0.04


def test_scripts_take_an_object_or_a_point_on_a_whole_surface_too():
    bpy.ops.mesh.primitive_uv_sphere_add(radius=3.0)
    ball = bpy.context.object
    bpy.ops.mesh.primitive_cone_add(radius1=0.05, depth=0.2, location=(60, 0, 0))
    cone = bpy.context.object
    bpy.ops.object.empty_add(location=(0.0, 0.0, 50.0))
    for look_at in (bpy.context.object, esh.LookAt((0.0, 0.0, 50.0))):
        eyes = esh.ScatterClass("eye", [esh.ScatterSize("s", 60, cone, area=0.05, line=False)], look_at=look_at)
        result = esh.scatter(ball, [eyes], surface="whole", device="cpu", max_steps=8)
        place, normal = result.placement.position, result.placement.normal
        looks = rotate(result.instances.rotation.astype(float), np.tile([0.0, -1.0, 0.0], (60, 1)))
        way = np.array([0.0, 0.0, 50.0]) - place
        way -= (way * normal).sum(axis=1, keepdims=True) * normal
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        seen = np.abs(place[:, 2]) < 2.7
        # Shading normals lean a little beside those of the faces.
        assert (way * looks).sum(axis=1)[seen].min() > 0.98
    with pytest.raises(esh.EshError, match='`look_at` of class "eye" must be a LookAt, an object or None; got 3'):
        esh.ScatterClass("eye", [esh.ScatterSize("s", 60, cone)], look_at=3)
