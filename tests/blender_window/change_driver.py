"""Runs inside a windowed Blender: what changes is followed, what is shown is chosen, questions are answered, a kept run is undone.

What happens is done with the mouse and the keyboard only, beside the scene at the start; what came of it is read. The third argument
says which of the walks is taken.
"""

import math

import bpy
import numpy as np
import window_hand as hand
import window_steps as steps
from mathutils import Vector
from window_scene import (
    LONGEST_RUN,
    LONGEST_UPDATE,
    ask_for,
    at_rest,
    begin,
    fill_in,
    idle,
    instances,
    live,
    on_screen,
    positions,
    scatter,
    update,
    values,
)
from window_steps import answer, take_screenshot

# How high the ground rises in its middle, and in which frame it has [m].
HILL, LAST_FRAME = 3.0, 20
# The camera stands so high over this place, and sees as far to each side [m].
CAMERA, HEIGHT = (-5.0, 0.0), 5.0
ROCK_TO = (5.0, 5.0)
# Nearer than that a beech and a pine lie on one another [m].
TOUCHING = 0.75


def set_stage():
    """The ground rises while frames pass, and a camera looks down on a quarter of it."""
    fill_in()
    ground, scene = bpy.data.objects["Ground"], bpy.context.scene
    ground.shape_key_add(name="Basis")
    hill = ground.shape_key_add(name="Hill")
    for vertex, point in zip(ground.data.vertices, hill.data, strict=True):
        x, y, _ = vertex.co
        point.co.z = HILL * (1.0 - x * x) * (1.0 - y * y)
    for frame, value in ((1, 0.0), (LAST_FRAME, 1.0)):
        hill.value = value
        hill.keyframe_insert("value", frame=frame)
    scene.frame_end = LAST_FRAME
    scene.frame_set(1)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.data.angle = (*CAMERA, HEIGHT), math.pi / 2
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x = scene.render.resolution_y = 1000
    with steps.window_context():
        bpy.ops.ed.undo_push(message="Set the stage")


def shown():
    """Names and places of all instances."""
    names, places = [], []
    for one in bpy.context.evaluated_depsgraph_get().object_instances:
        if one.is_instance:
            names.append(one.object.original.name)
            places.append(tuple(one.matrix_world.translation))
    return np.array(names), np.array(places).reshape(-1, 3)


def bent():
    """The last frame is gone to: the ground has risen there, and what stands on it with it; then back to the first."""
    names, flat = shown()
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.keys("shift+Right")
    yield from hand.until(lambda: bpy.context.scene.frame_current == LAST_FRAME, 5.0, "the last frame")
    yield 0.5
    _, risen = shown()
    ground = bpy.data.objects["Ground"].evaluated_get(bpy.context.evaluated_depsgraph_get())
    back = ground.matrix_world.inverted()
    under = [ground.ray_cast(back @ Vector((x, y, 2.0 * HILL)), (0.0, 0.0, -1.0)) for x, y, _ in flat]
    rise = np.array([(ground.matrix_world @ place).z if hit else np.nan for hit, place, _, _ in under])
    upright = names != "Log"
    away = np.linalg.norm(risen - flat - np.stack([0.0 * rise, 0.0 * rise, rise], axis=1), axis=1)
    answer["highest"], answer["missed"] = float(np.nanmax(rise)), int(np.isnan(rise).sum())
    # Long ones lean with the ground, about what of them stands on it.
    answer["off_ground"] = float(np.nanmax(away[upright])), float(np.nanmax(away[~upright]))
    answer["bent_changes"] = scatter().changes()
    _look_from_the_side(True)
    yield 1.0
    take_screenshot("change-1-bent.png")
    _look_from_the_side(False)
    yield from hand.keys("shift+Left")
    yield from hand.until(lambda: bpy.context.scene.frame_current == 1, 5.0, "the first frame")
    yield 0.5
    answer["flat_again"] = float(np.abs(shown()[1] - flat).max()), scatter().changes()


def _look_from_the_side(turned):
    with steps.window_context():
        bpy.ops.view3d.view_axis(type="FRONT" if turned else "TOP")


def displayed():
    """Bounds, then points, then objects again are chosen; then what the camera does not see is left out."""
    top = yield from hand.turn_panel("ESH_PT_display")
    everything, inputs = instances(), _inputs()
    answer["display"] = {}
    for key in ("b", "p", "o"):
        yield from hand.press(inputs["Display"], across=0.7, first=top)
        yield from hand.keys(key)
        yield 0.5
        answer["display"][key] = _drawn()
        take_screenshot(f"change-2-{key}.png")
    yield from hand.press(inputs["Culling"], across=0.7, first=top)
    yield 0.5
    yield from hand.enter(inputs["Margin"], "0", across=0.7, first=top)
    yield 0.5
    answer["culled"] = *(int(_in_view(place).sum()) for place in (shown()[1], positions())), instances(), everything
    take_screenshot("change-3-culled.png")
    yield from hand.press(inputs["Culling"], across=0.7, first=top)
    yield 0.5
    answer["whole_again"] = instances() == everything, scatter().changes()
    yield from hand.turn_panel("ESH_PT_display", is_open=False, first=top - 40)


