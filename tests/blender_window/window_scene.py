"""A ground, objects to place on it and a rock, and what is read of a scatter that a hand has made of them."""

import bpy
import numpy as np
import window_hand as hand
import window_steps as steps
from bpy_extras.view3d_utils import location_3d_to_region_2d
from window_steps import answer, take_screenshot

LONGEST_RUN, LONGEST_UPDATE = 60.0, 30.0
SIDE = 20.0
OBJECTS = {
    "Pine": ("cone", (0.4, 0.4, 0.9), (0.07, 0.22, 0.13)),
    "Beech": ("ico_sphere", (0.4, 0.4, 0.6), (0.36, 0.46, 0.14)),
    "Log": ("cube", (0.8, 0.1, 0.1), (0.33, 0.19, 0.09)),
}


def scatter():
    return bpy.context.scene.esh_scatter.active


def fill_in():
    bpy.context.preferences.view.filebrowser_display_type = "SCREEN"
    with steps.window_context():
        steps.show_tab()
        steps.remove_objects()
        made = [_made("Ground", "grid", (0.0, 0.0, 0.0), (SIDE / 2, SIDE / 2, 1.0), (0.42, 0.40, 0.30))]
        for name, (shape, scale, color) in OBJECTS.items():
            made.append(_made(name, shape, (0.0, 0.0, -10.0), scale, color))
        _made("Pebble", "ico_sphere", (-12.0, 0.0, 0.0), (0.3, 0.3, 0.2), (0.62, 0.60, 0.56))
        _made("Rock", "cube", (0.0, 0.0, 1.0), (2.0, 2.0, 1.0), (0.35, 0.35, 0.38))
        for item in bpy.context.scene.objects:
            item.select_set(item in made)
        bpy.context.view_layer.objects.active = made[0]
        bpy.ops.view3d.view_axis(type="TOP")
        bpy.context.space_data.region_3d.view_distance = 32.0
        bpy.context.space_data.overlay.show_floor = False
        bpy.ops.ed.undo_push(message="Filled in")
    hand.watch_panels()


def _made(name, shape, place, scale, color):
    getattr(bpy.ops.mesh, f"primitive_{shape}_add")(location=place)
    item = bpy.context.object
    item.name, item.scale = name, scale
    item.data.materials.append(bpy.data.materials.new(name))
    item.data.materials[0].diffuse_color = (*color, 1.0)
    return item


def on_screen(place):
    """Where on the screen a place in the scene is."""
    _, area, region = steps.view()
    return steps.on_screen(*location_3d_to_region_2d(region, area.spaces.active.region_3d, place))


def positions():
    mesh = scatter().result.data
    place = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", place)
    return place.reshape(-1, 3)


def values(name):
    mesh = scatter().result.data
    found = np.empty(len(mesh.vertices), np.int32)
    mesh.attributes[name].data.foreach_get("value", found)
    return found


def instances():
    return sum(1 for one in bpy.context.evaluated_depsgraph_get().object_instances if one.is_instance)


def idle():
    """Whether no run is going on."""
    return steps.ours("solving.running").session is None


def live():
    """What follows the scatter; None while nothing does."""
    return steps.ours("solving.live")._followed.get((bpy.context.scene.session_uid, scatter().uid))


def at_rest():
    """Whether Live has followed everything."""
    follower = live()
    return follower is not None and not follower.busy and not scatter().outdated and idle()


def update():
    """Click on Update, and wait for the result."""
    before = scatter().report_json if scatter() else ""
    yield from hand.press("esh.scatter(")
    yield from hand.until(lambda: idle() and scatter().report_json not in ("", before), LONGEST_RUN, "the run")
    yield 1.0


def begin():
    yield from hand.press("esh.scatter_selection")
    yield from hand.until(lambda: scatter() and scatter().result and idle(), LONGEST_RUN, "the first run")
    yield 1.0
    answer["begun"] = {one.name: one.count for one in scatter().classes}
    # From above: between closed panels it is known how far one is from the other.
    for name in ("ESH_PT_classes", "ESH_PT_class"):
        yield from hand.turn_panel(name, is_open=False)
    take_screenshot("hand-1-begun.png")


def ask_for(count):
    """Type the count of the active class."""
    top = yield from hand.turn_panel("ESH_PT_class")
    yield from hand.enter("sizes[0].count", count, first=top)
    # What is said of so many comes a moment later, and moves the panel down.
    yield 2.0
    yield from hand.turn_panel("ESH_PT_class", is_open=False)


def open_presets():
    """Open the menu of the presets, which is in that of the scatters."""
    _, y = yield from hand.find("esh.scatter_add", across=0.76)
    _, _, region = hand.sidebar()
    yield from hand.click((region.x + 20, y))
    yield from hand.keys("p")
