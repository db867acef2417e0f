"""Runs inside a windowed Blender: classes are gathered from what there is, turned at once, and led around a path on sculpted ground.

What happens is done with the mouse and the keyboard only, beside the scene at the start; what came of it is read.
"""

import math

import bpy
import numpy as np
import window_hand as hand
import window_steps as steps
from mathutils import Vector
from window_scene import (
    LONGEST_UPDATE,
    SIDE,
    at_rest,
    begin,
    fill_in,
    idle,
    on_screen,
    positions,
    scatter,
    update,
    values,
)
from window_steps import answer, take_screenshot

# From where to where the ground is sculpted [m], and how large the brush is [pixels].
FROM, TO, BRUSH = (-8.0, 6.0), (-2.0, 6.0), 60
# What beeches look at, and the line along which the path goes [m].
TOWER, PATH = (0.0, 9.0), -5.0


def set_stage():
    """A collection of two stones, an image of two colors, a path, a tower, and ground of many faces."""
    fill_in()
    scene = bpy.context.scene
    stones = bpy.data.collections.new("Stones")
    scene.collection.children.link(stones)
    for name, scale in (("Boulder", 0.5), ("Chip", 0.15)):
        item = bpy.data.objects.new(name, bpy.data.objects["Pebble"].data)
        item.location, item.scale = (13.0, 0.0, 0.0), (scale, scale, scale)
        stones.objects.link(item)
    image = bpy.data.images.new("Two Colors", 32, 32)
    # Undo takes what nothing uses.
    image.use_fake_user = True
    pixels = np.ones((32, 32, 4), np.float32)
    pixels[:, :16, :3], pixels[:, 16:, :3] = (0.9, 0.3, 0.3), (0.3, 0.5, 0.9)
    image.pixels.foreach_set(pixels.ravel())
    curve = bpy.data.curves.new("Path", "CURVE")
    line = curve.splines.new("POLY")
    line.points.add(1)
    for point, x in zip(line.points, (-SIDE / 2, SIDE / 2), strict=True):
        point.co = (x, PATH, 0.05, 1.0)
    for item in (bpy.data.objects.new("Path", curve), bpy.data.objects.new("Tower", None)):
        scene.collection.objects.link(item)
    bpy.data.objects["Tower"].location[:2] = TOWER
    bpy.data.objects["Rock"].hide_set(True)
    with steps.window_context():
        layer = bpy.context.view_layer
        layer.active_layer_collection = layer.layer_collection.children["Stones"]
        ground = bpy.data.objects["Ground"]
        ground.modifiers.new("Finer", "SUBSURF").subdivision_type = "SIMPLE"
        ground.modifiers["Finer"].levels = 2
        bpy.ops.object.modifier_apply(modifier="Finer")
        bpy.ops.ed.undo_push(message="Set the stage")


def asked():
    return {
        one.name: (one.count, *(size.source.name for size in one.sizes if size.source)) for one in scatter().classes
    }


def from_selection():
    """The pebble is clicked, and becomes a class."""
    yield from hand.click(on_screen((-12.0, 0.0, 0.0)))
    yield from hand.search("classes from sel")
    answer["from_selection"] = asked()


def confirmed(name, picture):
    """Open a dialog by its name, and take it as it is."""
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.search(name)
    yield 0.5
    take_screenshot(picture)
    yield from hand.keys("Return")
    yield 1.0


def from_collection():
    """The dialog asks for a collection, and names the selected one."""
    yield from confirmed("classes from col", "gather-1-collection.png")
    answer["from_collection"] = asked()
    yield from update()
    answer["gathered"] = np.bincount(values("class_index")).tolist(), scatter().report["overlaps"], scatter().changes()
    take_screenshot("gather-2-gathered.png")


def from_image():
    """The dialog asks for an image, and names the only one; undone."""
    before = asked()
    yield from confirmed("classes from im", "gather-3-image.png")
    answer["inks"] = sorted(asked().keys() - before.keys())
    yield from hand.keys("ctrl+z")
    yield 0.5
    answer["image_undone"] = asked() == before


def looked_at():
    """Beeches look at the tower at once: the switch is clicked, and the tower's name is typed into the search of its field."""
    scatter().class_index = next(i for i, one in enumerate(scatter().classes) if one.name == "Beech")
    where = positions()
    top = yield from hand.turn_panel("ESH_PT_class")
    top = yield from hand.turn_panel("ESH_PT_density", is_open=False, first=top + 20)
    top = yield from hand.turn_panel("ESH_PT_standing", first=top)
    yield from hand.press("].use_look_at", across=0.5, first=top)
    yield from hand.choose("].look_at_object", "Tower", first=top)
    yield 0.5
    shown = bpy.context.evaluated_depsgraph_get().object_instances
    own = [one.matrix_world.copy() for one in shown if one.is_instance and one.object.original.name == "Beech"]
    # Their fronts are along -Y.
    off = [Vector((*TOWER, 0.0)).xy - one.translation.xy for one in own]
    off = [way.angle_signed(-one.col[1].xy) for way, one in zip(off, own, strict=True)]
    answer["looks"] = len(own), float(np.abs(off).max()), scatter().changes()
    answer["stayed"] = bool((positions() == where).all())
    take_screenshot("gather-4-looks.png")


