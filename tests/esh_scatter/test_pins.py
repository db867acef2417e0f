"""Objects that were moved, turned, pinned or removed by hand: the next run leaves them, and the rest makes room."""

import time

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh import ScatterClass, ScatterSize, scatter  # noqa: E402
from esh.esh_scatter.operators.run_operator import before_a_run  # noqa: E402
from esh.esh_scatter.result import pins, points_in_front  # noqa: E402
from esh.esh_scatter.result.attributes import PINNED, PLACED_AT  # noqa: E402
from esh.esh_scatter.solving import live  # noqa: E402
from esh.esh_scatter.targets.mesh_attributes import read_attribute, write_attribute  # noqa: E402

OPTIONS = {"device": "cpu", "max_steps": 20}


pytestmark = pytest.mark.usefixtures("empty_file")


@pytest.fixture
def ground():
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=30, y_subdivisions=30, location=(3, 4, 0))
    for vertex in bpy.context.object.data.vertices:
        vertex.co.z = 0.1 * vertex.co.x
    return bpy.context.object


def cone(name, radius=0.4):
    bpy.ops.mesh.primitive_cone_add(vertices=24, radius1=radius, depth=1.0, location=(80, 0, 0))
    bpy.context.object.name = name
    return bpy.context.object


@pytest.fixture
def made(ground):
    settings = bpy.context.scene.esh_scatter.add_scatter(ground)
    for name, count in (("Pine", 60), ("Beech", 50)):
        size = settings.add_class().sizes[0]
        size.source_object, size.count = cone(name), count
        settings.classes[-1].name = name
    settings.device, settings.max_steps = "CPU", 20
    bpy.ops.esh.scatter()
    return settings


def active():
    return bpy.context.scene.esh_scatter.active


def state(mesh):
    """Return places and turns by the numbers of the points."""
    position, rotation = read_attribute(mesh, "position"), read_attribute(mesh, "rotation")
    number = read_attribute(mesh, "id").tolist()
    return dict(zip(number, position, strict=True)), dict(zip(number, rotation, strict=True))


def select(mesh, points):
    chosen = np.zeros(len(mesh.vertices), bool)
    chosen[points] = True
    mesh.vertices.foreach_set("select", chosen)


def move(mesh, point, to):
    position = read_attribute(mesh, "position")
    position[point, :2] = to
    write_attribute(mesh, "position", position)
    return int(read_attribute(mesh, "id")[point])


def in_world(result):
    position = read_attribute(result.data, "position")
    matrix = np.array(result.matrix_world)
    return position @ matrix[:3, :3].T + matrix[:3, 3]


def test_what_was_moved_stays_and_the_rest_makes_room(made):
    mesh = made.result.data
    assert not made.outdated and not pins.moved_by_hand(mesh).any()
    first, second = move(mesh, 5, (3.0, 4.0)), move(mesh, 70, (3.9, 4.0))
    assert made.changes() == ["instances set by hand"]
    _, turns = state(mesh)
    bpy.ops.esh.scatter()
    mesh = active().result.data
    places, turned = state(mesh)
    np.testing.assert_allclose(places[first], (3.0, 4.0, 0.0), atol=2e-3)
    np.testing.assert_allclose(places[second][:2], (3.9, 4.0), atol=2e-3)
    np.testing.assert_allclose(turned[first], turns[first], atol=1e-5)
    away = [np.linalg.norm(p[:2] - (3.0, 4.0)) for n, p in places.items() if n != first]
    assert min(away) > 0.75, "nobody stands in it"
    report = active().report
    assert [s["placed"] for e in report["classes"] for s in e["sizes"]] == [60, 50] and report["overlaps"] == 0
    assert not active().outdated and pins.staying(mesh).sum() == 2
    active().seed = 9
    bpy.ops.esh.scatter()
    places, _ = state(active().result.data)
    np.testing.assert_allclose(places[first], (3.0, 4.0, 0.0), atol=2e-3)


