"""Runs inside a windowed Blender: install the zip, press Scatter Selection, tune and change it, say what happened."""

import sys
import time
from pathlib import Path

import bpy
from mathutils import Euler

sys.path.insert(0, str(Path(__file__).parent))
import window_steps as steps
from window_steps import answer, take_screenshot, window_context

LONGEST_RUN = 60.0
# What is placed: how it is made, its scale, and its color; and the color of the ground.
OBJECTS = {
    "Pine": ("cone", (0.4, 0.4, 0.9), (0.07, 0.22, 0.13)),
    "Beech": ("ico_sphere", (0.4, 0.4, 0.6), (0.36, 0.46, 0.14)),
    "Log": ("cube", (0.8, 0.1, 0.1), (0.33, 0.19, 0.09)),
    "Mushroom": ("torus", (0.15, 0.15, 0.3), (0.72, 0.16, 0.07)),
    "Pebble": ("uv_sphere", (0.1, 0.1, 0.06), (0.62, 0.60, 0.56)),
}
GROUND = (0.42, 0.40, 0.30)


def fill_in():
    with window_context():
        steps.show_tab()
        # As the pictures of the documentation show it: from a little above, and filled by the ground.
        view = bpy.context.area.spaces.active.region_3d
        view.view_rotation = Euler((0.9, 0.0, 0.5)).to_quaternion()
        view.view_location, view.view_distance = (1.2, -0.6, 0.0), 17.5
        for item in list(bpy.data.objects):
            bpy.data.objects.remove(item)
        bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=20, y_subdivisions=20)
        ground = bpy.context.object
        ground.name = "Ground"
        paint(ground, GROUND)
        made = [ground]
        for name, (shape, scale, color) in OBJECTS.items():
            getattr(bpy.ops.mesh, f"primitive_{shape}_add")(location=(30.0, 0.0, 0.0))
            bpy.context.object.name = name
            bpy.context.object.scale = scale
            paint(bpy.context.object, color)
            made.append(bpy.context.object)
        for item in bpy.context.scene.objects:
            item.select_set(item in made)
        bpy.context.view_layer.objects.active = ground
        bpy.ops.ed.undo_push(message="Filled in")


def paint(item, color):
    material = bpy.data.materials.new(item.name)
    material.diffuse_color = (*color, 1.0)
    item.data.materials.append(material)


def press():
    with window_context():
        take_screenshot("before.png")
        answer["pressed"] = sorted(bpy.ops.esh.scatter_selection("INVOKE_DEFAULT"))
    answer["deadline"] = time.time() + LONGEST_RUN


def finished():
    # There is no scatter before the objects have been measured.
    scatter = bpy.context.scene.esh_scatter.active
    if (scatter is None or scatter.result is None) and time.time() < answer["deadline"]:
        return False
    answer["asked"] = {one.name: one.count for one in scatter.classes}
    answer["points"] = len(scatter.result.data.vertices) if scatter.result else 0
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
        (steps.install, 2.0),
        (steps.open_sidebar, 2.0),
        (fill_in, 3.0),
        (press, 0.5),
        (finished, 3.0),
        (look, 0.5),
        (tune, 1.0),
        (change, 2.0),
        (look_again, 0.5),
        (steps.end, 1.0),
    ]
)
