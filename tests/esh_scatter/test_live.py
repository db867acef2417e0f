"""Live: a result follows what changes, from where its objects are, and stops with a sentence where it cannot."""

import threading
import time

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter import registration  # noqa: E402
from esh.esh_scatter.result import pins  # noqa: E402
from esh.esh_scatter.result.display import followed_targets, our_modifier  # noqa: E402
from esh.esh_scatter.result.node_group_contents import MADE_OF, placed_objects  # noqa: E402
from esh.esh_scatter.result.result import is_copy  # noqa: E402
from esh.esh_scatter.solving import followed_scatter, live, strokes  # noqa: E402
from esh.esh_scatter.targets.mesh_attributes import read_attribute  # noqa: E402


@pytest.fixture(autouse=True)
def empty_file():
    bpy.ops.wm.read_homefile(use_empty=True)
    registration.register()
    yield
    registration.unregister()
    assert not live._followed and not any(hook in handlers for handlers, hook in live._hooks())


def new_image(name="mask.png"):
    image = bpy.data.images.new(name, 64, 64)
    pixels = np.ones((64, 64, 4), np.float32)
    pixels[..., :3] = 0.5
    image.pixels.foreach_set(pixels.ravel())
    return image


@pytest.fixture
def scatter():
    bpy.ops.mesh.primitive_grid_add(size=40, x_subdivisions=20, y_subdivisions=20)
    ground = bpy.context.object
    ground.name = "Ground"
    ground.vertex_groups.new(name="here").add(list(range(441)), 0.5, "REPLACE")
    made = bpy.context.scene.esh_scatter.add_scatter(ground)
    for name, kind in (("Pine", "IMAGE"), ("Beech", "VERTEX_GROUP")):
        bpy.ops.mesh.primitive_cone_add(radius1=0.3, depth=1.0, location=(60, 0, 0))
        bpy.context.object.name = name
        body_class = made.add_class()
        body_class.name = name
        body_class.add_layer(kind, **({"vertex_group": "here"} if kind == "VERTEX_GROUP" else {"image": new_image()}))
        body_class.sizes[0].source_object, body_class.sizes[0].count = bpy.context.object, 200
    made.device, made.max_steps = "CPU", 40
    return made


def paint(value, columns=64, name="mask.png"):
    """Give the leftmost columns of an image a value."""
    image = bpy.data.images[name]
    pixels = np.empty(64 * 64 * 4, np.float32)
    image.pixels.foreach_get(pixels)
    pixels.reshape(64, 64, 4)[:, :columns, :3] = value
    image.pixels.foreach_set(pixels)


def active():
    return bpy.context.scene.esh_scatter.active


def points(name=None):
    """Return places by the numbers of the points; of one class by its name."""
    scatter = active()
    mesh = scatter.result.data
    place = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", place)
    number, of_class = np.empty((2, len(mesh.vertices)), np.int32)
    mesh.attributes["id"].data.foreach_get("value", number)
    mesh.attributes["class_index"].data.foreach_get("value", of_class)
    own = slice(None) if name is None else of_class == [c.name for c in scatter.ready_classes()].index(name)
    return dict(zip(number[own].tolist(), place.reshape(-1, 3)[own], strict=True))


def moved(before, after):
    both = before.keys() & after.keys()
    return np.array([np.linalg.norm(after[n] - before[n]) for n in both])


def switch_on(scatter, follow):
    bpy.ops.esh.scatter()
    scatter.live = True
    before = points()
    follow()
    after = points()
    assert before.keys() == after.keys() and moved(before, after).max() == 0.0, "switching it on moves nothing"
    return before


@pytest.fixture
def under_way(monkeypatch):
    """Have it look as if an operator was under way, by its name; None ends it."""

    def begin(operator):
        monkeypatch.setattr(strokes, "operator_among", lambda names: operator if operator in names else None)

    return begin


def test_a_painted_image_is_followed_and_what_is_far_from_it_stays(scatter, follow):
    before = switch_on(scatter, follow)
    there = points("Pine")
    image = bpy.data.images["mask.png"]
    pixels = np.empty(64 * 64 * 4, np.float32)
    image.pixels.foreach_get(pixels)
    painted = pixels.reshape(64, 64, 4)
    painted[:, :16, :3] = 0.0
    image.pixels.foreach_set(pixels)
    follow()
    after = points("Pine")
    assert len(after) == 200 and active().result is not None
    assert min(place[0] for place in after.values()) > -10.6, "nothing is left of the stroke"
    assert len(there.keys() - after.keys()) > 30, "who stood there is gone"
    far = {n: p for n, p in points("Beech").items() if p[0] > 5.0}
    # They make room for the pines that came, and that is all.
    assert np.median(moved(before, far)) < 0.3
    assert not active().outdated and active().report["classes"][0]["sizes"][0]["placed"] == 200


@pytest.fixture
def edit_points(scatter):
    """Enter Edit Mode of the result with some points selected, by their numbers."""

    def begin(numbers):
        bpy.ops.object.select_all(action="DESELECT")
        bpy.context.view_layer.objects.active = scatter.result
        mesh = scatter.result.data
        mesh.vertices.foreach_set("select", np.isin(read_attribute(mesh, "id"), numbers))
        bpy.ops.object.mode_set(mode="EDIT")

    return begin


def selected_numbers(result):
    """Return the numbers of the points that are selected, outside Edit Mode."""
    return sorted(read_attribute(result.data, "id")[pins.selected_points(result.data)].tolist())


def test_instances_that_are_moved_in_edit_mode_are_followed_there(scatter, follow, edit_points):
    before = switch_on(scatter, follow)
    near, far = (number for number, _ in sorted(before.items(), key=lambda one: np.hypot(*one[1][:2]))[:2])
    edit_points([near, far])
    follow()
    bpy.ops.transform.translate(value=(1.2, 0.0, 0.0))
    follow()
    assert scatter.result.mode == "EDIT" and live.status(bpy.context.scene, scatter) == ""
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not scatter.outdated
    after = points()
    assert selected_numbers(scatter.result) == sorted([near, far])
    for one in (near, far):
        assert np.linalg.norm(after[one] - before[one] - (1.2, 0.0, 0.0)) < 1e-3
    assert after.keys() == before.keys() and moved(before, after).max() > 0.2, "others make room"
    middle = np.array(list(before.values())) - before[near]
    away = [n for n, way in zip(before, middle, strict=True) if np.hypot(*way[:2]) > 10.0]
    assert np.median([np.linalg.norm(after[n] - before[n]) for n in away]) < 0.2, "a tenth of their spacing"
    # What was solved in Edit Mode is what is there: nothing is left to do.
    follow()
    assert moved(after, points()).max() == 0.0 and not scatter.outdated