def test_pinning_turning_and_letting_go(made):
    mesh = made.result.data
    before, _ = state(mesh)
    number = int(read_attribute(mesh, "id")[8])
    select(mesh, [8])
    assert bpy.ops.esh.instances_pin() == {"FINISHED"} and made.outdated
    assert bpy.ops.esh.instances_turn(angle=0.5) == {"FINISHED"}
    turned = state(mesh)[1][number]
    made.seed = 4
    bpy.ops.esh.scatter()
    mesh = active().result.data
    places, turns = state(mesh)
    np.testing.assert_allclose(places[number], before[number], atol=2e-3)
    assert abs(abs(float(turns[number] @ turned)) - 1.0) < 1e-4
    point = read_attribute(mesh, "id").tolist().index(number)
    select(mesh, [point])
    bpy.ops.esh.instances_unpin()
    active().seed = 0
    bpy.ops.esh.scatter()
    assert not pins.staying(active().result.data).any() and not active().outdated


def copy(mesh, points, by):
    """Duplicate points in Edit Mode, and move the copies (Shift D)."""
    select(mesh, points)
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = active().result
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.duplicate()
    bpy.ops.transform.translate(value=(*by, 0.0))
    bpy.ops.object.mode_set(mode="OBJECT")


def stand_at(places):
    """Tell how far from places ``[n, 2]`` the nearest points of the result are [m]."""
    found = read_attribute(active().result.data, "position")[:, :2]
    return np.linalg.norm(np.asarray(places)[:, None] - found[None], axis=2).min(axis=1)


@pytest.mark.parametrize("moved_before", [False, True])
def test_copies_stay_where_they_were_put_and_so_does_what_they_are_copies_of(made, moved_before):
    """Their numbers were the same: a run was refused with the words of Python, or the original went."""
    mesh = made.result.data
    if moved_before:
        move(mesh, 5, (3.0, 4.0))
    places = read_attribute(mesh, "position")[[5, 70], :2]
    copy(mesh, [5, 70], (1.3, 0.9))
    assert len(mesh.vertices) == 112 and pins.staying(mesh).sum() == 4
    assert active().changes() == ["instances set by hand"]
    for seed in (0, 9):
        active().seed = seed
        assert bpy.ops.esh.scatter() == {"FINISHED"}
        mesh = active().result.data
        assert len(mesh.vertices) == 110 and len(np.unique(read_attribute(mesh, "id"))) == 110
        assert pins.staying(mesh).sum() == 4 and not active().outdated
        assert stand_at([*places, *(places + (1.3, 0.9))]).max() < 5e-3


def test_copies_that_were_called_off_are_none(made):
    mesh = made.result.data
    move(mesh, 7, (3.0, 4.0))
    copy(mesh, [7, 8], (0.0, 0.0))
    assert np.flatnonzero(pins.staying(mesh)).tolist() == [7]
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    mesh = active().result.data
    assert len(mesh.vertices) == 110 and pins.staying(mesh).sum() == 1


def test_copies_can_be_let_go_alone(made):
    mesh = made.result.data
    copy(mesh, [5], (1.3, 0.9))
    select(mesh, [110])
    bpy.ops.esh.instances_unpin()
    assert np.flatnonzero(pins.staying(mesh)).tolist() == [5]
    assert len(np.unique(read_attribute(mesh, "id"))) == 111


def test_copies_can_be_made_real_and_taken_back(made):
    copy(made.result.data, [5], (1.3, 0.9))
    bpy.ops.esh.instances_make_real()
    bpy.ops.esh.instances_from_real()
    mesh = active().result.data
    assert np.flatnonzero(pins.staying(mesh)).tolist() == [5, 110]


def test_live_begins_with_what_was_moved_before_it_was_switched_on(made, follow):
    number = move(made.result.data, 5, (3.0, 4.0))
    made.live = True
    follow()
    assert active().live and [one.message for one in live._followed.values()] == [""]
    active().classes["Beech"].sizes[0].count = 40
    follow()
    assert len(active().result.data.vertices) == 100
    np.testing.assert_allclose(state(active().result.data)[0][number][:2], (3.0, 4.0), atol=5e-3)


