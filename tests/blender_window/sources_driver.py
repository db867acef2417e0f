"""Runs inside a windowed Blender: the example, classes of collections, how they stand, on which faces, and off a collection's objects.

What happens is done with the mouse and the keyboard only, beside the scene at the start; what came of it is read.
"""

import bpy
import numpy as np
import window_hand as hand
import window_steps as steps
from window_scene import (
    LONGEST_RUN,
    LONGEST_UPDATE,
    begin,
    fill_in,
    idle,
    instances,
    on_screen,
    positions,
    scatter,
    update,
)
from window_steps import answer, take_screenshot

# Where the crosses that clear fields are, as a share of the sidebar's width.
CLEAR = 0.816
# How large the stones of a collection are [m], and where the tree's parts are from its foot [m].
STONES = {"Boulder": 0.5, "Chip": 0.3, "Slab": 0.4}
TRUNK_UP, LEAVES_UP = 0.2, 0.8
# Where huts stand, and half their width [m].
HUTS, HUT = ((-6.0, 5.0), (-4.0, -5.0)), 1.0


def empty():
    """Nothing is in the file but a camera that nobody looks through."""
    with steps.window_context():
        steps.show_tab()
        steps.remove_objects()
        bpy.ops.ed.undo_push(message="Emptied")
    hand.watch_panels()


def example():
    """The first look: the example is added, undone, and redone."""
    take_screenshot("sources-1-nothing.png")
    yield from hand.press("esh.example")
    yield from hand.until(lambda: scatter() and scatter().report_json and idle(), LONGEST_RUN, "the example")
    yield 1.0
    asked = sum(one.count for one in scatter().classes)
    answer["example"] = asked, instances(), scatter().report["overlaps"], scatter().target.name
    take_screenshot("sources-2-example.png")
    yield from hand.move(steps.on_screen(300, 60))
    yield from hand.keys("ctrl+z")
    yield 1.0
    answer["example_undone"] = len(bpy.context.scene.esh_scatter.scatters), len(bpy.context.scene.objects)
    take_screenshot("sources-3-undone.png")
    yield from hand.keys("ctrl+shift+z")
    yield 1.0
    answer["example_redone"] = instances() == asked, scatter().changes()


def staged():
    """Another file: collections of stones, of a tree's parts and of huts, and ground that is half of sand, with a vertex group."""
    scene = bpy.context.scene
    while scene.esh_scatter.scatters:
        scene.esh_scatter.scatters.remove(0)
    fill_in()
    bpy.data.objects["Rock"].hide_set(True)
    _collection("Stones", [(name, "Pebble", (13.0, 0.0, 0.0), size) for name, size in STONES.items()])
    parts = [("Trunk", "Log", (13.0, 5.0, TRUNK_UP), 0.2), ("Leaves", "Beech", (13.0, 5.0, LEAVES_UP), 0.5)]
    _collection("Oak", parts).instance_offset = 13.0, 5.0, 0.0
    _collection("Huts", [(f"Hut {number}", "Rock", (*place, HUT), HUT) for number, place in enumerate(HUTS)])
    ground = bpy.data.objects["Ground"].data
    sand = bpy.data.materials.new("Sand")
    sand.diffuse_color = 0.75, 0.62, 0.38, 1.0
    ground.materials.append(sand)
    for face in ground.polygons:
        face.material_index = int(face.center.x > 0.0)
    # Materials are not chosen by hand: for their pictures, Blender compiles shaders, which takes a minute where software draws.
    right = [corner.index for corner in ground.vertices if corner.co.x > -1e-6]
    bpy.data.objects["Ground"].vertex_groups.new(name="Sand").add(right, 1.0, "REPLACE")
    with steps.window_context():
        bpy.ops.ed.undo_push(message="Set the stage")
    yield 1.0


def _collection(name, items):
    made = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(made)
    for item, shape, place, size in items:
        copy = bpy.data.objects.new(item, bpy.data.objects[shape].data)
        copy.location, copy.scale = place, (size, size, size)
        made.objects.link(copy)
    return made


def _shown():
    """Places, turns and scales of all instances, by the names of what is placed."""
    found = {}
    for one in bpy.context.evaluated_depsgraph_get().object_instances:
        if one.is_instance:
            found.setdefault(one.object.original.name, []).append(one.matrix_world.decompose())
    return found


def _numbers():
    return {name: len(found) for name, found in _shown().items()}


def variants():
    """Beeches become stones of a collection: each point gets one of them, and boulders come more often than others."""
    top = yield from hand.turn_panel("ESH_PT_class")
    yield from hand.press("].source_kind", first=top)
    take_screenshot("sources-4-kinds.png")
    yield from hand.keys("c")
    take_screenshot("sources-5-empty.png")
    yield from hand.choose("].source_collection", "Stones", first=top)
    yield 0.5
    take_screenshot("sources-6-variants.png")
    size = scatter().active_class.active_size
    listed = [(one.item.name, one.weight) for one in size.variants]
    answer["variants"] = scatter().active_class.name, listed, scatter().changes()
    yield from update()
    answer["equal"] = _numbers()
    yield from hand.enter("variants[0].weight", "6", first=top)
    answer["weighted"] = [round(one.weight, 3) for one in size.variants]
    yield from hand.enter("variants[2].weight", "0", first=top)
    yield from update()
    answer["unequal"] = _numbers(), scatter().report["overlaps"], scatter().changes()
    take_screenshot("sources-7-weighted.png")


