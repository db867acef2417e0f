"""How objects stand: turned, tilted, moved and scaled; in a run, and at once in its result."""

import math
import time

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import esh  # noqa: E402
from esh.engine.surface.instances import body_rotations, rotate  # noqa: E402
from esh.esh_scatter.classes.standing import Ground, stand  # noqa: E402
from esh.esh_scatter.result import kept_ground  # noqa: E402
from esh.esh_scatter.targets import mesh_attributes  # noqa: E402
from mathutils import Matrix  # noqa: E402

UP = np.array([[0.0, 0.0, 1.0]])


pytestmark = pytest.mark.usefixtures("empty_file")


def points(count, normal=(0.0, 0.0, 1.0), long=False):
    return Ground(
        np.arange(count, dtype=np.int32),
        np.tile(np.array(normal, np.float32), (count, 1)),
        np.zeros(count, np.float32),
        np.full(count, long),
        np.ones(count, np.float32),
        np.zeros((count, 2), np.float32),
        np.zeros(count, np.float32),
        np.zeros(count, bool),
        np.zeros(count, bool),
        np.zeros(count, np.float32),
    )


def axis(rotation):
    return rotate(rotation.astype(float), np.tile(UP, (len(rotation), 1)))


def test_a_tilt_leans_the_axis_of_the_turned_and_aligned_body():
    normal = np.array([[0.6, 0.0, 0.8]])
    for align, expected in ((0.0, [0.0, 0.0, 1.0]), (1.0, normal[0])):
        straight = body_rotations(normal, align, np.array([0.7]))
        np.testing.assert_allclose(axis(straight)[0], expected, atol=1e-12)
        none = body_rotations(normal, align, np.array([0.7]), (np.zeros(1), np.ones(1)))
        np.testing.assert_allclose(none, straight, atol=1e-12)
        leaning = body_rotations(normal, align, np.array([0.7]), (np.array([0.3]), np.array([1.1])))
        assert np.linalg.norm(leaning) == pytest.approx(1.0)
        assert math.acos(axis(leaning)[0] @ np.array(expected)) == pytest.approx(0.3)
    leaning = body_rotations(UP, 0.0, np.array([2.0]), (np.array([0.3]), np.array([1.1])))
    assert math.atan2(axis(leaning)[0, 1], axis(leaning)[0, 0]) == pytest.approx(1.1), (
        "towards the direction that was given"
    )


def test_ranges_are_symmetric_and_bounded():
    stood = stand(esh.Standing(random_turn=1.0, scale_jitter=0.2, tilt=0.4), points(4000), 3)
    assert 0.8 <= stood.scale.min() < 0.81 and 1.19 < stood.scale.max() <= 1.2
    lean = np.arccos(np.clip(axis(stood.rotation)[:, 2], -1.0, 1.0))
    assert lean.max() <= 0.4 + 1e-3 and lean.max() > 0.39
    assert abs(axis(stood.rotation)[:, :2].mean(axis=0)).max() < 0.01, "in all directions alike"
    turned = stand(esh.Standing(random_turn=1.0), points(4000), 3).rotation
    angle = 2.0 * np.arctan2(turned[:, 3], turned[:, 0])
    assert -0.5 <= angle.min() < -0.49 and 0.49 < angle.max() <= 0.5


def test_long_bodies_keep_their_direction_and_look_both_ways():
    turned = stand(esh.Standing(random_turn=2.0), points(100, long=True), 1).rotation
    angle = 2.0 * np.arctan2(turned[:, 3], turned[:, 0])
    half_turns = np.abs(angle) / math.pi
    assert sorted(set(np.round(half_turns, 4).tolist())) == [0.0, 1.0]


def test_offsets_go_along_the_normal_however_bodies_stand():
    stood = stand(esh.Standing(align_to_normal=0.0, offset=-0.5), points(3, normal=(0.6, 0.0, 0.8)), 0)
    np.testing.assert_allclose(stood.to_origin, [[-0.3, 0.0, -0.4]] * 3, atol=1e-6)


def test_more_points_leave_the_earlier_ones_as_they_are():
    standing = esh.Standing(tilt=0.3, scale_jitter=0.1)
    few, many = stand(standing, points(10), 4), stand(standing, points(50), 4)
    for one, other in zip(few, many, strict=True):
        assert one.tobytes() == other[:10].tobytes()


def box(name, size):
    mesh = bpy.data.meshes.new(name)
    width, depth, height = size
    corners = [(x, y, z) for z in (0.0, height) for x, y in ((0, 0), (width, 0), (width, depth), (0, depth))]
    faces = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    mesh.from_pydata(corners, [], faces)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