def test_live_goes_on_from_copies(made, follow):
    copy(made.result.data, [5], (1.3, 0.9))
    places = read_attribute(made.result.data, "position")[[5, 110], :2]
    made.live = True
    follow()
    assert active().live and len(active().result.data.vertices) == 110
    active().classes["Beech"].sizes[0].count = 40
    follow()
    assert len(active().result.data.vertices) == 100 and stand_at(places).max() < 5e-3


def test_more_copies_than_are_asked_for_are_one_sentence(made):
    copy(made.result.data, list(range(60)), (0.4, 0.3))
    with pytest.raises(RuntimeError, match="pinned") as error:
        bpy.ops.esh.scatter()
    assert "Fixed" not in str(error.value)


def test_what_is_shown_at_once_moves_nobody_by_hand(made):
    made.classes["Pine"].offset = 0.4
    assert not pins.moved_by_hand(made.result.data).any() and not made.outdated


def test_that_nothing_was_moved_is_seen_about_as_quickly_as_it_is_read():
    """Panels ask with every drawing: 13 ms at 100,000 objects were felt."""
    mesh = bpy.data.meshes.new("Points")
    mesh.vertices.add(100_000)
    place = np.random.default_rng(1).random((100_000, 3), np.float32)
    mesh.attributes.new(PLACED_AT, "FLOAT_VECTOR", "POINT")
    for name in ("position", PLACED_AT):
        write_attribute(mesh, name, place)

    def least(work):
        """Processor time of this thread [s]: what other programs take does not count."""
        times = []
        for _ in range(15):
            start = time.thread_time()
            work()
            times.append(time.thread_time() - start)
        return min(times)

    reading = least(lambda: [read_attribute(mesh, name) for name in ("position", PLACED_AT)])
    assert not pins.moved_by_hand(mesh).any()
    assert least(lambda: pins.moved_by_hand(mesh)) < 4.0 * reading
    place[7] += 0.1
    write_attribute(mesh, "position", place)
    assert pins.moved_by_hand(mesh).nonzero()[0].tolist() == [7]


def test_a_removed_place_stays_free_until_it_is_refilled(made):
    mesh = made.result.data
    place = read_attribute(mesh, "position")[20][:2]
    select(mesh, [20])
    assert bpy.ops.esh.instances_remove() == {"FINISHED"}
    assert len(made.result.data.vertices) == 109 and made.changes() == ["instances set by hand"]
    bpy.ops.esh.scatter()
    places, _ = state(active().result.data)
    assert len(places) == 110
    assert min(np.linalg.norm(p[:2] - place) for p in places.values()) > 0.75
    assert bpy.ops.esh.instances_refill() == {"FINISHED"} and not bpy.ops.esh.instances_refill.poll()
    assert active().outdated


def test_points_are_picked_in_edit_mode(made):
    assert bpy.ops.esh.instances_edit() == {"FINISHED"}
    result = made.result
    assert result.mode == "EDIT" and bpy.context.view_layer.objects.active == result
    assert made.result_in(bpy.context.scene) == result
    assert not result.select_get(), "all that stands on a selected object has an outline"
    assert bpy.ops.esh.instances_pin() == {"CANCELLED"}, "none is selected"
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0.25, 0.0, 0.0))
    assert bpy.ops.esh.instances_edit() == {"FINISHED"} and result.mode == "OBJECT"
    assert result.select_get() and bpy.context.view_layer.objects.active == result
    assert pins.moved_by_hand(result.data).all()
    select(result.data, [3])
    bpy.ops.esh.instances_edit()
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.esh.instances_unpin()
    assert result.mode == "EDIT"
    bpy.ops.esh.instances_edit()
    assert not pins.staying(result.data).any()


