"""Runs inside a windowed Blender: install the zip, press Scatter Selection, tune and change it, say what happened."""

import bpy
import window_steps as steps
from mathutils import Euler
from small_forest import OBJECTS, ground, thing
from window_steps import answer, take_screenshot, window_context

LONGEST_RUN = 60.0


def fill_in():
    with window_context():
        steps.show_tab()
        # As the pictures of the documentation show it: from a little above, and filled by the ground.
        space = bpy.context.area.spaces.active
        space.region_3d.view_rotation = Euler((1.0, 0.0, 0.5)).to_quaternion()
        space.region_3d.view_location, space.region_3d.view_distance = (1.0, -2.2, 0.0), 14.0
        space.shading.show_shadows = space.shading.show_cavity = True
        space.shading.shadow_intensity = 0.35
        space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
        steps.remove_objects()
        made = [ground(), *(thing(name, parts) for name, parts in OBJECTS.items())]
        for item in made:
            item.select_set(True)
        bpy.context.view_layer.objects.active = made[0]
        bpy.ops.ed.undo_push(message="Filled in")


def press():
    with window_context():
        take_screenshot("before.png")
        answer["pressed"] = sorted(bpy.ops.esh.scatter_selection("INVOKE_DEFAULT"))


def finished():
    # There is no scatter before the objects have been measured.
    scatter = bpy.context.scene.esh_scatter.active
    if scatter is None or scatter.result is None or not scatter.report_json:
        return False
    answer["asked"] = {one.name: one.count for one in scatter.classes}
    answer["points"] = len(scatter.result.data.vertices)
    answer["instances"] = count_instances()
    answer["report"] = scatter.report
    return True


def count_instances():
    return sum(1 for one in bpy.context.evaluated_depsgraph_get().object_instances if one.is_instance)


def look():
    with window_context():
        take_screenshot("after.png")


def tune():
    """What the panel of the last operation (F9) does when a value in it is changed."""
    with window_context():
        last = bpy.context.window_manager.operators[-1]
        answer["last"] = last.bl_idname
        last.properties.most = 100
        answer["tuned"] = sorted(bpy.ops.ed.undo_redo())
        scatters = bpy.context.scene.esh_scatter.scatters
        answer["scatters_after_tuning"] = len(scatters)
        answer["instances_after_tuning"] = count_instances()
        answer["asked_after_tuning"] = sum(one.count for one in scatters[0].classes)


def change():
    """What needs no solving, and what does."""
    scatter = bpy.context.scene.esh_scatter.active
    classes = scatter.classes
    before = count_instances()
    classes["Mushroom"].show_viewport = False
    answer["hidden_at_once"] = before - count_instances() == classes["Mushroom"].count
    classes["Pine"].offset = -0.05
    answer["outdated_by_offset"] = scatter.outdated
    classes["Log"].sizes[0].count += 5
    classes["Pebble"].mute = True
    classes["Beech"].add_layer("IMAGE")
    answer["changes"] = scatter.changes()


def look_again():
    with window_context():
        take_screenshot("changed.png")


steps.run(
    [
        steps.open_sidebar,
        fill_in,
        press,
        (steps.within(LONGEST_RUN, finished), 0.3),
        look,
        tune,
        change,
        look_again,
    ],
    by_hand=False,
)