def _in_view(place):
    """Which of some places the camera sees."""
    return (np.abs(place[:, :2] - CAMERA) <= (HEIGHT - place[:, 2])[:, None]).all(axis=1)


def _inputs():
    module = steps.ours("result.display")
    return dict(module._inputs(module.our_modifier(scatter().result)))


def _drawn():
    """How many instances there are, the most corners that one has, and how many points."""
    corners, points, number = 0, 0, 0
    for one in bpy.context.evaluated_depsgraph_get().object_instances:
        if one.is_instance and one.object.type == "POINTCLOUD":
            points += len(one.object.data.points)
        elif one.is_instance:
            number += 1
            corners = max(corners, len(one.object.data.vertices))
    return number, corners, points


def on_rock(place=None):
    """How many stand where the rock is, or would be at a place."""
    place = bpy.data.objects["Rock"].location[:2] if place is None else place
    return int((np.abs(positions()[:, :2] - place) < 2.0).all(axis=1).sum())


def is_moving():
    window = bpy.context.window_manager.windows[0]
    return any("TRANSFORM" in one.bl_idname for one in window.modal_operators)


def lives():
    """The rock becomes an obstacle, and Live is switched on."""
    yield from hand.click(on_screen((0.0, 0.0, 2.0)))
    top = yield from hand.turn_panel("ESH_PT_obstacles")
    yield from hand.press("esh.obstacle_add", first=top)
    yield from hand.turn_panel("ESH_PT_obstacles", is_open=False, first=top - 40)
    yield from hand.press("].live", across=0.75)
    yield from hand.until(at_rest, LONGEST_UPDATE, "Live to follow")
    answer["live"] = scatter().live, on_rock(), len(positions())


def obstacle_moved():
    """The rock is moved with G: what is in its way makes room while the mouse still holds it; undone, and redone."""
    rock = bpy.data.objects["Rock"]
    yield from hand.move(on_screen((0.0, 0.0, 2.0)))
    yield from hand.keys("g")
    for share in np.linspace(0.2, 1.0, 5):
        yield from hand.move(on_screen((share * ROCK_TO[0], share * ROCK_TO[1], 2.0)))
    answer["moving"] = is_moving()
    far = on_rock(ROCK_TO)
    yield from hand.until(lambda: rock.location.x > 4.0 and on_rock() == 0, LONGEST_UPDATE, "following the rock")
    answer["while_moved"] = is_moving(), len(positions()), far
    take_screenshot("change-4-moved.png")
    yield from hand.click(on_screen((*ROCK_TO, 2.0)))
    yield from hand.until(lambda: not is_moving() and at_rest(), LONGEST_UPDATE, "Live to rest")
    answer["moved"] = list(rock.location[:2]), on_rock(), on_rock((0.0, 0.0)), len(positions())
    answer["moved_report"] = scatter().report["overlaps"], scatter().changes(), live().message
    yield from hand.keys("ctrl+z")
    yield from hand.until(
        lambda: not any(_rock()[:2]) and at_rest() and on_rock() == 0, LONGEST_UPDATE, "following to undo"
    )
    answer["move_undone"] = on_rock(ROCK_TO), len(positions())
    yield from hand.keys("ctrl+shift+z")
    yield from hand.until(
        lambda: _rock()[0] > 4.0 and at_rest() and on_rock() == 0, LONGEST_UPDATE, "following to redo"
    )
    answer["move_redone"] = on_rock((0.0, 0.0)), len(positions())
    take_screenshot("change-5-redone.png")


def _rock():
    # Undo makes objects anew.
    return bpy.data.objects["Rock"].location


def count_dragged():
    """The count of a class is dragged with the mouse: objects come while it is held down; undone."""
    top = yield from hand.turn_panel("ESH_PT_class")
    x, y = yield from hand.find("sizes[0].count", first=top)
    before = scatter().active_class.count
    others = len(positions()) - before

    def followed():
        return scatter().active_class.count > before and len(positions()) == others + scatter().active_class.count

    with hand.held((x, y)):
        for _ in range(6):
            yield from hand.nudge(4, 0)
        yield from hand.until(followed, LONGEST_UPDATE, "following the count")
        answer["while_dragged"] = len(positions()) - others, scatter().active_class.count
        take_screenshot("change-6-dragged.png")
    yield from hand.until(lambda: at_rest() and followed(), LONGEST_UPDATE, "Live to rest")
    answer["dragged"] = scatter().report["overlaps"], scatter().changes(), on_rock()
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.keys("ctrl+z")
    yield from hand.until(
        lambda: at_rest() and len(positions()) == others + before, LONGEST_UPDATE, "following to undo"
    )
    answer["drag_undone"] = scatter().active_class.count == before
    yield from hand.turn_panel("ESH_PT_class", is_open=False, first=top - 40)