def test_what_changes_while_points_are_edited_is_followed_with_the_same_points_selected(scatter, follow, edit_points):
    before = switch_on(scatter, follow)
    edit_points(list(before)[::7])
    bpy.ops.mesh.hide(unselected=True)
    scatter.classes["Beech"].sizes[0].count = 150
    bpy.context.view_layer.update()
    follow()
    assert scatter.result.mode == "EDIT"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(points()) == 350
    left = [number for number in list(before)[::7] if number in points()]
    assert selected_numbers(scatter.result) == sorted(left) and len(left) > 40
    hidden = np.zeros(350, bool)
    scatter.result.data.vertices.foreach_get("hide", hidden)
    assert (~hidden).sum() == len(left)


def test_what_is_pinned_or_removed_by_a_button_in_edit_mode_is_followed_there(scatter, follow, edit_points):
    before = switch_on(scatter, follow)
    one = next(iter(before))
    edit_points([one])
    follow()
    bpy.ops.esh.instances_remove()
    follow()
    assert scatter.result.mode == "EDIT" and len(scatter.free_places) == 1
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(points()) == 400
    gap = min(np.linalg.norm(place[:2] - before[one][:2]) for place in points().values())
    assert gap > 0.29, "its place stays free"


def test_while_something_is_solved_operators_can_be_called_with_another_context(scatter, follow):
    """With Python 3.11 Blender crashes where another thread has Python's lock meanwhile."""
    switch_on(scatter, follow)
    one = next(iter(live._followed.values()))
    held = []
    for count in (1500, 200, 1500):
        scatter.classes["Beech"].sizes[0].count = count
        one._looked = 0.0
        live._tick()
        with live.resting(), bpy.context.temp_override(active_object=scatter.target, object=scatter.target):
            held.append((one.busy, one.worker._held))
            for _ in range(20):
                bpy.ops.object.mode_set(mode="EDIT")
                bpy.ops.object.mode_set(mode="OBJECT")
            assert one.worker._held
        assert not one.worker._held
    assert held == [(True, True)] * 3
    follow()
    assert len(points()) == 1700 and not scatter.outdated


def test_what_is_moved_while_the_others_make_room_is_not_put_back(scatter, follow, edit_points, monkeypatch):
    """An answer to where it was before comes too late."""
    before = switch_on(scatter, follow)
    one = next(iter(before))
    edit_points([one])
    follow()
    bpy.ops.transform.translate(value=(0.6, 0.0, 0.0))
    monkeypatch.setattr(followed_scatter.FollowedScatter, "_may_write", lambda *_: False)
    follow_until_answered(follow)
    bpy.ops.transform.translate(value=(0.6, 0.0, 0.0))
    monkeypatch.undo()
    follow()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert np.linalg.norm(points()[one] - before[one] - (1.2, 0.0, 0.0)) < 1e-3


def follow_until_answered(follow):
    """Let the timer run until what was asked for has come out."""
    one = next(iter(live._followed.values()))
    follow(until=lambda: one._waiting is not None)


def test_settings_that_change_without_a_sign_are_followed_in_edit_mode(scatter, follow, edit_points):
    """Blender says nothing of what scripts change."""
    import bmesh

    switch_on(scatter, follow)
    edit_points([])
    follow()
    for count in (200, 400):
        scatter.classes["Pine"].mute = count == 200
        follow()
        assert scatter.result.mode == "EDIT" and len(bmesh.from_edit_mesh(scatter.result.data).verts) == count


def test_an_operator_of_edit_mode_is_waited_for(scatter, follow, edit_points, monkeypatch):
    before = switch_on(scatter, follow)
    edit_points([next(iter(before))])
    follow()
    bpy.ops.transform.translate(value=(1.2, 0.0, 0.0))
    monkeypatch.setattr(strokes, "edits_points", lambda: True)
    follow()
    assert not live.is_busy(bpy.context.scene, scatter) and live.status(bpy.context.scene, scatter) == ""
    scatter.result.update_from_editmode()
    monkeypatch.setattr(strokes, "edits_points", lambda: False)
    follow()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert moved(before, points()).max() > 1.0 and np.median(moved(before, points())) > 0.0


@pytest.mark.parametrize("even, steps", [(0.15, 5), (0.0, 45)])
def test_what_looks_uneven_after_a_change_runs_on(scatter, follow, monkeypatch, even, steps):
    from esh.esh_scatter.solving import live_worker

    monkeypatch.setattr(live_worker, "EVEN", even)
    monkeypatch.setattr(live_worker, "MUCH_LESS_EVEN", 1e-6)
    switch_on(scatter, follow)
    image = bpy.data.images["mask.png"]
    pixels = np.empty(64 * 64 * 4, np.float32)
    image.pixels.foreach_get(pixels)
    pixels.reshape(64, 64, 4)[:, :32, :3] = 0.1
    image.pixels.foreach_set(pixels)
    follow()
    assert active().report["steps"] == steps and not active().outdated
    there, placed = points(), active().report["coverage_error"]
    follow()
    assert moved(there, points()).max() == 0.0 and placed < 0.1


def test_a_stroke_is_followed_on_after_a_slow_moment_of_the_machine(scatter, monkeypatch, under_way, follow):
    """Other programs may have the processors while it is read; that says nothing of how long reading takes."""
    from esh.esh_scatter.solving.job import ScatterJob

    switch_on(scatter, follow)
    read = ScatterJob._read

    def slowly(job, context):
        time.sleep(3.0 * followed_scatter.FOLLOWS_STROKES)
        return read(job, context)

    monkeypatch.setattr(ScatterJob, "_read", slowly)
    under_way("PAINT_OT_image_paint")
    image = bpy.data.images["mask.png"]
    pixels = np.empty(64 * 64 * 4, np.float32)
    for columns, border in ((16, -10.6), (32, -0.6)):
        image.pixels.foreach_get(pixels)
        pixels.reshape(64, 64, 4)[:, :columns, :3] = 0.0
        image.pixels.foreach_set(pixels)
        follow()
        assert min(place[0] for place in points("Pine").values()) > border, "the brush is still down"


def test_a_stroke_that_was_followed_in_parts_ends_as_if_it_had_been_followed_at_once(scatter, under_way, follow):
    """Each part stirs what is far from it a little, as new objects come down everywhere; all of them together must not."""
    scatter.classes["Pine"].sizes[0].count = scatter.classes["Beech"].sizes[0].count = 1000
    switch_on(scatter, follow)
    image = bpy.data.images["mask.png"]

    def paint(columns):
        pixels = np.empty(64 * 64 * 4, np.float32)
        image.pixels.foreach_get(pixels)
        pixels.reshape(64, 64, 4)[:, :columns, :3] = 0.0
        image.pixels.foreach_set(pixels)
        follow()

    def stirred():
        """Of beeches far from the stroke, by half a spacing of all 2,000."""
        return np.mean(moved({n: p for n, p in before.items() if p[0] > 0.0}, points("Beech")) > 0.45)

    before = points("Beech")
    under_way("PAINT_OT_image_paint")
    for columns in range(1, 17):
        paint(columns)
    in_parts = stirred()
    placed = points()
    under_way(None)
    follow()
    assert stirred() < min(0.1, 0.5 * in_parts), "they are back where they were"
    assert points().keys() != placed.keys() and not active().outdated
    there = points()
    assert len(points("Pine")) == 1000 and min(place[0] for place in points("Pine").values()) > -10.6
    follow()
    assert moved(there, points()).max() == 0.0