@pytest.fixture
def scatter():
    mesh = bpy.data.meshes.new("Ground")
    x, y = np.meshgrid(np.linspace(0, 20, 21), np.linspace(0, 20, 21))
    corners = np.column_stack([x.ravel(), y.ravel(), 0.5 * np.sin(x).ravel()])
    faces = [(i, i + 1, i + 22, i + 21) for row in range(20) for i in range(21 * row, 21 * row + 20)]
    mesh.from_pydata(corners.tolist(), [], faces)
    ground = bpy.data.objects.new("Ground", mesh)
    bpy.context.scene.collection.objects.link(ground)
    made = bpy.context.scene.esh_scatter.add_scatter(ground)
    for name, size, count in (("Tree", (0.5, 0.5, 2.0), 40), ("Log", (2.0, 0.2, 0.2), 20)):
        body_class = made.add_class()
        body_class.name = name
        body_class.sizes[0].source_object, body_class.sizes[0].count = box(name, size), count
    ranged = made.classes[0].sizes[0]
    ranged.area_kind, ranged.area, ranged.area_largest = "RANGE", 0.1, 0.5
    made.device, made.max_steps = "CPU", 5
    bpy.ops.esh.scatter()
    return made


NAMES = ("position", "rotation", "scale", "lift", "class_color")


def values(item):
    return {name: mesh_attributes.read_attribute(item.data, name) for name in NAMES}


@pytest.mark.parametrize("number", [0, 1])
def test_changed_at_once_a_class_stands_as_after_another_run(scatter, number):
    scatter.avoid_overlap = False
    bpy.ops.esh.scatter()
    before = values(scatter.result)
    body_class = scatter.classes[number]
    body_class.align_to_normal, body_class.tilt, body_class.offset = 0.25, 0.5, -0.125
    body_class.random_turn, body_class.scale_jitter = 1.0, 0.25
    assert not scatter.outdated, "it needs no solving"
    at_once = values(scatter.result)
    own = mesh_attributes.read_attribute(scatter.result.data, "class_index") == number
    for name in ("position", "rotation", "scale", "lift"):
        assert not np.allclose(at_once[name][own], before[name][own]), name
        np.testing.assert_array_equal(at_once[name][~own], before[name][~own], name)
    bpy.ops.esh.scatter()
    again = values(scatter.result)
    for name in NAMES:
        np.testing.assert_allclose(at_once[name], again[name], atol=2e-6, err_msg=name)


def test_objects_that_turned_as_they_fitted_are_shown_as_the_next_run_turns_them(scatter):
    tree = scatter.classes[0]
    tree.sizes[0].area_kind, tree.align_to_normal = "MESH", 0.0
    for angle in (0.0, 1.0):
        tree.random_turn = 2.0 * math.pi
        bpy.ops.esh.scatter()
        own = kept_ground.read_attribute(scatter.result.data, "class_index") == 0
        fitted = values(scatter.result)["rotation"][own]
        tree.random_turn = angle
        at_once = values(scatter.result)["rotation"][own]
        assert not np.allclose(at_once, fitted)
        assert angle > 0.0 or np.ptp(at_once, axis=0).max() < 1e-6, "they all look the same way"
        tree.random_turn = 2.0 * math.pi
        np.testing.assert_allclose(values(scatter.result)["rotation"][own], fitted, atol=1e-6)
        tree.random_turn = angle
        bpy.ops.esh.scatter()
        again = values(scatter.result)["rotation"][own]
        np.testing.assert_allclose(np.abs((at_once * again).sum(axis=1)), 1.0, atol=1e-5)


@pytest.mark.parametrize("avoid_overlap", [False, True])
def test_objects_whose_origin_is_in_their_middle_stand_on_their_lowest_point(scatter, avoid_overlap):
    tree = scatter.classes["Tree"]
    tree.sizes[0].source_object.data.transform(Matrix.Translation((-0.25, -0.25, -0.8)))
    scatter.avoid_overlap, tree.scale = avoid_overlap, 1.5
    bpy.ops.esh.scatter()
    mesh = scatter.result.data
    own = mesh_attributes.read_attribute(mesh, "class_index") == 0
    before = values(scatter.result)
    tree.stand_on = "LOWEST"
    assert not scatter.outdated, "it needs no solving"
    at_once = values(scatter.result)
    up = axis(at_once["rotation"][own])
    raised = at_once["position"][own] - before["position"][own]
    np.testing.assert_allclose(raised, 0.8 * at_once["scale"][own] * up, atol=2e-6)
    np.testing.assert_array_equal(at_once["position"][~own], before["position"][~own])
    bpy.ops.esh.scatter()
    again = values(scatter.result)
    np.testing.assert_allclose(at_once["position"], again["position"], atol=2e-6)
    tree.stand_on = "ORIGIN"
    np.testing.assert_allclose(values(scatter.result)["position"], before["position"], atol=2e-6)


