"""Long objects that lie along curves and along vectors of the target: seen from above, on whole surfaces, and in the sidebar."""

import warnings

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
from esh.engine.surface.instances import rotate  # noqa: E402
from esh.esh_scatter.targets import mesh_attributes  # noqa: E402
from mathutils import Euler  # noqa: E402

pytestmark = pytest.mark.usefixtures("empty_file")

RUN = {"device": "cpu", "max_steps": 40, "seed": 2}


@pytest.fixture
def log():
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(60.0, 0.0, 0.0))
    item = bpy.context.object
    item.name, item.scale = "Log", (0.8, 0.12, 0.12)
    return item


@pytest.fixture
def ground():
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=10, y_subdivisions=10)
    return bpy.context.object


def ring(radius, location=(0.0, 0.0, 0.0), **named):
    bpy.ops.curve.primitive_bezier_circle_add(radius=radius, location=location, **named)
    return bpy.context.object


def cylinder():
    bpy.ops.mesh.primitive_cylinder_add(vertices=48, radius=2.0, depth=8.0, end_fill_type="NOTHING")
    return bpy.context.object


def wood(item, direction, count=150):
    return [esh.ScatterClass("wood", [esh.ScatterSize("log", count, item)], direction=direction)]


def along(result, wanted):
    """|cos| between the objects' long axes and where they should lie, shape ``[n]``."""
    place = mesh_attributes.read_attribute(result.data, "position").astype(float)
    rotation = mesh_attributes.read_attribute(result.data, "rotation").astype(float)
    axis = rotate(rotation, np.broadcast_to([1.0, 0.0, 0.0], place.shape))
    way = wanted(place)
    return np.abs((axis * way).sum(axis=1)) / np.maximum(np.linalg.norm(way, axis=1), 1e-9)


def around(place):
    return np.cross([0.0, 0.0, 1.0], place)


def store(target, name, domain, vectors):
    attribute = target.data.attributes.new(name, "FLOAT_VECTOR", domain)
    attribute.data.foreach_set("vector", np.ascontiguousarray(vectors, np.float32).ravel())


def centers(mesh, domain):
    if domain == "FACE":
        return np.array([face.center[:] for face in mesh.polygons])
    vertex = np.array([one.co[:] for one in mesh.vertices])
    return vertex if domain == "POINT" else vertex[[loop.vertex_index for loop in mesh.loops]]


@pytest.mark.parametrize("thick", [False, True])
def test_logs_lie_along_the_nearest_curve_seen_from_above(ground, log, thick):
    path = ring(6.0)
    path.data.bevel_depth = 0.3 if thick else 0.0
    before = len(bpy.data.objects), len(bpy.data.curves), len(bpy.data.meshes)
    made = esh.scatter(ground, wood(log, esh.CurveDirection(path)), **RUN)
    assert len(made.placement.position) == 150 and np.median(along(made.object, around)) > 0.99
    assert (len(bpy.data.objects), len(bpy.data.curves), len(bpy.data.meshes)) == (
        before[0] + 1,
        before[1],
        before[2] + 1,
    )


def test_logs_lie_along_the_nearest_curve_on_a_wall(log):
    """Two rings about a pillar, and a pole beside them: near it, logs stand upright."""
    pillar = cylinder()
    rings = bpy.data.collections.new("Rings")
    for height in (-2.0, 2.0):
        item = ring(2.5, (0.0, 0.0, height))
        for owner in item.users_collection:
            owner.objects.unlink(item)
        rings.objects.link(item)
    bpy.context.scene.collection.children.link(rings)
    made = esh.scatter(pillar, wood(log, esh.CurveDirection(rings)), surface="whole", align_to_normal=1.0, **RUN)
    assert np.median(along(made.object, around)) > 0.98
    mesh = bpy.data.meshes.new("Pole")
    mesh.from_pydata([(2.2, 0.0, -4.0), (2.2, 0.0, 4.0)], [(0, 1)], [])
    pole = bpy.data.objects.new("Pole", mesh)
    bpy.context.scene.collection.objects.link(pole)
    direction = esh.CurveDirection([rings, pole])
    made = esh.scatter(pillar, wood(log, direction), surface="whole", align_to_normal=1.0, **RUN)
    place = mesh_attributes.read_attribute(made.object.data, "position")
    upright = along(made.object, lambda place: np.broadcast_to([0.0, 0.0, 1.0], place.shape))
    near = (place[:, 0] > 1.8) & (np.abs(place[:, 2]) < 1.5)
    assert near.sum() > 3 and np.median(upright[near]) > 0.97
    assert np.median(along(made.object, around)[place[:, 0] < 0.0]) > 0.97


@pytest.mark.parametrize("domain", ["POINT", "FACE", "CORNER"])
def test_logs_lie_along_vectors_of_the_target_however_it_is_turned(ground, log, domain):
    """Vectors are in the object's own axes: a ground that is turned, scaled and moved takes them along."""
    store(ground, "flow", domain, around(centers(ground.data, domain)))
    ground.rotation_euler, ground.scale, ground.location = Euler((0.0, 0.0, 0.7)), (2.0, 1.0, 1.0), (5.0, 1.0, 0.0)
    made = esh.scatter(ground, wood(log, esh.AttributeDirection("flow")), **RUN)
    turn = np.array(ground.matrix_world.to_3x3())
    place = mesh_attributes.read_attribute(made.object.data, "position").astype(float)
    local = (place - np.array(ground.location)) @ np.linalg.inv(turn).T
    wanted = around(local) @ turn.T
    assert np.median(along(made.object, lambda _: wanted)) > 0.97