def test_an_obstacle_that_is_moved_away_and_back_leaves_objects_where_they_were(scatter, under_way, follow):
    bpy.ops.mesh.primitive_cube_add(size=6.0, location=(12.0, 0.0, 0.0))
    rock = bpy.context.object
    scatter.obstacles.add().item = rock
    before = switch_on(scatter, follow)
    under_way("TRANSFORM_OT_translate")
    for place in (6.0, 0.0, -6.0, -12.0):
        rock.location.x = place
        bpy.context.view_layer.update()
        follow()
        assert all(np.abs(at[:2] - (place, 0.0)).max() > 2.99 for at in points().values()), "it is still being moved"
    rock.location.x = 12.0
    bpy.context.view_layer.update()
    under_way(None)
    follow()
    assert points().keys() == before.keys() and moved(before, points()).max() < 0.3


@pytest.mark.parametrize(("wrong", "part"), [("zero", 1), ("zero", 6), ("zero", 13), ("muted", 6)])
def test_an_error_in_a_stroke_leaves_its_beginning_known(scatter, under_way, follow, wrong, part):
    scatter.classes["Pine"].sizes[0].count = scatter.classes["Beech"].sizes[0].count = 1000
    before = switch_on(scatter, follow)

    def everywhere_zero():
        paint(0.0)
        follow()
        assert "is 0 everywhere" in live.status(bpy.context.scene, scatter)
        paint(0.5)

    under_way("PAINT_OT_image_paint")
    for columns in range(1, 13):
        if columns == part and wrong == "zero":
            everywhere_zero()
        elif columns == part:
            for mute in (True, False):
                scatter.classes["Pine"].mute = scatter.classes["Beech"].mute = mute
                follow()
                assert ("muted" in live.status(bpy.context.scene, scatter)) == mute
        paint(0.0, columns)
        follow()
    under_way(None)
    if part > columns:
        everywhere_zero()
        paint(0.0, columns)
    follow()
    assert live.status(bpy.context.scene, scatter) == "" and not active().outdated
    far = moved({n: p for n, p in before.items() if p[0] > 0.0}, points("Beech"))
    assert np.median(far) < 0.15


@pytest.mark.parametrize("late", [False, True])
def test_undo_and_redo_lead_to_what_has_followed_strokes_as_one(scatter, under_way, follow, late):
    """Undo steps hold what the last part of a stroke had left, be it up to date or not: they are made when the operator ends."""
    bpy.ops.mesh.primitive_cube_add(size=6.0, location=(12.0, 0.0, 0.0))
    bpy.context.object.name = "Rock"
    scatter.obstacles.add().item = bpy.context.object
    bpy.ops.ed.undo_push(message="before")
    there = [switch_on(scatter, follow)]
    bpy.ops.ed.undo_push(message="live")
    for _ in range(3):
        under_way("TRANSFORM_OT_translate")
        for _ in range(4):
            bpy.data.objects["Rock"].location.x -= 1.0
            bpy.context.view_layer.update()
            follow()
        if late:
            bpy.data.objects["Rock"].location.y += 1.0
            bpy.context.view_layer.update()
        bpy.ops.ed.undo_push(message="drag")
        under_way(None)
        follow()
        there.append(points())

    def assert_stands(number):
        follow()
        now = points()
        assert now.keys() == there[number].keys() and moved(there[number], now).max() < 1e-5 and not active().outdated

    for number in (2, 1, 0):
        bpy.ops.ed.undo()
        assert_stands(number)
    for number in (1, 2, 3):
        bpy.ops.ed.redo()
        assert_stands(number)


def test_two_strokes_with_no_look_between_them_are_undone_one_by_one(scatter, under_way, follow):
    bpy.ops.mesh.primitive_cube_add(size=6.0, location=(12.0, 0.0, 0.0))
    bpy.context.object.name = "Rock"
    scatter.obstacles.add().item = bpy.context.object
    bpy.ops.ed.undo_push(message="before")
    switch_on(scatter, follow)
    bpy.ops.ed.undo_push(message="live")
    under_way("TRANSFORM_OT_translate")
    for _ in range(2):
        for _ in range(3):
            bpy.data.objects["Rock"].location.x -= 2.0
            bpy.context.view_layer.update()
            follow()
        bpy.ops.ed.undo_push(message="drag")
    under_way(None)
    follow()
    bpy.ops.ed.undo()
    follow()
    assert bpy.data.objects["Rock"].location.x == 6.0 and not active().outdated
    assert all(np.abs(at[:2] - (6.0, 0.0)).max() > 2.99 for at in points().values())


@pytest.mark.parametrize("then", ["edited", "real"])
def test_what_is_edited_right_after_a_stroke_is_at_rest(scatter, under_way, follow, then):
    switch_on(scatter, follow)
    under_way("PAINT_OT_image_paint")
    for columns in range(1, 5):
        paint(0.0, columns)
        follow()
    under_way(None)
    if then == "edited":
        bpy.ops.object.select_all(action="DESELECT")
        bpy.context.view_layer.objects.active = scatter.result
        bpy.ops.object.mode_set(mode="EDIT")
    else:
        bpy.ops.esh.instances_make_real()
    follow()
    assert not live.is_busy(bpy.context.scene, scatter)
    if then == "edited":
        bpy.ops.object.mode_set(mode="OBJECT")
    else:
        assert "real objects" in live.status(bpy.context.scene, scatter)
        bpy.ops.esh.instances_from_real()
    follow()
    assert live.status(bpy.context.scene, scatter) == "" and not active().outdated and len(points()) == 400


def test_what_was_wrong_is_said_no_longer_once_it_is_as_before(scatter, follow):
    switch_on(scatter, follow)
    for body_class in scatter.classes:
        body_class.mute = True
    follow()
    assert "muted" in live.status(bpy.context.scene, scatter)
    for body_class in scatter.classes:
        body_class.mute = False
    follow()
    assert live.status(bpy.context.scene, scatter) == ""


def test_what_was_placed_by_hand_is_not_lost_without_being_asked(scatter, follow):
    """A class was muted, and unmuted again: its tree that had been moved by hand was elsewhere, and nothing had been said."""
    switch_on(scatter, follow)
    mesh = active().result.data
    number = next(iter(points("Pine")))
    at = read_attribute(mesh, "id").tolist().index(number)
    mesh.vertices[at].co = (7.3, 5.1, 0.0)
    follow()
    moved_to = points()[number]
    scatter.classes["Pine"].mute = True
    follow()
    assert live.status(bpy.context.scene, scatter).startswith(
        "1 moved or pinned object of Pine will be lost: Live waits"
    )
    assert len(points()) == 400
    scatter.classes["Pine"].mute = False
    follow()
    assert live.status(bpy.context.scene, scatter) == ""
    np.testing.assert_allclose(points()[number], moved_to, atol=1e-5)
    scatter.classes["Pine"].mute = True
    follow()
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    follow()
    assert len(points()) == 200 and live.status(bpy.context.scene, scatter) == ""