def as_one():
    """Then it places a tree of two parts, which stay together."""
    top = yield from hand.turn_panel("ESH_PT_class")
    yield from hand.press("].source_kind", first=top)
    yield from hand.keys("a")
    yield from hand.choose("].source_collection", "Oak", first=top)
    yield 0.5
    take_screenshot("sources-8-oak.png")
    yield from update()
    there = _shown()
    trunks, leaves = ([place for place, _, _ in there.get(name, [])] for name in ("Trunk", "Leaves"))
    apart = [min(((a - b).length for a in trunks), default=-1.0) for b in leaves]
    answer["oaks"] = scatter().active_class.name, scatter().active_class.count, len(trunks), len(leaves)
    answer["parts_apart"] = min(apart, default=-1.0), max(apart, default=-1.0)
    answer["oak_report"] = scatter().report["overlaps"], scatter().changes()
    take_screenshot("sources-9-oaks.png")


def standing():
    """Scale is dragged, the rotation typed: both show while nothing runs; undone."""
    top = yield from hand.turn_panel("ESH_PT_class")
    yield from hand.turn_panel("ESH_PT_density", is_open=False, first=top + 20)
    top = yield from hand.turn_panel("ESH_PT_standing", first=top)
    take_screenshot("sources-10-standing.png")
    place = positions()
    x, y = yield from hand.find("].scale", across=0.7, first=top)
    before = _shown()["Trunk"][0][2].x
    with hand.held((x, y)):
        for _ in range(4):
            yield from hand.nudge(5, 0)
        yield 0.5
        answer["dragged"] = _shown()["Trunk"][0][2].x / before, scatter().active_class.scale, idle()
        take_screenshot("sources-11-dragged.png")
    yield 0.5
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.keys("ctrl+z")
    yield 0.5
    answer["drag_undone"] = _shown()["Trunk"][0][2].x / before, round(scatter().active_class.scale, 3)
    yield from hand.enter("].random_turn", "0", across=0.7, first=top)
    yield from hand.enter("].offset", "0.5", across=0.7, first=top)
    yield 0.5
    turns = [turn for _, turn, _ in _shown()["Trunk"]]
    answer["turned"] = max(turn.rotation_difference(turns[0]).angle for turn in turns), scatter().changes()
    answer["stayed"] = bool((positions()[:, :2] == place[:, :2]).all())
    answer["raised"] = float(min(place.z for place, _, _ in _shown()["Trunk"]))
    take_screenshot("sources-12-turned.png")
    yield from hand.turn_panel("ESH_PT_class", is_open=False)


def surface():
    """Only sand is scattered on, by its vertex group, as a whole surface; then all of the ground from above again."""
    top = yield from hand.turn_panel("ESH_PT_surface")
    take_screenshot("sources-13-surface.png")
    yield from hand.choose("].face_group", "Sand", across=0.7, first=top)
    answer["faces"] = scatter().face_group, scatter().changes()
    yield from hand.press("].surface", across=0.7, first=top)
    yield 0.5
    take_screenshot("sources-14-kinds.png")
    yield from hand.keys("w")
    yield from hand.until(lambda: scatter().surface == "WHOLE", LONGEST_UPDATE, "choosing the whole surface")
    yield from update()
    answer["on_sand"] = float(positions()[:, 0].min()), len(positions()), scatter().report["overlaps"]
    take_screenshot("sources-15-sand.png")
    yield from hand.press("].surface", across=0.7, first=top)
    yield 0.5
    yield from hand.keys("f")
    yield from hand.press("].face_group", across=CLEAR, first=top)
    answer["all_faces"] = scatter().face_group, scatter().surface
    yield from hand.turn_panel("ESH_PT_surface", is_open=False)


def off_huts():
    """A collection becomes an obstacle, with a margin; one of it is moved, and is kept off where it is then."""
    yield from hand.click(on_screen((-13.0, -9.0, 0.0)))
    top = yield from hand.turn_panel("ESH_PT_obstacles")
    yield from hand.press("esh.obstacle_add", first=top)
    yield from hand.press("].kind", first=top)
    yield 0.3
    yield from hand.keys("c")
    yield from hand.choose("].collection", "Huts", first=top)
    yield from hand.enter("].margin", "0.5", first=top)
    one = scatter().obstacles[0]
    answer["huts"] = one.kind, one.collection.name, round(one.margin, 3), scatter().changes()
    take_screenshot("sources-16-huts.png")
    yield from update()
    answer["off_huts"] = [_from_hut(place) for place in HUTS]
    take_screenshot("sources-17-off.png")


def _from_hut(place):
    """How far the nearest one is from the walls of a hut [m]; negative within."""
    away = np.abs(positions()[:, :2] - place) - HUT
    return float(away.max(axis=1).min())


WALKS = (example, staged, begin, variants, as_one, standing, surface, off_huts)
hand.take(WALKS, empty)