def test_another_object_at_the_same_points_stands_on_its_own_lowest_point(scatter):
    tree, other = scatter.classes["Tree"], box("Other", (0.5, 0.5, 2.0))
    other.data.transform(Matrix.Translation((0.0, 0.0, -0.5)))
    tree.stand_on = "LOWEST"
    bpy.ops.esh.scatter()
    own = mesh_attributes.read_attribute(scatter.result.data, "class_index") == 0
    before = values(scatter.result)
    tree.sizes[0].source_object = other
    assert not scatter.outdated
    now = values(scatter.result)
    raised = now["position"][own] - before["position"][own]
    np.testing.assert_allclose(raised, 0.5 * now["scale"][own] * axis(now["rotation"][own]), atol=2e-6)


def test_outlines_that_are_kept_apart_are_solved_anew_for_another_turn_or_scale(scatter):
    assert not scatter.outdated
    scatter.classes[0].offset = 0.2
    assert not scatter.outdated
    scatter.classes[0].tilt = 0.2
    assert scatter.outdated
    bpy.ops.esh.scatter()
    assert not scatter.outdated
    scatter.classes[0].random_turn = 1.0
    assert scatter.outdated
    bpy.ops.esh.scatter()
    assert not scatter.outdated
    scatter.classes[0].scale_jitter = 0.25
    assert scatter.outdated
    bpy.ops.esh.scatter()
    assert not scatter.outdated
    scatter.classes[0].align_to_normal = 0.5
    assert scatter.changes() == ["align to ground of Tree"]


@pytest.mark.parametrize(
    ("ground", "solved_for"),
    [
        ("flat", set()),
        ("gentle", set()),
        ("covered", {"align_to_normal", "tilt"}),
        ("steep", {"align_to_normal", "tilt"}),
        ("whole", set()),
    ],
)
def test_discs_of_a_given_area_are_turned_without_another_run(scatter, ground, solved_for):
    """And on ground where they do not lean with their objects, these lean over at once, too."""
    tree = scatter.classes["Tree"]
    tree.sizes[0].area_kind, tree.sizes[0].area = "VALUE", 0.5
    scatter.classes.remove(1)
    mesh = scatter.target.data
    mesh.transform(Matrix.Diagonal((1.0, 1.0, {"flat": 0.0, "gentle": 0.3, "covered": 0.3}.get(ground, 4.0), 1.0)))
    scatter.surface, tree.align_to_normal = "WHOLE" if ground == "whole" else "ABOVE", 0.25
    if ground == "covered":
        tree.count_kind = "COVER"
    bpy.context.view_layer.update()
    bpy.ops.esh.scatter()
    before, mesh = values(scatter.result), scatter.result.data
    for name, value in {"random_turn": 1.0, "align_to_normal": 0.75, "tilt": 0.5, "use_look_at": True}.items():
        as_it_was = getattr(tree, name)
        setattr(tree, name, value)
        assert (scatter.outdated, bool(scatter.changes())) == ((name in solved_for),) * 2, name
        if name in solved_for:
            setattr(tree, name, as_it_was)
    assert not scatter.outdated
    at_once, places = values(scatter.result), mesh_attributes.read_attribute(mesh, "placed_at")
    assert not np.allclose(at_once["rotation"], before["rotation"])
    bpy.ops.esh.scatter()
    again = values(scatter.result)
    np.testing.assert_array_equal(mesh_attributes.read_attribute(scatter.result.data, "placed_at"), places)
    for name in NAMES:
        np.testing.assert_allclose(at_once[name], again[name], atol=2e-6, err_msg=name)
    tree.scale_jitter = 0.25
    assert scatter.changes() == ["random scale of Tree"], "how large a disc is always counts"


def test_turns_of_discs_in_results_of_before_are_compared_as_then(scatter):
    tree = scatter.classes["Tree"]
    tree.sizes[0].area_kind = "VALUE"
    bpy.ops.esh.scatter()
    del scatter.result.data[kept_ground.UNREAD_STANDING]
    assert not scatter.outdated
    tree.tilt = 0.25
    assert scatter.changes() == ["tilt of Tree"]


def test_points_that_were_moved_by_hand_stay_where_they_were_put(scatter):
    mesh = scatter.result.data
    mesh.vertices[0].co.z += 5.0

    def place():
        # Of the object's middle: its origin is at a corner, which sinks or rises where the object leans less.
        return mesh_attributes.read_attribute(mesh, "position")[0] - mesh_attributes.read_attribute(mesh, "lift")[0]

    before, turned = place(), mesh_attributes.read_attribute(mesh, "rotation")[0]
    scatter.classes[0].align_to_normal = 0.5
    assert place() == pytest.approx(before, abs=1e-5)
    assert mesh_attributes.read_attribute(mesh, "rotation")[0] != pytest.approx(turned)