def test_live_waits_while_what_is_edited_is_hidden(made, follow):
    """Blender edits nothing that is hidden: Edit Mode could not be come back to, and there was a traceback."""
    result = made.result
    made.live = True
    follow()
    assert bpy.ops.esh.instances_edit() == {"FINISHED"}
    result.hide_viewport = True
    bpy.context.view_layer.update()
    made.classes[0].sizes[0].count = 70
    for _ in range(3):
        live._followed[bpy.context.scene.session_uid, made.uid]._looked = 0.0
        live._tick()
    assert result.mode == "EDIT" and not live.is_busy(bpy.context.scene, made)
    assert bpy.ops.esh.instances_edit() == {"FINISHED"} and result.mode == "OBJECT"
    result.hide_viewport = False
    follow(lambda: len(result.data.vertices) == 120)
    assert len(result.data.vertices) == 120


def test_what_is_done_to_hidden_points_that_are_edited_leaves_edit_mode(made):
    result = made.result
    assert bpy.ops.esh.instances_edit() == {"FINISHED"}
    bpy.ops.mesh.select_all(action="SELECT")
    result.hide_viewport = True
    bpy.context.view_layer.update()
    assert bpy.ops.esh.instances_pin() == {"FINISHED"}
    assert result.mode == "OBJECT" and pins.staying(result.data).all()


def test_pins_follow_a_class_that_is_renamed_moved_or_muted(made):
    mesh = made.result.data
    number = move(mesh, 80, (1.0, 1.0))
    made.classes["Beech"].name = "Oak"
    made.classes.move(1, 0)
    bpy.ops.esh.scatter()
    mesh = active().result.data
    places, _ = state(mesh)
    np.testing.assert_allclose(places[number][:2], (1.0, 1.0), atol=2e-3)
    row = read_attribute(mesh, "id").tolist().index(number)
    assert read_attribute(mesh, "class_index")[row] == 0
    active().classes["Oak"].mute = True
    bpy.ops.esh.scatter()
    assert not pins.staying(active().result.data).any() and len(active().result.data.vertices) == 60


def test_scripts_keep_what_was_moved_unless_they_say_otherwise(ground):
    tree = cone("Tree")
    classes = [ScatterClass("tree", [ScatterSize("s", 40, tree)])]
    result = scatter(ground, classes, **OPTIONS).object
    number = move(result.data, 7, (2.0, 2.0))
    again = scatter(ground, classes, **OPTIONS).object
    assert again == result
    np.testing.assert_allclose(state(again.data)[0][number][:2], (2.0, 2.0), atol=2e-3)
    scatter(ground, classes, **OPTIONS, pinned=False)
    assert np.linalg.norm(state(result.data)[0][number][:2] - (2.0, 2.0)) > 0.05


def test_live_makes_room_for_what_is_moved(made, follow):
    made.live = True
    follow()
    mesh = made.result.data
    before, _ = state(mesh)
    number = move(mesh, 5, (3.0, 4.0))
    follow()
    after, _ = state(made.result.data)
    np.testing.assert_allclose(after[number][:2], (3.0, 4.0), atol=2e-3)
    # Where it was, another one may have come, and one have gone where it is now.
    others = [n for n in before.keys() & after.keys() if n != number]
    assert len(after) == 110 and len(others) >= 105
    assert min(np.linalg.norm(after[n][:2] - (3.0, 4.0)) for n in others) > 0.7
    far = [n for n in others if np.linalg.norm(before[n][:2] - (3.0, 4.0)) > 6.0]
    assert np.median([np.linalg.norm(after[n] - before[n]) for n in far]) < 0.3
    assert not made.outdated