def test_logs_lie_along_vectors_of_several_targets_on_their_whole_surfaces(log):
    first, second = cylinder(), cylinder()
    second.location, second.rotation_euler = (10.0, 0.0, 0.0), Euler((0.0, 0.5, 0.0))
    for item in (first, second):
        store(item, "flow", "POINT", around(centers(item.data, "POINT")))
    direction = esh.AttributeDirection("flow")
    made = esh.scatter([first, second], wood(log, direction), surface="whole", align_to_normal=1.0, **RUN)
    place = mesh_attributes.read_attribute(made.object.data, "position")
    axis = np.array(second.matrix_world.to_3x3()) @ np.array([0.0, 0.0, 1.0])
    wanted = np.where(
        place[:, :1] > 5.0, np.cross(axis, place - np.array([10.0, 0.0, 0.0])), np.cross([0.0, 0.0, 1.0], place)
    )
    assert 40 < (place[:, 0] > 5.0).sum() < 110 and np.median(along(made.object, lambda _: wanted)) > 0.97


def test_what_cannot_be_lain_along_is_said(ground, log):
    bare = esh.AttributeDirection("flow")
    with pytest.raises(esh.EshError, match=r'`direction` of class "wood".*no attribute "flow" of vectors'):
        esh.scatter(ground, wood(log, bare), **RUN)
    store(ground, "flow", "POINT", np.zeros((len(ground.data.vertices), 3)))
    with pytest.raises(esh.EshError, match=r"must point along .* somewhere; it points nowhere"):
        esh.scatter(ground, wood(log, bare), **RUN)
    bad = np.full((len(ground.data.vertices), 3), np.nan)
    # Infinity times 0 is what NumPy warns of.
    bad[::2] = np.inf
    store(ground, "bad", "POINT", bad)
    with warnings.catch_warnings(), pytest.raises(esh.EshError, match="must be finite everywhere"):
        warnings.simplefilter("error")
        esh.scatter(ground, wood(log, esh.AttributeDirection("bad")), **RUN)
    with pytest.raises(esh.EshError, match=r"must lie along a curve, or along edges that have no faces"):
        esh.scatter(ground, wood(log, esh.CurveDirection(log)), **RUN)
    with pytest.raises(esh.EshError, match="must be an object, a collection"):
        esh.CurveDirection("path")
    for none in (3, None, "", " "):
        with pytest.raises(esh.EshError, match="`name` of an AttributeDirection must be text, and not empty; got"):
            esh.AttributeDirection(none)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("thick", [False, True])
def test_a_curve_whose_points_are_not_finite_is_named(ground, log, thick):
    path = ring(6.0)
    path.name, path.data.bevel_depth = "Stem", 0.3 if thick else 0.0
    path.data.splines[0].bezier_points[1].co.y = np.nan
    with pytest.raises(
        esh.EshError, match=r'`direction` of class "wood" .*"Stem" has coordinates that are not finite$'
    ):
        esh.scatter(ground, wood(log, esh.CurveDirection(path)), **RUN)


def test_the_sidebar_offers_both_and_knows_when_they_have_changed(ground, log):
    scatter = bpy.context.scene.esh_scatter.add_scatter(ground)
    body_class = scatter.add_class()
    size = body_class.sizes[0]
    size.source_object, size.count = log, 60
    scatter.device, scatter.max_steps = "CPU", 40
    body_class.direction_kind = "CURVE"
    assert "choose the curve that it lies along" in scatter.obstacle(bpy.context.scene)
    path = body_class.direction_object = ring(6.0)
    assert scatter.obstacle(bpy.context.scene) is None
    bpy.ops.esh.scatter()
    assert np.median(along(scatter.result, around)) > 0.98 and not scatter.outdated
    path.location.x = 3.0
    bpy.context.view_layer.update()
    assert scatter.changes() == [f"{path.name} edited"]
    path.location.x = 0.0
    bpy.context.view_layer.update()
    assert not scatter.outdated
    path.data.splines[0].bezier_points[0].co.x += 1.0
    bpy.context.view_layer.update()
    assert scatter.outdated, "its shape"
    bpy.ops.esh.scatter()
    bpy.context.scene.collection.objects.unlink(path)
    assert "was deleted; choose another curve" in scatter.obstacle(bpy.context.scene)
    body_class.direction_kind = "ATTRIBUTE"
    assert "choose the attribute that it lies along" in scatter.obstacle(bpy.context.scene)
    store(ground, "flow", "POINT", np.broadcast_to([0.0, 1.0, 0.0], (len(ground.data.vertices), 3)))
    body_class.direction_attribute = "flow"
    bpy.ops.esh.scatter()
    assert np.median(along(scatter.result, lambda place: np.broadcast_to([0.0, 1.0, 0.0], place.shape))) > 0.99
    assert not scatter.outdated
    ground.data.attributes["flow"].data[0].vector = (1.0, 0.0, 0.0)
    assert scatter.changes() == ["flow painted"]
    body_class.direction_kind = "NONE"
    path.name = "Other"
    assert "direction of" in scatter.changes()[0]