def test_color_eye_and_camera_of_a_class_are_changed_at_once(scatter):
    def shown():
        graph = bpy.context.evaluated_depsgraph_get()
        return sum(1 for one in graph.object_instances if one.is_instance)

    assert shown() == 60
    scatter.classes[0].show_viewport = False
    assert shown() == 20
    scatter.classes[1].show_render = False
    assert shown() == 20, "renders are another matter"
    kept = {
        name: mesh_attributes.read_attribute(scatter.result.data, name) for name in ("hide_viewport", "hide_render")
    }
    assert (kept["hide_viewport"].sum(), kept["hide_render"].sum()) == (40, 20)
    bpy.ops.esh.scatter()
    assert shown() == 20, "the next run leaves it hidden"
    scatter.classes[0].show_viewport = True
    assert shown() == 60
    scatter.classes[1].color = (1.0, 0.5, 0.25)
    colors = values(scatter.result)["class_color"]
    assert tuple(colors[-1]) == (1.0, 0.5, 0.25, 1.0) and tuple(colors[0]) != tuple(colors[-1])


def test_classes_that_were_moved_or_added_since_do_not_take_the_points_of_others(scatter):
    before = values(scatter.result)
    other = scatter.add_class()
    other.tilt = 0.5
    assert values(scatter.result)["rotation"].tobytes() == before["rotation"].tobytes()
    scatter.classes.move(0, 2)
    scatter.classes[2].offset = 1.0
    own = mesh_attributes.read_attribute(scatter.result.data, "class_index") == 0
    moved = np.abs(values(scatter.result)["lift"] - before["lift"]).max(axis=1) > 0.1
    np.testing.assert_array_equal(moved, own)


def test_a_hundred_thousand_are_turned_in_a_moment(scatter, slowness):
    mesh = bpy.data.meshes.new("Many")
    count = 100_000
    mesh.vertices.add(count)
    ground = points(count)
    kinds = {"id": ("INT", ground.identity), "class_index": ("INT", np.zeros(count, np.int32))}
    kinds |= kept_ground.ground_attributes(ground, *np.zeros((2, count, 3), np.float32))
    kinds |= {"rotation": ("QUATERNION", np.zeros((count, 4))), "scale": ("FLOAT_VECTOR", np.ones((count, 3)))}
    for name, (kind, _) in kinds.items():
        mesh.attributes.new(name, kind, "POINT")
    for name, (_, given) in kinds.items():
        mesh_attributes.write_attribute(mesh, name, given)
    mesh[kept_ground.SEED] = 0
    item = bpy.data.objects.new("Many", mesh)
    assert kept_ground.can_stand_anew(item)
    started = time.process_time()
    kept_ground.stand_anew(item, 0, esh.Standing(align_to_normal=0.5, tilt=0.1))
    took = time.process_time() - started
    # It takes 0.04 s on a machine that has nothing else to do.
    assert took < 0.2 * slowness()


@pytest.mark.parametrize(
    ("amount", "expected"),
    [
        (dict(per_area=0.5), 200),
        (dict(distance=2.0), round(400.0 * 2.0 / (math.sqrt(3.0) * 4.0))),
        (dict(cover=0.25), 100),
    ],
)
def test_amounts_become_numbers_on_the_ground(amount, expected):
    bpy.ops.mesh.primitive_plane_add(size=20.0)
    ground = bpy.context.object
    tree = box("Tree", (1.0, 1.0, 1.0))
    classes = [esh.ScatterClass("tree", [esh.ScatterSize("one", source=tree)], count=esh.Amount(**amount))]
    job = esh.ScatterJob(ground, classes, device="cpu")
    assert job.problem.classes[0].sizes[0].count == expected
    half = np.repeat([[1.0, 0.0]], 100, axis=1)
    classes = [esh.ScatterClass("tree", [esh.ScatterSize("one", source=tree)], half, count=esh.Amount(**amount))]
    job = esh.ScatterJob(ground, classes, device="cpu")
    assert job.problem.classes[0].sizes[0].count == pytest.approx(expected / 2, abs=2), "where it is white"


@pytest.mark.parametrize(
    "given", [{}, {"per_area": 1.0, "cover": 0.5}, {"distance": 0.0}, {"cover": math.nan}, {"per_area": "x"}]
)
def test_amounts_without_meaning_are_refused(given):
    with pytest.raises(esh.ProblemError, match="Amount must"):
        esh.Amount(**given)


def test_an_amount_that_comes_to_far_too_many_is_refused():
    bpy.ops.mesh.primitive_plane_add(size=20.0)
    classes = [
        esh.ScatterClass(
            "tree", [esh.ScatterSize("one", source=box("Tree", (1, 1, 1)))], count=esh.Amount(distance=1e-4)
        )
    ]
    with pytest.raises(esh.ProblemError, match=r'`count` of class "tree" comes to [0-9,]+ on 400 m²'):
        esh.ScatterJob(bpy.context.object, classes, device="cpu")
