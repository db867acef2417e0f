"""Runs inside a windowed Blender: twenty classes in a narrow sidebar, in the light and the dark theme; says how long drawing takes."""

import time
from pathlib import Path

import bpy
import window_steps as steps
from window_steps import answer

CLASSES = 20
# Of the sidebar [pixels].
WIDTH = 250

_spent: list[float] = []
drag = None


def fill_in():
    with steps.window_context():
        steps.remove_objects()
        bpy.ops.mesh.primitive_cube_add(size=0.3, location=(0.0, 0.0, 5.0))
        thing = bpy.context.object
        bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=20, y_subdivisions=20)
        scatter = bpy.context.scene.esh_scatter.add_scatter(bpy.context.object)
        for number in range(CLASSES):
            one = scatter.add_class()
            one.name = f"Class with number {number + 1}"
            one.sizes[0].source_object, one.sizes[0].count = thing, 20
        scatter.classes[1].add_layer("NOISE")
        scatter.classes[1].add_size()
        scatter.class_index, scatter.max_steps, scatter.device = 1, 5, "CPU"
        scatter.classes[1].sizes[1].source_object = thing
        scatter.classes[3].mute = True
        answer["ran"] = sorted(bpy.ops.esh.scatter())


def show_tab():
    steps.show_tab()


def narrow():
    """Drag the edge of the sidebar until it is as narrow as it is to be."""
    global drag
    window, area, _ = steps.view()
    region = next(one for one in area.regions if one.type == "UI")
    answer["width_before"] = region.width
    # Its edge is just beside it.
    x, y = region.x - 2, window.height - (region.y + round(0.3 * region.height))
    shift = region.width - WIDTH
    way = [(x + round(shift * k / 10), y) for k in range(11)]
    drag = steps.drag([(x, y), *way], 3.0)


def dragged():
    return drag.poll() is not None


def watch():
    """Have every panel say how long it takes to draw itself."""
    _, area, _ = steps.view()
    answer["width"] = next(one for one in area.regions if one.type == "UI").width
    for name in dir(bpy.types):
        cls = getattr(bpy.types, name)
        if name.startswith("ESH_PT_") and hasattr(cls, "draw"):
            cls.draw = _timed(cls.draw)


def _timed(draw):
    def timed(self, context):
        start = time.thread_time()
        draw(self, context)
        _spent.append(time.thread_time() - start)

    return timed


def measure():
    """Draw the sidebar a few times."""
    _, area, _ = steps.view()
    region = next(one for one in area.regions if one.type == "UI")
    found = []
    for _ in range(20):
        _spent.clear()
        region.tag_redraw()
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)
        found.append(1000.0 * sum(_spent))
    answer["draws"] = sorted(found)
    answer["panels"] = len(_spent)


def dark():
    steps.take_screenshot("panel_dark.png")


def lighten():
    folder = Path(bpy.utils.resource_path("LOCAL"), "scripts", "presets", "interface_theme")
    paths = [folder, *(Path(one) for one in bpy.utils.preset_paths("interface_theme"))]
    theme = next(one / "Blender_Light.xml" for one in paths if (one / "Blender_Light.xml").exists())
    bpy.ops.script.execute_preset(filepath=str(theme), menu_idname="USERPREF_MT_interface_theme_presets")


def light():
    steps.take_screenshot("panel_light.png")


steps.run(
    [
        steps.open_sidebar,
        fill_in,
        show_tab,
        narrow,
        dragged,
        watch,
        measure,
        dark,
        lighten,
        light,
    ],
    by_hand=False,
)