def copied():
    """How beeches stand is given to all others: only what cannot be shown at once is out of date then."""
    yield from confirmed("copy settings to cl", "gather-5-copy.png")
    answer["copied"] = [one.look_at_object.name for one in scatter().classes if one.use_look_at and one.look_at_object]
    yield from hand.keys("ctrl+z")
    yield 0.5
    answer["copy_undone"] = [one.name for one in scatter().classes if one.use_look_at], scatter().changes()
    yield from hand.turn_panel("ESH_PT_class", is_open=False)


def led_around():
    """The name of the path is typed into the field of a new obstacle, which then has a width."""
    yield from hand.click(on_screen((-13.0, -9.0, 0.0)))
    top = yield from hand.turn_panel("ESH_PT_obstacles")
    yield from hand.press("esh.obstacle_add", first=top)
    yield from hand.choose("].item", "Path", first=top)
    answer["width"] = scatter().obstacles[0].item.name, scatter().obstacles[0].width
    take_screenshot("gather-6-path.png")
    yield from hand.turn_panel("ESH_PT_obstacles", is_open=False, first=top - 40)
    yield from update()
    answer["beside_path"] = float(np.abs(positions()[:, 1] - PATH).min()), scatter().report["overlaps"]
    take_screenshot("gather-7-led-around.png")


def sculpted():
    """A stroke of Draw raises the ground under Live; objects stand on it once the brush is lifted."""
    yield from hand.press("].live", across=0.75)
    yield from hand.until(at_rest, LONGEST_UPDATE, "Live to follow")
    ground = bpy.data.objects["Ground"]
    with steps.window_context():
        for item in bpy.context.selected_objects:
            item.select_set(False)
        ground.select_set(True)
        bpy.context.view_layer.objects.active = ground
        bpy.ops.object.mode_set(mode="SCULPT")
        paint = bpy.context.tool_settings.sculpt
        for owner in (paint.brush, getattr(paint, "unified_paint_settings", bpy.context.tool_settings)):
            owner = getattr(owner, "unified_paint_settings", owner)
            for name, value in (("size", BRUSH), ("strength", 1.0)):
                if hasattr(owner, name):
                    setattr(owner, name, value)
    yield 1.0
    kind, height = values("class_index"), {}
    # Origins are above the ground, by as much for all of a class.
    for number, z in zip(kind.tolist(), positions()[:, 2].tolist(), strict=True):
        height[number] = z
    way = [on_screen((FROM[0] + share * (TO[0] - FROM[0]), FROM[1], 0.0)) for share in np.linspace(0.0, 1.0, 30)]
    mouse = steps.drag(way, 2.0)
    yield from hand.until(lambda: mouse.poll() is not None, 10.0, "the stroke")
    yield 0.5
    yield from hand.until(at_rest, LONGEST_UPDATE, "Live to follow the ground")
    place = positions()
    raised = [z - height[number] for z, number in zip(place[:, 2], values("class_index"), strict=True)]
    answer["sculpted"] = bpy.context.mode, len(place) == len(kind), float(max(raised))
    take_screenshot("gather-8-sculpted.png")
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    with steps.window_context():
        bpy.ops.object.mode_set(mode="OBJECT")
    yield 0.5
    off = [
        _ground_at(x, y) + height[number] - z for (x, y, z), number in zip(place, values("class_index"), strict=True)
    ]
    answer["off_ground"] = float(np.nanmax(np.abs(off)))


def _ground_at(x, y):
    hit, place, _, _ = bpy.data.objects["Ground"].ray_cast((x / (SIDE / 2), y / (SIDE / 2), 50.0), (0.0, 0.0, -1.0))
    return place.z if hit else math.nan


def updated_together():
    """A second scatter does not make room for the first, which was run again: Update All in its panel has it do so."""
    yield from hand.press("].live", across=0.75)
    with steps.window_context():
        for item in bpy.context.scene.objects:
            item.select_set(item.name in ("Ground", "Chip"))
        bpy.context.view_layer.objects.active = bpy.data.objects["Ground"]
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.search("scatter sel")
    # The list may lie elsewhere in memory once it has grown.
    settings = bpy.context.scene.esh_scatter
    yield from hand.until(
        lambda: len(settings.scatters) == 2 and scatter().result and idle(), LONGEST_UPDATE, "another"
    )
    settings.scatter_index = 0
    scatter().seed += 1
    yield 1.0
    yield from update()
    before = settings.scatters[1].report_json
    answer["in_the_way"] = [other.name for other in scatter().later_in_the_way()] == [settings.scatters[1].name]
    take_screenshot("gather-9-in-the-way.png")
    yield from hand.press("esh.scatter_all")
    yield from hand.until(lambda: idle() and settings.scatters[1].report_json != before, LONGEST_UPDATE, "both")
    yield 1.0
    answer["together"] = (
        [one.changes() for one in settings.scatters],
        settings.scatter_index,
        scatter().later_in_the_way(),
    )
    take_screenshot("gather-10-together.png")


WALKS = (begin, from_selection, from_collection, from_image, looked_at, copied, led_around, sculpted, updated_together)
hand.take(WALKS, set_stage)