def test_more_than_the_cap_are_not_placed_without_being_asked(scatter, follow):
    """A count that was dragged too far, or a distance without its zero, began to place millions."""
    scatter.cap = 500
    before = switch_on(scatter, follow)
    pine = scatter.classes["Pine"]
    pine.sizes[0].count = 800
    follow()
    assert live.status(bpy.context.scene, scatter) == (
        "1,000 objects will take about 1 s and 0.1 GB of memory: Live waits. Click Update to place them"
    )
    assert points().keys() == before.keys()
    pine.sizes[0].count = 200
    follow()
    assert live.status(bpy.context.scene, scatter) == "" and not active().outdated
    pine.count_kind, pine.distance = "DISTANCE", 0.05
    follow()
    assert "Live waits" in live.status(bpy.context.scene, scatter) and len(points()) == 400
    # Whoever has placed them once is not asked about as many.
    pine.count_kind, pine.sizes[0].count = "SIZES", 800
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    follow()
    paint(0.0, 16)
    pine.sizes[0].count = 790
    follow()
    assert live.status(bpy.context.scene, scatter) == "" and len(points()) == 990
    assert min(place[0] for place in points("Pine").values()) > -10.6


def test_two_scatters_on_one_target_follow_a_stroke(scatter, under_way, follow):
    """Blender crashed, as one's thread worked while it was read for the other."""
    bpy.ops.esh.scatter()
    other = bpy.context.scene.esh_scatter.add_scatter(scatter.target)
    stone = other.add_class()
    stone.name, stone.sizes[0].source_object, stone.sizes[0].count = "Stone", bpy.data.objects["Beech"], 100
    stone.add_layer("IMAGE", image=bpy.data.images["mask.png"])
    other.device, other.max_steps = "CPU", 40
    bpy.ops.esh.scatter_choose(index=1)
    bpy.ops.esh.scatter()
    scatters = bpy.context.scene.esh_scatter.scatters
    for one in scatters:
        one.live = True
    follow()
    under_way("PAINT_OT_image_paint")
    for columns in (4, 8, 12):
        paint(0.0, columns)
        follow()
    under_way(None)
    follow()
    assert not any(one.outdated or live.status(bpy.context.scene, one) for one in scatters)
    assert [len(one.result.data.vertices) for one in scatters] == [400, 100]
    assert all(vertex.co.x > -12.7 for vertex in scatters[1].result.data.vertices)


@pytest.mark.parametrize("more", [0, 10])
def test_a_copy_with_settings_of_its_own_is_followed_from_where_it_is(scatter, follow, more):
    bpy.ops.esh.scatter()
    result = scatter.result
    bpy.ops.object.select_all(action="DESELECT")
    result.select_set(True)
    bpy.context.view_layer.objects.active = result
    bpy.ops.object.duplicate(linked=False)
    bpy.ops.esh.scatter_of_copy()
    scatters = bpy.context.scene.esh_scatter
    (own,) = (one for one in scatters.scatters if one.result == bpy.context.view_layer.objects.active)
    scatters.scatter_index = list(scatters.scatters).index(own)
    before = points()
    if more:
        own.classes[0].sizes[0].count += 10
    own.live = True
    follow()
    assert len(points()) == len(before) + more and before.keys() <= points().keys()
    assert more or moved(before, points()).max() == 0.0
    own.classes[0].sizes[0].count += 10
    follow()
    assert len(points()) == len(before) + more + 10


def test_colors_and_weights_are_followed_while_they_are_painted(scatter, under_way, follow):
    ground = scatter.target.data
    ground.color_attributes.new("wet", "BYTE_COLOR", "POINT")
    ground.attributes["wet"].data.foreach_set("color", np.ones(4 * len(ground.vertices)))
    scatter.classes["Pine"].add_layer("ATTRIBUTE", attribute="wet", blend="MULTIPLY")
    switch_on(scatter, follow)
    left = np.array([vertex.co.x < 0.0 for vertex in ground.vertices])
    under_way("PAINT_OT_vertex_paint")
    ground.attributes["wet"].data.foreach_set("color", np.repeat(np.where(left, 0.0, 1.0), 4))
    follow()
    assert min(place[0] for place in points("Pine").values()) > -3.0, "the brush is still down"
    follow()
    under_way(None)
    follow()
    bpy.context.view_layer.objects.active = scatter.target
    bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
    under_way("PAINT_OT_weight_paint")
    scatter.target.vertex_groups["here"].add(np.flatnonzero(left).tolist(), 0.0, "REPLACE")
    bpy.context.view_layer.update()
    follow()
    assert min(place[0] for place in points("Beech").values()) > -3.0, "the brush is still down"


def test_weights_of_many_vertices_are_followed_while_they_are_painted(scatter, monkeypatch, under_way, follow):
    """To the last of them; of more than 40,000 it was waited until the brush was lifted."""
    # They are read in 0.07 s, on a machine of its own.
    monkeypatch.setattr(followed_scatter, "FOLLOWS_STROKES", 1.0)
    bpy.ops.mesh.primitive_grid_add(size=40, x_subdivisions=316, y_subdivisions=316)
    ground = bpy.context.object
    ground.vertex_groups.new(name="here").add(range(len(ground.data.vertices)), 0.5, "REPLACE")
    scatter.target = ground
    switch_on(scatter, follow)
    bpy.context.view_layer.objects.active = ground
    bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
    under_way("PAINT_OT_weight_paint")
    told = live._followed[bpy.context.scene.session_uid, scatter.uid]._told
    ground.vertex_groups["here"].add([50_001], 0.55, "REPLACE")
    bpy.context.view_layer.update()
    follow()
    assert live._followed[bpy.context.scene.session_uid, scatter.uid]._told != told, "of one vertex it is heard"
    place = np.empty(3 * len(ground.data.vertices), np.float32)
    ground.data.attributes["position"].data.foreach_get("vector", place)
    ground.vertex_groups["here"].add(np.flatnonzero(place[::3] < 0.0).tolist(), 0.0, "REPLACE")
    bpy.context.view_layer.update()
    follow()
    assert min(spot[0] for spot in points("Beech").values()) > -3.0, "the brush is still down"