def instance_moved():
    """A tree is moved in Edit Mode: those beside it make room while that lasts; undone, redone, and done."""
    top = yield from hand.turn_panel("ESH_PT_instances")
    ids, where = values("id"), positions()
    yield from hand.press("esh.instances_edit", first=top)
    # Away from the rock, and from the border.
    chosen = int(np.argmin(np.linalg.norm(where[:, :2] - (-6.0, 6.0), axis=1)))
    yield from hand.click(on_screen(where[chosen]))
    yield from hand.keys("g", "x")
    yield from hand.write("0.7")
    yield from hand.keys("Return")
    yield from _followed_in_edit_mode(lambda moved: moved > 1, "following the tree")
    answer["in_edit_mode"] = scatter().result.mode, live().message, instances()
    take_screenshot("change-7-made-room.png")
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.keys("ctrl+z")
    yield 0.5
    answer["edit_undone"] = scatter().result.mode
    yield from _followed_in_edit_mode(lambda _: True, "following to undo")
    yield from hand.keys("ctrl+shift+z")
    yield from _followed_in_edit_mode(lambda _: True, "following to redo")
    answer["edit_redone"] = scatter().result.mode
    take_screenshot("change-8-redone.png")
    yield from hand.press("esh.instances_edit", first=top)
    yield from hand.until(at_rest, LONGEST_UPDATE, "Live to rest")
    there = positions()[values("id") == ids[chosen]][0] - where[chosen]
    answer["tree"] = there.tolist(), len(positions()), scatter().report["overlaps"], scatter().changes()
    take_screenshot("change-9-done.png")
    yield from hand.turn_panel("ESH_PT_instances", is_open=False, first=top - 40)


def _followed_in_edit_mode(holds, what):
    """Wait until Live has shown what it makes of moved points, and so many instances stand elsewhere."""
    _, before = shown()

    def followed():
        follower, (_, now) = live(), shown()
        moved = int((np.linalg.norm(now - before, axis=1) > 0.01).sum()) if len(now) == len(before) else 0
        return follower is not None and not follower.busy and follower._edited is not None and holds(moved)

    yield 0.7
    yield from hand.until(followed, LONGEST_UPDATE, what)
    yield 0.5


def may_overlap():
    """The checkbox is clicked that lets beeches and pines overlap; undone and redone; then they do."""
    top = yield from hand.turn_panel("ESH_PT_class")
    # Its buttons that open menus have no commands: they would be taken for headers.
    top = yield from hand.turn_panel("ESH_PT_density", is_open=False, first=top + 20)
    top = yield from hand.turn_panel("ESH_PT_overlap", first=top)
    answer["on_one_another"] = [_on_one_another()]
    yield from hand.press('class_overlap(other="Pine")', across=0.25, first=top)
    found = [scatter().non_overlap(), scatter().changes()]
    take_screenshot("change-10-overlap.png")
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.keys("ctrl+z")
    yield 0.5
    found.append(scatter().non_overlap())
    yield from hand.keys("ctrl+shift+z")
    yield 0.5
    answer["may_overlap"] = [*found, scatter().non_overlap() == found[0]]
    yield from hand.turn_panel("ESH_PT_class", is_open=False)
    yield from update()
    answer["on_one_another"].append(_on_one_another())
    answer["overlap_report"] = scatter().report["overlaps"], scatter().changes(), len(positions())
    take_screenshot("change-11-overlapping.png")


def _on_one_another():
    """How many pairs of a beech and a pine lie on one another."""
    kind, place = values("class_index"), positions()[:, :2]
    names = [one.name for one in scatter().classes]
    beech, pine = (place[kind == names.index(name)] for name in ("Beech", "Pine"))
    return int((np.linalg.norm(beech[:, None] - pine[None], axis=-1) < TOUCHING).sum())