@pytest.mark.parametrize("steep", [0.02, 0.5])
@pytest.mark.parametrize("area", [0.04, (0.02, 0.08)])
def test_discs_that_are_pinned_keep_their_size(steep, area):
    bpy.ops.mesh.primitive_grid_add(size=10, x_subdivisions=30, y_subdivisions=30)
    ground = bpy.context.object
    for vertex in ground.data.vertices:
        vertex.co.z = steep * vertex.co.x
    bpy.context.view_layer.update()
    one = cone("One", 0.2)
    size = ScatterSize("s", 80, one, area=area, line=False)
    asked = [ScatterClass("a", [size])]
    options = {"align_to_normal": 1.0, "scale_jitter": 0.3, "avoid_overlap": True, **OPTIONS}
    result = scatter(ground, asked, **options).object
    scales = None
    for _ in range(3):
        mesh = result.data
        there = dict(
            zip(read_attribute(mesh, "id").tolist(), read_attribute(mesh, "scale")[:, 0].tolist(), strict=True)
        )
        if scales is not None:
            assert {number: there[number] for number in scales} == pytest.approx(scales, rel=1e-4)
        chosen = np.arange(len(mesh.vertices)) % 8 == 0
        if PINNED not in mesh.attributes:
            mesh.attributes.new(PINNED, "BOOLEAN", "POINT")
        pinned = read_attribute(mesh, PINNED) | chosen
        write_attribute(mesh, PINNED, pinned)
        numbers = read_attribute(mesh, "id")
        scales = {int(n): there[int(n)] for n in numbers[pinned]}
        result = scatter(ground, asked, result=result, **options).object


@pytest.mark.parametrize("area", [None, 0.1, (0.05, 0.2)])
@pytest.mark.parametrize("surface", ["above", "whole"])
def test_pinned_objects_of_a_collection_stay_when_it_loses_one(ground, area, surface):
    parts = bpy.data.collections.new("Parts")
    bpy.context.scene.collection.children.link(parts)
    for number in range(3):
        parts.objects.link(cone(f"Part {number}", 0.1 + 0.05 * number))
    asked = [ScatterClass("a", [ScatterSize("s", 40, parts, area=area)])]
    # Discs that are scaled are footprints, too, one for all objects.
    options = {"surface": surface, "scale_jitter": 0.3, **OPTIONS}
    result = scatter(ground, asked, **options).object
    result.data.attributes.new(PINNED, "BOOLEAN", "POINT")
    write_attribute(result.data, PINNED, np.arange(40) < 20)
    before, _ = state(result.data)
    for _ in range(2):
        scatter(ground, asked, result=result, **options)
        after, _ = state(result.data)
        for number in np.flatnonzero(read_attribute(result.data, PINNED)):
            at = int(read_attribute(result.data, "id")[number])
            np.testing.assert_allclose(after[at], before[at], atol=1e-4)
        if "Part 2" in parts.objects:
            bpy.data.objects.remove(parts.objects["Part 2"])


def test_a_range_beside_pins_is_drawn_for_those_that_are_new():
    bpy.ops.mesh.primitive_grid_add(size=10)
    ground, one = bpy.context.object, cone("One", 0.2)
    asked = [ScatterClass("a", [ScatterSize("s", 60, one, area=(0.05, 0.2), distribution="linear", line=False)])]
    result = scatter(ground, asked, avoid_overlap=True, **OPTIONS).object
    result.data.attributes.new(PINNED, "BOOLEAN", "POINT")
    write_attribute(result.data, PINNED, np.arange(60) < 30)
    made = scatter(ground, asked, result=result, avoid_overlap=True, **OPTIONS)
    scale = read_attribute(made.object.data, "scale")[:, 0]
    new = scale[~made.placement.fixed]
    # The smallest and the largest of the range are there, on what objects show too.
    assert len(new) == 30 and (new.max() / new.min()) ** 2 == pytest.approx(4.0, rel=1e-3)
    np.testing.assert_allclose(np.ptp(made.placement.area[~made.placement.fixed]), 0.15, rtol=1e-6)


def test_a_result_that_is_hidden_in_any_way_is_not_entered(made):
    made.result.hide_viewport = True
    with pytest.raises(RuntimeError, match=f'"{made.result.name}" is hidden. Show it first'):
        bpy.ops.esh.instances_edit()
    made.result.hide_viewport = False
    assert bpy.ops.esh.instances_edit() == {"FINISHED"} and made.result.mode == "EDIT"