def test_weights_behind_geometry_nodes_are_followed_when_the_brush_is_lifted(scatter, under_way, follow):
    """They cannot be read without making something in the file."""
    scatter.target.modifiers.new("Nodes", "NODES")
    switch_on(scatter, follow)
    before = points("Beech")
    under_way("PAINT_OT_weight_paint")
    left = [vertex.index for vertex in scatter.target.data.vertices if vertex.co.x < 0.0]
    scatter.target.vertex_groups["here"].add(left, 0.0, "REPLACE")
    bpy.context.view_layer.update()
    follow()
    assert moved(before, points("Beech")).max() == 0.0
    under_way(None)
    follow()
    assert min(place[0] for place in points("Beech").values()) > -3.0


def test_the_handler_takes_no_time_beside_ten_thousand_objects(scatter, follow):
    """At most a twentieth of a millisecond for an update in which nothing of ours changes."""
    mesh = bpy.data.meshes.new("Speck")
    for number in range(10_000):
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(f"Speck {number}", mesh))
    switch_on(scatter, follow)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    assert live._something_changed in bpy.app.handlers.depsgraph_update_post
    seconds = []
    for _ in range(200):
        start = time.perf_counter()
        live._something_changed(bpy.context.scene, depsgraph)
        seconds.append(time.perf_counter() - start)
    assert np.median(seconds) < 5e-5


def test_counts_weights_and_the_target_are_followed(scatter, follow):
    before = switch_on(scatter, follow)
    scatter.classes["Beech"].sizes[0].count = 230
    follow()
    after = points()
    assert len(after) == 430 and len(before.keys() & after.keys()) == 400
    assert np.median(moved(before, after)) < 0.5
    group = scatter.target.vertex_groups["here"]
    group.add([v.index for v in scatter.target.data.vertices if v.co.y > 0], 0.0, "REPLACE")
    follow()
    assert max(place[1] for place in points("Beech").values()) < 1.1
    for vertex in scatter.target.data.vertices:
        vertex.co.z = 3.0
    scatter.target.data.update()
    follow()
    assert {round(float(place[2]), 3) for place in points().values()} == {3.0}
    before = points()
    scatter.target.location.x += 100.0
    bpy.context.view_layer.update()
    follow()
    after = points()
    assert before.keys() == after.keys()
    way = np.array([after[n] - before[n] for n in before])
    assert np.abs(np.median(way, axis=0) - (100, 0, 0)).max() < 0.05


def test_what_was_changed_while_it_was_off_is_followed_from_what_is_there(scatter, follow):
    """Counts, a class that is new, and one that is gone: all others stay about where they are, and are the same."""
    bpy.ops.esh.scatter()
    before = points()
    scatter.classes["Beech"].sizes[0].count = 230
    scatter.live = True
    follow()
    after = points()
    assert len(after) == 430 and before.keys() <= after.keys()
    # Spacing is about 1.9 m; few steps are enough.
    assert np.median(moved(before, after)) < 0.5 and not scatter.outdated
    scatter.live = False
    follow()
    pines = points("Pine")
    scatter.classes["Beech"].mute = True
    bush = scatter.add_class()
    bush.name = "Bush"
    bush.sizes[0].source_object, bush.sizes[0].count = bpy.data.objects["Beech"], 20
    scatter.classes["Pine"].sizes[0].count = 190
    scatter.live = True
    follow()
    now = points("Pine")
    assert len(now) == 190 and now.keys() <= pines.keys() and not scatter.outdated
    assert np.median(moved(pines, now)) < 2.0, "they have the room of the beeches now"
    # They are others than the pines that went.
    assert len(points("Bush")) == 20 and not points("Bush").keys() & pines.keys()


def test_a_class_comes_and_goes(scatter, follow):
    switch_on(scatter, follow)
    scatter.classes["Beech"].mute = True
    follow()
    assert len(points()) == 200 and [e["name"] for e in active().report["classes"]] == ["Pine"]
    scatter.classes["Beech"].mute = False
    follow()
    assert len(points("Beech")) == len(points("Pine")) == 200
    assert set(scatter.result.data["esh_scatter_classes"]) == {c.uid for c in scatter.classes}


def test_another_seed_places_others(scatter, follow):
    before = switch_on(scatter, follow)
    scatter.seed = 5
    follow()
    assert np.median(moved(before, points())) > 1.0


def test_without_a_result_it_makes_one(scatter, follow):
    scatter.live = True
    follow()
    assert len(points()) == 400 and scatter.report["overlaps"] == 0 and not scatter.outdated


def test_what_is_shown_at_once_is_not_taken_back(scatter, follow):
    switch_on(scatter, follow)
    scatter.classes["Pine"].sizes[0].count = 210
    follow(until=lambda: live._followed[next(iter(live._followed))]._worker.busy)
    scatter.classes["Pine"].tilt = 0.3
    scatter.classes["Pine"].color = (1.0, 0.0, 0.0)
    follow()
    assert len(points("Pine")) == 210
    mesh = scatter.result.data
    color = np.empty(4 * len(mesh.vertices), np.float32)
    mesh.attributes["class_color"].data.foreach_get("color", color)
    assert color[:3].tolist() == [1.0, 0.0, 0.0]
    turned = np.empty(4 * len(mesh.vertices), np.float32)
    mesh.attributes["rotation"].data.foreach_get("value", turned)
    assert np.abs(turned.reshape(-1, 4)[:210, 1:3]).max() > 0.05, "they still lean"


def test_discs_that_are_turned_are_not_solved_anew(scatter, follow):
    for body_class in scatter.classes:
        body_class.sizes[0].area_kind, body_class.sizes[0].area = "VALUE", 0.2
    switch_on(scatter, follow)
    one = live._followed[next(iter(live._followed))]
    shown, report = one._shown, scatter.report_json
    scatter.classes["Pine"].random_turn, scatter.classes["Pine"].tilt = 1.0, 0.3
    follow()
    assert one._shown is shown and scatter.report_json == report and not scatter.outdated, "the points have shown it"
    scatter.classes["Pine"].scale_jitter = 0.2
    follow()
    assert one._shown is not shown and not scatter.outdated


def remove_target():
    bpy.data.objects.remove(active().target)


def remove_source():
    bpy.data.objects.remove(bpy.data.objects["Pine"])


def delete_source():
    bpy.context.scene.collection.objects.unlink(bpy.data.objects["Pine"])


def delete_result():
    bpy.context.scene.collection.objects.unlink(active().result)


@pytest.mark.parametrize(
    ("loss", "said"),
    [
        (remove_target, "target is no longer"),
        (remove_source, "an object of Pine was deleted"),
        (delete_source, '"Pine" was deleted'),
        (delete_result, "result is no longer"),
    ],
)
def test_it_stops_with_a_sentence_when_something_is_gone(scatter, loss, said, follow):
    switch_on(scatter, follow)
    loss()
    follow()
    scatter = active()
    assert not scatter.live and said in live.status(bpy.context.scene, scatter)
    assert not live._followed and not any(hook in handlers for handlers, hook in live._hooks())


