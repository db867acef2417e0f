"""Live: strokes of a brush and drags of objects are followed in parts, and end as if they had been followed at once."""

import time
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from esh.esh_scatter.solving import followed_scatter, live, strokes  # noqa: E402

with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(Path(__file__).parent)
    from live_scene import active, moved, new_scatter, paint, points, switch_on


@pytest.fixture
def scatter(live_file):
    return new_scatter()


@pytest.fixture
def under_way(monkeypatch):
    """Have it look as if an operator was under way, by its name; None ends it."""

    def begin(operator):
        monkeypatch.setattr(strokes, "operator_among", lambda names: operator if operator in names else None)

    return begin


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
    for columns, border in ((16, -10.6), (32, -0.6)):
        paint(0.0, columns)
        follow()
        assert min(place[0] for place in points("Pine").values()) > border, "the brush is still down"


def test_a_stroke_that_was_followed_in_parts_ends_as_if_it_had_been_followed_at_once(scatter, under_way, follow):
    """Each part stirs what is far from it a little, as new objects come down everywhere; all of them together must not."""
    scatter.classes["Pine"].sizes[0].count = scatter.classes["Beech"].sizes[0].count = 1000
    switch_on(scatter, follow)

    def stirred():
        """Of beeches far from the stroke, by half a spacing of all 2,000."""
        return np.mean(moved({n: p for n, p in before.items() if p[0] > 0.0}, points("Beech")) > 0.45)

    before = points("Beech")
    under_way("PAINT_OT_image_paint")
    for columns in range(1, 17):
        paint(0.0, columns)
        follow()
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