@pytest.mark.parametrize("ends", ["by the button", "by Tab"])
@pytest.mark.parametrize("in_front", [False, True])
def test_points_show_in_front_of_objects_while_they_are_edited(made, ends, in_front):
    made.result.show_in_front = in_front
    assert bpy.ops.esh.instances_edit() == {"FINISHED"} and made.result.show_in_front
    if ends == "by the button":
        bpy.ops.esh.instances_edit()
    else:
        assert points_in_front._look(made.result.name) == (None if in_front else points_in_front.LOOK_AGAIN)
        bpy.ops.object.mode_set(mode="OBJECT")
        assert points_in_front._look(made.result.name) is None
    assert made.result.mode == "OBJECT" and made.result.show_in_front == in_front, "as somebody has set it"
    assert points_in_front._look("no longer there") is None


@pytest.fixture
def on_ball():
    bpy.ops.mesh.primitive_uv_sphere_add(radius=2.0, segments=48, ring_count=24)
    made = bpy.context.scene.esh_scatter.add_scatter(bpy.context.object)
    tuft = cone("Tuft", 0.1)
    for name, count in (("Moss", 60), ("Fern", 30)):
        body_class = made.add_class()
        body_class.name = name
        body_class.sizes[0].source_object, body_class.sizes[0].count = tuft, count
    made.surface, made.device, made.max_steps = "WHOLE", "CPU", 12
    bpy.ops.esh.scatter()
    return made


def test_on_a_whole_surface_what_was_moved_lies_on_it_and_stays(on_ball):
    mesh = on_ball.result.data
    # One is pulled off the ball, to below it; one is pinned and turned where it is.
    position = read_attribute(mesh, "position")
    position[5] = (0.3, -0.2, -2.6)
    write_attribute(mesh, "position", position)
    moved, pinned = (int(read_attribute(mesh, "id")[k]) for k in (5, 70))
    select(mesh, [70])
    assert bpy.ops.esh.instances_turn(angle=0.75) == {"FINISHED"}
    places, turns = state(mesh)
    bpy.ops.esh.scatter()
    mesh = active().result.data
    after, turned = state(mesh)
    way = np.array([0.3, -0.2, -2.6])
    np.testing.assert_allclose(after[moved], 2.0 * way / np.linalg.norm(way), atol=0.02)
    np.testing.assert_allclose(after[pinned], places[pinned], atol=2e-3)
    report = active().report
    assert abs(abs(float(turned[pinned] @ turns[pinned])) - 1.0) < 1e-3
    assert [s["placed"] for e in report["classes"] for s in e["sizes"]] == [60, 30] and report["overlaps"] == 0
    others = np.array([p for n, p in after.items() if n != moved])
    assert np.linalg.norm(others - after[moved], axis=1).min() > 0.15, "nobody stands in it"
    assert not active().outdated and pins.staying(mesh).sum() == 2


def test_on_a_whole_surface_a_removed_place_is_a_ball(on_ball):
    mesh = on_ball.result.data
    place = read_attribute(mesh, "position")[20]
    select(mesh, [20])
    assert bpy.ops.esh.instances_remove() == {"FINISHED"}
    (free,) = on_ball.free_places
    assert free.has_height and free.height == pytest.approx(float(place[2]), abs=1e-4)
    free.radius = 0.5
    bpy.ops.esh.scatter()
    after = np.array(list(state(active().result.data)[0].values()))
    assert len(after) == 90 and np.linalg.norm(after - place, axis=1).min() > 0.45
    # Where it would be seen from above, on the other side of the ball, nothing is kept free.
    below = np.array([place[0], place[1], -place[2]])
    assert np.linalg.norm(after - below, axis=1).min() < 0.6