def test_what_cannot_be_solved_is_said_and_it_goes_on_when_it_can(scatter, follow):
    switch_on(scatter, follow)
    group = scatter.target.vertex_groups["here"]
    group.add(list(range(441)), 0.0, "REPLACE")
    follow()
    said = live.status(bpy.context.scene, scatter)
    assert (
        scatter.live and "above 0 somewhere" in said and said.endswith("0 everywhere: paint where objects are to stand")
    )
    assert len(points()) == 400
    group.add(list(range(200)), 1.0, "REPLACE")
    follow()
    assert live.status(bpy.context.scene, scatter) == "" and not scatter.outdated


def test_undo_is_followed(scatter, follow):
    bpy.ops.ed.undo_push(message="before")
    switch_on(scatter, follow)
    bpy.ops.ed.undo_push(message="scattered")
    scatter.classes["Pine"].sizes[0].count = 260
    follow()
    assert len(points("Pine")) == 260
    bpy.ops.ed.undo_push(message="more")
    bpy.ops.ed.undo()
    follow()
    assert len(points("Pine")) == active().classes["Pine"].sizes[0].count == 200 and not active().outdated
    bpy.ops.ed.redo()
    follow()
    assert len(points("Pine")) == active().classes["Pine"].sizes[0].count == 260 and not active().outdated


@pytest.mark.parametrize("surface", ["ABOVE", "WHOLE"])
def test_a_report_that_is_being_made_does_not_hold_up_the_next_edit(scatter, follow, monkeypatch, surface):
    from esh.esh_scatter.solving import live_worker

    scatter.surface = surface
    switch_on(scatter, follow)
    measured, ended = live_worker.measure, []
    (one,) = live._followed.values()

    def measure(placement, launcher, heat):
        launches = launcher.python_launches
        try:
            if not ended:
                ended.append(False)
                while True:
                    launcher.ask()
                    time.sleep(0.01)
            return measured(placement, launcher, heat)
        finally:
            ended.append(launcher.python_launches - launches)

    monkeypatch.setattr(live_worker, "measure", measure)
    pine = scatter.classes["Pine"].sizes[0]
    pine.count = 220
    follow(lambda: bool(ended) and len(points("Pine")) == 220)
    # It is shown without a report, which is still being made.
    assert one.busy and one._worker.takes_edits
    pine.count = 240
    follow()
    assert ended[1] == 0, "nothing was launched for the first report any more"
    assert len(points("Pine")) == 240 and not active().outdated
    assert active().report["classes"][0]["sizes"][0]["placed"] == 240


def test_what_was_asked_for_before_an_undo_is_not_shown_after_it(scatter, follow, monkeypatch):
    from esh.esh_scatter.solving import live_worker

    bpy.ops.ed.undo_push(message="before")
    there = switch_on(scatter, follow)
    bpy.ops.ed.undo_push(message="live")
    measured, measuring, may_measure = live_worker.measure, threading.Event(), threading.Event()

    def measure(placement, launcher, heat):
        measuring.set()
        assert may_measure.wait(30.0)
        return measured(placement, launcher, heat)

    monkeypatch.setattr(live_worker, "measure", measure)
    scatter.classes["Pine"].sizes[0].count = 220
    bpy.ops.ed.undo_push(message="count")
    follow(lambda: measuring.is_set() and len(points("Pine")) == 220)
    bpy.ops.ed.undo()
    (one,) = live._followed.values()
    may_measure.set()
    while one._worker.busy:
        time.sleep(0.01)
    # Its report comes out only now.
    follow()
    assert moved(there, points()).max() == 0.0 and len(points("Pine")) == 200 and not active().outdated


def test_switching_it_off_ends_an_edit_under_way(scatter, follow, monkeypatch):
    from esh.esh_scatter.solving import live_worker

    switch_on(scatter, follow)
    (one,) = live._followed.values()
    begun, launches = threading.Event(), []

    class Watched(live_worker.Solver):
        def edit(self, problem, **steps):
            begun.set()
            while not one._worker._ended:
                time.sleep(0.01)
            before = self.launcher.python_launches
            try:
                return super().edit(problem, **steps)
            finally:
                launches.append(self.launcher.python_launches - before)

    monkeypatch.setattr(one._worker._solver, "__class__", Watched)
    scatter.classes["Pine"].sizes[0].count = 220
    follow(begun.is_set)
    scatter.live = False
    follow()
    one._worker.join(10.0)
    assert launches == [0] and not one._worker._thread.is_alive()


@pytest.mark.parametrize("surface", ["ABOVE", "WHOLE"])
def test_undo_goes_back_to_the_solver_of_that_time(scatter, follow, monkeypatch, surface):
    from esh.esh_scatter.solving import live_worker

    made = []

    class Counted(live_worker.Solver):
        def __init__(self, *arguments, **named):
            made.append(1)
            super().__init__(*arguments, **named)

    monkeypatch.setattr(live_worker, "Solver", Counted)
    scatter.surface = surface
    bpy.ops.ed.undo_push(message="before")
    there = switch_on(scatter, follow)
    bpy.ops.ed.undo_push(message="live")
    assert len(made) == 1

    def ask(count):
        active().classes["Pine"].sizes[0].count = count
        bpy.ops.ed.undo_push(message="count")
        follow()
        assert len(points("Pine")) == count and not active().outdated

    ask(220)
    ask(240)
    bpy.ops.ed.undo()
    follow()
    assert len(points("Pine")) == 220 and not active().outdated
    bpy.ops.ed.undo()
    follow()
    assert moved(there, points()).max() == 0.0 and not active().outdated
    bpy.ops.ed.redo()
    follow()
    assert len(points("Pine")) == 220
    ask(250)
    for _ in range(2):
        bpy.ops.ed.undo()
        follow()
        bpy.ops.ed.redo()
        follow()
    assert len(points("Pine")) == 250 and not active().outdated
    assert live.status(bpy.context.scene, active()) == "" and len(made) == 1
    # What was moved by hand, or is made for another target, is nowhere to go back to.
    bpy.data.objects["Ground"].scale.x = 1.2
    bpy.ops.ed.undo_push(message="scaled")
    follow()
    bpy.ops.ed.undo()
    follow()
    assert live.status(bpy.context.scene, active()) == "" and not active().outdated and len(made) > 1


def test_only_so_many_results_are_there_to_go_back_to(scatter, follow, monkeypatch):
    from esh.esh_scatter.solving import earlier_results

    switch_on(scatter, follow)
    (one,) = live._followed.values()
    for count in range(210, 290, 10):
        scatter.classes["Pine"].sizes[0].count = count
        follow()
    worker = one._worker
    assert len(worker._earlier) == earlier_results.MOST_EARLIER == len(worker._solver._bookmarks)
    monkeypatch.setattr(earlier_results, "MOST_BODIES_EARLIER", 1000)
    scatter.classes["Pine"].sizes[0].count = 200
    follow()
    assert len(worker._earlier) == 2 == len(worker._solver._bookmarks)


