"""Runs inside a windowed Blender: drags a preset with the mouse from the asset browser onto the ground, and says what came of it.

Then it shows the assets that a class of it could place.
"""

import bpy
import window_steps as steps
from window_steps import answer

PRESET = "Pebbles"
LONGEST_RUN = 120.0


def fill_in():
    """A ground, and beside it an asset browser."""
    with steps.window_context():
        steps.remove_objects()
        bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=20, y_subdivisions=20)
        bpy.context.object.name = "Ground"
        bpy.context.object.select_set(False)
        bpy.ops.ed.undo_push(message="Filled in")
    steps.open_asset_browser(0.4)


def show_presets():
    with steps.window_context():
        answer["shown"] = sorted(bpy.ops.esh.presets_as_assets())
        bpy.context.area.spaces.active.show_region_ui = True
    space = steps.asset_browser().spaces.active
    space.show_region_toolbar = False
    space.params.filter_search = PRESET
    space.params.display_size_discrete = "LARGE"


def drop():
    steps.take_screenshot("presets.png")
    window, _, viewport = steps.view()
    region = next(one for one in steps.asset_browser().regions if one.type == "WINDOW")
    begin = region.x + 60, window.height - (region.y + region.height - 60)
    end = steps.on_screen(viewport.width * 0.45, viewport.height * 0.45)
    way = [
        (round(begin[0] + (end[0] - begin[0]) * k / 20), round(begin[1] + (end[1] - begin[1]) * k / 20))
        for k in range(21)
    ]
    steps.drag([*way, end, end], 3.0)


def finished():
    scatter = bpy.context.scene.esh_scatter.active
    if scatter is None or scatter.result is None or not scatter.report_json:
        return False
    ground = bpy.data.objects["Ground"]
    answer["modifiers"] = [one.name for one in ground.modifiers]
    answer["scatters"] = [one.name for one in bpy.context.scene.esh_scatter.scatters]
    answer["placed"] = len(scatter.result.data.vertices)
    answer["asked"] = sum(one.count for one in scatter.classes)
    answer["groups"] = [one.name for one in bpy.data.node_groups if "esh_preset" in one]
    return True


def look():
    steps.take_screenshot("dropped.png")


def show_shelf():
    with steps.window_context():
        answer["shelf"] = sorted(bpy.ops.esh.source_from_shelf("INVOKE_DEFAULT"))


def look_at_shelf():
    steps.take_screenshot("shelf.png")


steps.run(
    [
        fill_in,
        (show_presets, 6.0),
        (drop, 1.0),
        (steps.within(LONGEST_RUN, finished), 0.3),
        look,
        (show_shelf, 2.0),
        look_at_shelf,
    ]
)