def test_live_goes_on_from_where_objects_are_on_a_whole_surface(on_ball, follow):
    on_ball.live = True
    follow()
    before, _ = state(on_ball.result.data)
    on_ball.classes["Moss"].sizes[0].count = 66
    follow()
    after, _ = state(active().result.data)
    assert len(after) == 96 and len(before.keys() & after.keys()) == 90
    assert np.median([np.linalg.norm(after[n] - before[n]) for n in before]) < 0.2, "a quarter of their spacing"
    assert not active().outdated


def stands(mesh):
    """Places, scales and objects by the numbers of the points."""
    values = (read_attribute(mesh, name) for name in ("position", "scale", "instance_index"))
    numbers = read_attribute(mesh, "id").tolist()
    return {number: (*row,) for number, *row in zip(numbers, *values, strict=True)}


@pytest.mark.parametrize("whole", [True, False])
def test_live_goes_on_from_an_edited_result_when_it_is_switched_on_again(on_ball, whole, follow):
    """After edits bodies have numbers, outlines and scales that no run would give them that begins anew."""
    moss, fern = on_ball.classes
    if not whole:
        on_ball.surface = "ABOVE"
    kinds = bpy.data.collections.new("Kinds")
    for radius in (0.08, 0.1, 0.12):
        kinds.objects.link(cone(f"Tuft {radius}", radius))
    fern.sizes[0].source_kind, fern.sizes[0].source_collection = "COLLECTION", kinds
    moss.scale_jitter = fern.scale_jitter = 0.3
    bpy.ops.esh.scatter()
    on_ball.live = True
    follow()
    moss.sizes[0].count, fern.sizes[0].count = 45, 22
    follow()
    active().live = False
    follow()
    before = stands(active().result.data)
    assert len(before) == 67 and not live._followed
    active().live = True
    follow()
    on = stands(active().result.data)
    assert before.keys() == on.keys() and not active().outdated
    assert all((a == b).all() for n in before for a, b in zip(before[n], on[n], strict=True)), (
        "that alone moves nothing"
    )
    active().classes[1].sizes[0].count = 24
    follow()
    after = stands(active().result.data)
    both = before.keys() & after.keys()
    assert len(after) == 69 and len(both) == 67 and not active().outdated
    assert np.median([np.linalg.norm(after[n][0] - before[n][0]) for n in both]) < 0.2
    for n in both:
        np.testing.assert_allclose(after[n][1], before[n][1], rtol=1e-5)
        assert after[n][2] == before[n][2], "nothing becomes another object"


def test_the_nearest_point_of_a_surface_is_that_of_all_triangles():
    from esh.engine.geometry.nearest_on_triangles import nearest_in

    random = np.random.default_rng(2)
    corner, point = random.normal(size=(200, 3, 3)), np.array([0.4, -0.3, 0.2])
    weight = nearest_in(corner, point)
    assert (weight >= -1e-12).all()
    np.testing.assert_allclose(weight.sum(axis=1), 1.0)
    found = np.linalg.norm(np.einsum("nk,nkd->nd", weight, corner) - point, axis=1)
    tried = random.dirichlet(np.ones(3), 3000)
    others = np.linalg.norm(np.einsum("mk,nkd->nmd", tried, corner) - point, axis=2).min(axis=1)
    assert (found <= others + 1e-12).all() and np.allclose(found, others, atol=0.15)


def test_those_that_stay_can_be_selected(made):
    assert bpy.ops.esh.instances_select_pinned() == {"CANCELLED"} and made.result.mode == "OBJECT"
    mesh = made.result.data
    select(mesh, [8, 9])
    bpy.ops.esh.instances_pin()
    move(mesh, 5, (3.0, 4.0))
    select(mesh, [1])
    # Also from Edit Mode.
    for _ in range(2):
        assert bpy.ops.esh.instances_select_pinned() == {"FINISHED"} and made.result.mode == "EDIT"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert pins.selected_points(mesh).tolist() == [5, 8, 9]


def mute(settings):
    settings.classes["Pine"].mute = True


def remove_class(settings):
    settings.remove_class(0)