def a_class_of_a_collection(scatter):
    collection = bpy.data.collections.new("Kinds")
    collection.objects.link(bpy.data.objects.new("One", bpy.data.objects["Pine"].data))
    bpy.ops.esh.class_add()
    size = scatter.classes[-1].sizes[0]
    size.source_kind, size.source_collection, size.count = "ASSET", collection, 30


CHANGES = {
    "a count": lambda scatter: setattr(scatter.classes["Pine"].sizes[0], "count", 260),
    "a class of a collection": a_class_of_a_collection,
}


@pytest.mark.parametrize("wait", [True, False], ids=["followed", "at once"])
@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_undo_steps_that_are_older_than_what_was_written_are_followed(scatter, follow, change, wait):
    """As in the sidebar: a field makes its step when it is let go, and Live writes after that, in no step of its own."""
    bpy.ops.esh.scatter()
    bpy.ops.ed.undo_push(message="before")
    switch_on(active(), follow)
    bpy.ops.ed.undo_push(message="live")
    before = len(active().result.data.vertices)
    change(active())
    bpy.ops.ed.undo_push(message="changed")
    follow()
    after = len(active().result.data.vertices)
    assert after > before
    for _ in range(2):
        bpy.ops.ed.undo()
        if wait:
            follow()
            assert len(active().result.data.vertices) == before and not active().outdated
        bpy.ops.ed.redo()
        if wait:
            follow()
            assert len(active().result.data.vertices) == after and not active().outdated
    bpy.ops.ed.undo()
    bpy.ops.ed.undo()
    # It is not live any more, or not yet.
    follow()
    assert not active().live and (len(active().result.data.vertices) == before or active().outdated)
    bpy.ops.ed.redo()
    bpy.ops.ed.redo()
    follow()
    assert len(active().result.data.vertices) == after and not active().outdated
    group = active().result.modifiers[0].node_group
    assert len(placed_objects(group)) >= 2 and None not in placed_objects(group)
    shown = bpy.context.evaluated_depsgraph_get()
    assert sum(one.is_instance for one in shown.object_instances) == after


@pytest.mark.parametrize("linked", [True, False])
def test_undo_beside_a_copy_of_the_result_leads_to_nothing_that_is_gone(scatter, follow, linked):
    """What copies use a result lets be, and takes another mesh and another node group, of which no undo step knows."""
    switch_on(scatter, follow)
    bpy.ops.object.select_all(action="DESELECT")
    active().result.select_set(True)
    bpy.ops.object.duplicate(linked=linked)
    # As it is after the file was opened anew.
    our_modifier(active().result).node_group[MADE_OF] = "[[], [], 0]"
    bpy.ops.ed.undo_push(message="copied")
    counts = [len(points())]
    for count in (220, 240):
        active().classes["Pine"].sizes[0].count = count
        bpy.ops.ed.undo_push(message="changed")
        follow()
        counts.append(len(points()))
    undo, redo = bpy.ops.ed.undo, bpy.ops.ed.redo
    for step, wanted in ((undo, 1), (undo, 0), (redo, 1), (redo, 2)):
        step()
        result = active().result
        assert result.data.as_pointer() in {mesh.as_pointer() for mesh in bpy.data.meshes}
        assert our_modifier(result).node_group.as_pointer() in {group.as_pointer() for group in bpy.data.node_groups}
        follow()
        assert len(points()) == counts[wanted] and not active().outdated
        (told,) = followed_targets(our_modifier(active().result))
        assert told.target == active().target
        copies = [item for item in bpy.context.scene.objects if is_copy(item, active().result)]
        shown = [
            one.parent.original for one in bpy.context.evaluated_depsgraph_get().object_instances if one.is_instance
        ]
        assert sorted(shown.count(item) for item in copies) == sorted((counts[0], counts[wanted]))


def shown_beside_copies():
    """How many objects each result and copy shows, once all nodes lead to groups that are there."""
    there = {group.as_pointer() for group in bpy.data.node_groups}
    for group in bpy.data.node_groups:
        assert all(n.node_tree.as_pointer() in there for n in group.nodes if n.bl_idname == "GeometryNodeGroup")
    shown = [one.parent.original for one in bpy.context.evaluated_depsgraph_get().object_instances if one.is_instance]
    return [shown.count(item) for item in bpy.context.scene.objects if is_copy(item, active().result)]


def test_many_steps_back_and_forth_beside_a_copy_lead_to_no_parts_of_nodes_that_are_gone(scatter, follow):
    """The group that only a copy still uses was made anew for an undo, as that of the result."""

    def change(name):
        active().classes["Pine"].sizes[0].source_object = bpy.data.objects[name]
        bpy.ops.ed.undo_push(message=name)
        follow()

    undo, redo = bpy.ops.ed.undo, bpy.ops.ed.redo
    bpy.data.objects.new("Rock", bpy.data.objects["Beech"].data)
    switch_on(scatter, follow)
    bpy.ops.ed.undo_push(message="live")
    change("Beech")
    bpy.ops.object.select_all(action="DESELECT")
    active().result.select_set(True)
    bpy.ops.object.duplicate()
    for name in ("copied", "later"):
        bpy.ops.ed.undo_push(message=name)
    undo()
    follow()
    assert shown_beside_copies() == [400, 400]
    change("Rock")
    for step in (undo, redo, undo, undo, redo, redo, undo, redo):
        step()
        assert shown_beside_copies() in ([400, 400], [400])
        follow()
        assert shown_beside_copies() in ([400, 400], [400])
    assert placed_objects(our_modifier(active().result).node_group)[0] == bpy.data.objects["Rock"]


def leads_to_nothing_that_is_gone():
    """Whether all objects and meshes to which the scene leads are there; asked by their addresses, which freed ones still have."""
    there = {item.as_pointer() for item in bpy.data.objects}
    meshes = {mesh.as_pointer() for mesh in bpy.data.meshes}
    linked = [item.as_pointer() for item in bpy.context.scene.collection.objects]
    result = active().result
    if not there.issuperset(linked) or (result is not None and result.as_pointer() not in there):
        return False
    return all(item.data.as_pointer() in meshes for item in bpy.data.objects if item.type == "MESH")


def raise_ground(ground, height):
    """Change nothing but the mesh."""
    for vertex in ground.data.vertices:
        vertex.co.z = height
    ground.data.update()


def test_a_result_made_after_a_step_in_which_only_the_mesh_changed_is_undone_and_redone(scatter, follow):
    """The scene is the same in both steps: undo keeps it as it is, with a result of which no step knows."""
    ground, undo, redo = scatter.target, bpy.ops.ed.undo, bpy.ops.ed.redo
    ground.select_set(True)
    scatter.live = True
    for height in (0.0, 0.0, 0.0, 1.0):
        raise_ground(ground, height)
        bpy.ops.ed.undo_push(message="changed")
    follow()
    assert len(points()) == 400
    active().result.select_set(True)
    height = 1
    for number in range(8):
        height = 1 - height
        (redo if height else undo)()
        assert leads_to_nothing_that_is_gone()
        if number % 3:
            follow()
            assert active().live and leads_to_nothing_that_is_gone()
            assert len(points()) == 400 and {place[2] for place in points().values()} == {float(height)}
            assert len([item for item in bpy.context.scene.objects if item.name.startswith("Ground Scatter")]) == 1