def kept():
    """A long run is ended with Keep; Ctrl+Z brings back what was there before it, Ctrl+Shift+Z what was kept."""
    yield from ask_for("4000")
    before, report = positions(), scatter().report_json
    _, y = yield from hand.press("esh.scatter(")
    yield from hand.until(lambda: not idle(), 5.0, "the start of the run")
    window, _, region = hand.sidebar()
    yield from hand.press("esh.keep", across=0.3, first=y - (window.height - region.y - region.height))
    take_screenshot("change-12-keep.png")
    yield from hand.until(idle, 10.0, "keeping")
    yield 1.0
    there = positions()
    answer["kept"] = len(before), len(there), scatter().report["steps"], scatter().max_steps, scatter().changes()
    take_screenshot("change-13-kept.png")
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.keys("ctrl+z")
    yield 1.0
    same = len(positions()) == len(before) and bool((positions() == before).all())
    answer["keep_undone"] = same, scatter().report_json == report, instances(), scatter().changes()
    take_screenshot("change-14-undone.png")
    yield from hand.keys("ctrl+shift+z")
    yield 1.0
    same = len(positions()) == len(there) and bool((positions() == there).all())
    answer["keep_redone"] = same, scatter().report_json != report, instances(), scatter().changes()
    yield from hand.keys("ctrl+z", "ctrl+z")
    yield 1.0
    answer["count_undone"] = scatter().classes[0].count, scatter().changes()


def asked_before_many():
    """From a number on, Update asks: a click beside the question leaves all as it is, the key of the button does not."""
    top = yield from hand.turn_panel("ESH_PT_display")
    yield from hand.enter("].cap", "100", across=0.7, first=top)
    yield from hand.turn_panel("ESH_PT_display", is_open=False, first=top - 40)
    report = scatter().report_json
    yield from hand.press("esh.scatter(")
    yield 0.5
    take_screenshot("change-22-many.png")
    yield from hand.click(on_screen((-13.0, -9.0, 0.0)))
    yield 1.0
    answer["refused_many"] = scatter().cap, idle(), scatter().report_json == report
    yield from hand.press("esh.scatter(")
    yield 0.5
    yield from hand.keys("s")
    yield from hand.until(lambda: idle() and scatter().report_json != report, LONGEST_RUN, "the run")
    yield 1.0
    answer["many"] = len(positions()), scatter().changes()
    take_screenshot("change-23-placed.png")
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.keys("ctrl+z", "ctrl+z")
    yield 1.0
    answer["many_undone"] = scatter().cap, scatter().report_json == report


def moved_by_hand():
    """A log is moved by hand, and then its class is left out."""
    top = yield from hand.turn_panel("ESH_PT_instances")
    ids, where, logs = values("id"), positions(), values("class_index") == 1
    yield from hand.press("esh.instances_edit", first=top)
    number = np.flatnonzero(logs)[np.argmin(np.linalg.norm(where[logs][:, :2] - (-7.0, 7.0), axis=1))]
    yield from hand.click(on_screen(where[number]))
    yield from hand.keys("g", "x")
    yield from hand.write("0.5")
    yield from hand.keys("Return")
    yield from hand.press("esh.instances_edit", first=top)
    yield from hand.turn_panel("ESH_PT_instances", is_open=False, first=top - 40)
    top = yield from hand.turn_panel("ESH_PT_classes")
    yield from hand.press("classes[1].mute", across=0.54, first=top)
    answer["log"] = int(ids[number]), positions()[values("id") == ids[number]][0].tolist()
    answer["asked_about"] = scatter().lost_by_hand(bpy.context.scene)
    yield from hand.turn_panel("ESH_PT_classes", is_open=False, first=top - 40)


def asked_before_it_is_lost():
    """Update asks before it is lost: Esc leaves all as it is, a click on the button does not; undone."""
    before, report = positions(), scatter().report_json
    yield from hand.press("esh.scatter(")
    yield 0.5
    take_screenshot("change-20-asked.png")
    yield from hand.keys("Escape")
    yield 1.0
    answer["refused"] = idle(), scatter().report_json == report, bool((positions() == before).all())
    # The question opens with its button below the mouse.
    place = yield from hand.press("esh.scatter(")
    yield 0.5
    yield from hand.click(place)
    yield from hand.until(lambda: idle() and scatter().report_json != report, LONGEST_RUN, "the run")
    yield 1.0
    answer["lost"] = sorted(set(values("class_index").tolist())), len(positions()), scatter().changes()
    take_screenshot("change-21-lost.png")
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.keys("ctrl+z")
    yield 1.0
    number, place = answer["log"]
    answer["back"] = float(np.linalg.norm(positions()[values("id") == number][0] - place))


WALKS = {
    "following": (begin, bent, displayed, lives, obstacle_moved, count_dragged, instance_moved),
    "answering": (begin, may_overlap, kept, asked_before_many, moved_by_hand, asked_before_it_is_lost),
}
hand.take(WALKS[steps.ARGUMENTS[0]], set_stage if steps.ARGUMENTS[0] == "following" else fill_in)