def leave_out(settings):
    settings.classes["Pine"].sizes[0].source_object = None


def replace_sizes(settings):
    for _ in range(2):
        settings.classes["Pine"].add_size().source_object = bpy.data.objects["Pine"]
    settings.classes["Pine"].sizes.remove(0)


@pytest.mark.parametrize("change", [mute, remove_class, leave_out, replace_sizes])
def test_a_run_that_leaves_out_what_was_placed_by_hand_is_asked_about(made, change):
    mesh = made.result.data
    pine, beech = (np.flatnonzero(read_attribute(mesh, "class_index") == number) for number in (0, 1))
    change(made)
    assert before_a_run(bpy.context, made) is None, "nothing was placed by hand"
    move(mesh, pine[0], (3.0, 4.0))
    title, text = before_a_run(bpy.context, made)
    assert "by Hand" in title and text == "1 moved or pinned object of Pine will be lost"
    pins.pin(mesh, np.concatenate([pine[1:3], beech[:4]]))
    assert before_a_run(bpy.context, made)[1] == "3 moved or pinned objects of Pine will be lost"
    made.cap = 10
    assert before_a_run(bpy.context, made)[1].startswith("3 moved or pinned objects of Pine will be lost. ")
    made.cap = 1_000_000
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert before_a_run(bpy.context, made) is None and pins.staying(made.result.data).sum() == 4


@pytest.mark.parametrize(("where", "asks"), [((0.5, 0.0, 0.0), False), ((100.0, 0.0, 0.0), True)])
def test_a_run_on_another_target_that_is_elsewhere_is_asked_about(made, where, asks):
    bpy.ops.mesh.primitive_plane_add(size=60, location=where)
    other = bpy.context.object
    move(made.result.data, 3, (1.0, 2.0))
    assert before_a_run(bpy.context, made) is None
    made.target = other
    asked = before_a_run(bpy.context, made)
    assert (asked is not None) is asks
    if asked:
        assert asked[1] == "1 moved or pinned object will be lost: the new target is elsewhere"


@pytest.mark.parametrize("by", ["operator", "script"])
@pytest.mark.parametrize(("where", "kept"), [(0.5, 5), (100.0, 0), (33.0, 2)])
def test_what_is_not_on_the_new_target_does_not_stay_and_the_report_says_so(made, by, where, kept):
    """It came to the border of the new target, without a word, and stayed there."""
    mesh = made.result.data
    across = np.argsort(read_attribute(mesh, "position")[:, 0])
    # The ground is 20 m wide; 33 m further on the new one begins at its middle.
    pinned = np.concatenate([across[:3], across[-2:]])
    pins.pin(mesh, pinned)
    before = in_world(made.result)[pinned]
    bpy.ops.mesh.primitive_plane_add(size=60, location=(where, 0.0, 0.0))
    made.target = bpy.context.object
    if by == "operator":
        assert bpy.ops.esh.scatter() == {"FINISHED"}
        notes, result = made.report["notes"], made.result
    else:
        positional, named = made.arguments(bpy.context.scene)
        anew = scatter(*positional, **named)
        notes, result = anew.report.notes, anew.object
    stays = np.flatnonzero(pins.staying(result.data))
    assert len(stays) == kept
    for place in in_world(result)[stays]:
        assert np.linalg.norm(before[:, :2] - place[:2], axis=1).min() < 1e-4, "it is where it was"
    lost = 5 - kept
    assert [note for note in notes if "elsewhere" in note] == (
        [f"{lost} moved or pinned objects were lost: the new target is elsewhere"] if lost else []
    )
    assert len(result.data.vertices) == 110, "others have their places"


def test_a_run_that_keeps_what_was_placed_by_hand_is_not_asked_about(made):
    mesh = made.result.data
    pins.pin(mesh, np.arange(3))
    made.classes["Pine"].sizes[0].name = "Tall"
    made.classes["Pine"].name = "Fir"
    made.classes["Beech"].mute = True
    assert before_a_run(bpy.context, made) is None