def test_a_result_that_undo_steps_know_stays_as_it_was_shown(scatter, follow):
    """It is taken out of the scene for the undo, and put again: the scene is the same in both steps."""
    scatter.live = True
    follow()
    result = active().result
    bpy.context.view_layer.objects.active = result
    result.select_set(True)
    for height in (0.0, 1.0, 2.0):
        raise_ground(bpy.data.objects["Ground"], height)
        bpy.ops.ed.undo_push(message="changed")
    before, uid = points(), result.session_uid
    bpy.ops.ed.undo()
    result = active().result
    assert result.session_uid == uid and bpy.context.view_layer.objects.active == result and result.select_get()
    assert moved(before, points()).max() == 0.0 and active().report_json
    follow()
    assert active().live and active().result == result and {place[2] for place in points().values()} == {1.0}


def test_another_file_ends_it(scatter, tmp_path, follow):
    switch_on(scatter, follow)
    scatter.classes["Pine"].sizes[0].count = 260
    live._tick()
    worker = next(iter(live._followed.values()))._worker
    bpy.data.images["mask.png"].pack()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "live.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    assert not live._followed
    worker.join(60)
    assert not worker._thread.is_alive()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "live.blend"))
    assert active().live
    live.wake()
    follow()
    assert len(points("Pine")) == 260 and not active().outdated


def test_nothing_listens_while_nothing_is_live(scatter, follow):
    def listening():
        return [hook for handlers, hook in live._hooks() if hook in handlers]

    assert not listening()
    switch_on(scatter, follow)
    assert len(listening()) == 6
    scatter.live = False
    follow()
    assert not listening() and not live._followed


def test_a_setting_changed_in_the_sidebar_is_looked_at_with_the_next_tick(scatter, follow, monkeypatch):
    """Blender tags the scene for it, which a script that sets a property has to do itself."""
    switch_on(scatter, follow)
    (followed,) = live._followed.values()
    looked = []
    monkeypatch.setattr(followed, "_submit", lambda *_: looked.append(time.monotonic()))
    monkeypatch.setattr(followed_scatter, "AT_REST", 1e6)
    # What the result has changed is told before.
    bpy.context.view_layer.update()
    monkeypatch.setattr(live, "_last_sign", 0.0)
    scatter.classes["Pine"].sizes[0].count = 150
    live._tick()
    assert not looked, "nothing has said so"
    bpy.context.scene.update_tag()
    bpy.context.view_layer.update()
    live._tick()
    assert len(looked) == 1


def test_looking_is_no_sign_of_a_change(scatter, follow):
    """Otherwise it would go on looking with every tick."""
    switch_on(scatter, follow)
    scatter.classes["Pine"].sizes[0].count = 150
    follow()
    bpy.context.view_layer.update()
    sign = live._last_sign
    for _ in range(5):
        time.sleep(followed_scatter.AT_REST)
        live._tick()
        bpy.context.view_layer.update()
    assert live._last_sign == sign


def test_a_run_by_hand_is_where_it_goes_on_from(scatter, follow):
    switch_on(scatter, follow)
    scatter.seed = 3
    bpy.ops.esh.scatter()
    live.reset(bpy.context.scene, scatter)
    by_hand = points()
    follow()
    assert moved(by_hand, points()).max() == 0.0
    scatter.classes["Pine"].sizes[0].count = 205
    follow()
    assert np.median(moved(by_hand, points())) < 0.5 and len(points("Pine")) == 205


def test_what_another_scatter_has_on_a_wall_is_followed(scatter, follow):
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    wall = bpy.context.object
    wall.scale = (0.02, 6.0, 6.0)
    bpy.ops.mesh.primitive_plane_add(size=0.4, location=(60, 0, 0))
    tile = bpy.context.object
    bpy.context.view_layer.update()
    scatters = bpy.context.scene.esh_scatter
    made = []
    for number in range(2):
        one = scatters.add_scatter(wall)
        one.surface, one.device, one.max_steps = "WHOLE", "CPU", 40
        size = one.add_class().sizes[0]
        size.source_object, size.count = tile, 60
        bpy.ops.esh.scatter_choose(index=1 + number)
        if number == 0:
            bpy.ops.esh.scatter()
        made.append(one)

    def nearest():
        one, other = (np.array([v.co for v in m.result.data.vertices]) for m in made)
        away = np.linalg.norm(one[:, None] - other, axis=2)
        return away[(one[:, None] * other)[:, :, 0] > 0.0].min()

    before = switch_on(made[1], follow)
    assert nearest() > 0.399
    for vertex in made[0].result.data.vertices:
        vertex.co.y += 0.2
    made[0].result.data.update()
    follow()
    after = points()
    # Some that it came upon are gone, and others have come instead.
    assert len(after) == 60 and len(before.keys() & after.keys()) > 45
    assert nearest() > 0.399
    assert (moved(before, after) > 0.02).any()


def test_a_mask_that_came_while_it_was_off_is_followed_as_a_run_would(scatter, follow):
    """Nearly all of a class stands where nothing of it is to be any more."""
    bpy.ops.esh.scatter()
    image = bpy.data.images["mask.png"]
    pixels = np.zeros((64, 64, 4), np.float32)
    pixels[22:42, 7:57] = 1.0
    image.pixels.foreach_set(pixels.ravel())
    scatter.live = True
    follow()
    report = active().report
    assert report["overlaps"] == 0 and report["coverage_error"] < 0.05
    assert max(c["coverage_error"] for c in report["classes"]) < 0.1


def test_the_solver_rests_while_blenders_data_are_read_and_not_for_long_where_nobody_comes_back():
    from esh.esh_scatter.classes.survey import Survey
    from esh.esh_scatter.solving.live_worker import LONGEST_REST, LiveWorker

    worker, asked = LiveWorker(Survey()), []

    def work():
        while not worker._ended:
            worker._go_on()
            asked.append(time.monotonic())
            time.sleep(0.001)

    assert worker.rests(), "with nothing to do"
    worker.go_on()
    worker._busy = True
    thread = threading.Thread(target=work)
    thread.start()
    try:
        while not worker.rests():
            time.sleep(0.001)
        before = len(asked)
        time.sleep(2.0 * LONGEST_REST)
        assert len(asked) == before
        worker.go_on()
        while len(asked) < before + 10:
            time.sleep(0.001)
        # Asked to rest by somebody who does not come back.
        worker.rests()
        until = time.monotonic() + LONGEST_REST + 1.0
        before = len(asked)
        while len(asked) < before + 100:
            assert time.monotonic() < until
            time.sleep(0.001)
    finally:
        worker.end()
        thread.join()
        worker.join(5.0)
