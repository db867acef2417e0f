"""Runs inside a windowed Blender: install the zip, press Scatter Selection, tune and change it, say what happened."""

import math

import bmesh
import bpy
import window_steps as steps
from mathutils import Euler, Matrix
from window_steps import answer, take_screenshot, window_context

LONGEST_RUN = 60.0
BARK, WOOD, NEEDLES, LEAVES = (0.16, 0.09, 0.05), (0.45, 0.30, 0.16), (0.05, 0.19, 0.10), (0.30, 0.42, 0.10)
# What is placed, of parts: a cone by its radii at both ends, its length and the height where it begins, or a ball by its half axes
# and the height of its lowest point [m]; and its color.
OBJECTS = {
    "Pine": [
        ((0.07, 0.06, 0.35, 0.0), BARK),
        ((0.46, 0.18, 0.55, 0.3), NEEDLES),
        ((0.36, 0.12, 0.5, 0.7), NEEDLES),
        ((0.25, 0.0, 0.6, 1.1), NEEDLES),
    ],
    "Beech": [((0.09, 0.06, 0.7, 0.0), BARK), (((0.5, 0.5, 0.55), 0.45), LEAVES), (((0.33, 0.33, 0.3), 1.2), LEAVES)],
    "Log": [((0.11, 0.1, 1.6, -0.8), BARK), ((0.08, 0.07, 1.62, -0.81), WOOD)],
    "Mushroom": [((0.05, 0.04, 0.16, 0.0), (0.80, 0.74, 0.62)), ((0.14, 0.04, 0.1, 0.13), (0.62, 0.08, 0.04))],
    "Pebble": [(((0.13, 0.1, 0.07), -0.02), (0.52, 0.50, 0.47))],
}
GROUND = (0.27, 0.26, 0.12)


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
        for item in list(bpy.data.objects):
            bpy.data.objects.remove(item)
        made = [ground(), *(thing(name, parts) for name, parts in OBJECTS.items())]
        for item in made:
            item.select_set(True)
        bpy.context.view_layer.objects.active = made[0]
        bpy.ops.ed.undo_push(message="Filled in")


def ground():
    """Gentle hills, 20 m wide."""
    bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=60, y_subdivisions=60)
    made = bpy.context.object
    made.name = "Ground"
    for vertex in made.data.vertices:
        x, y, _ = vertex.co
        vertex.co.z = 0.5 * math.sin(0.35 * x + 0.2 * y) + 0.35 * math.cos(0.5 * y - 0.2 * x)
    made.data.shade_smooth()
    made.data.materials.append(painted("Ground", GROUND))
    return made


def thing(name, parts):
    """Something to place, far below the ground."""
    shape = bmesh.new()
    mesh = bpy.data.meshes.new(name)
    for number, (form, color) in enumerate(parts):
        if len(form) == 4:
            low, high, length, begin = form
            faces = bmesh.ops.create_cone(
                shape,
                cap_ends=True,
                segments=12,
                radius1=low,
                radius2=high,
                depth=length,
                matrix=Matrix.Translation((0.0, 0.0, begin + length / 2)),
            )
        else:
            axes, lowest = form
            matrix = Matrix.LocRotScale((0.0, 0.0, lowest + axes[2]), None, axes)
            faces = bmesh.ops.create_icosphere(shape, subdivisions=2, radius=1.0, matrix=matrix)
        for face in {face for vertex in faces["verts"] for face in vertex.link_faces}:
            face.material_index, face.smooth = number, len(form) == 2
        mesh.materials.append(painted(f"{name} {number}", color))
    if name == "Log":
        bmesh.ops.transform(
            shape,
            matrix=Matrix.Translation((0, 0, 0.1)) @ Euler((0.0, math.pi / 2, 0.0)).to_matrix().to_4x4(),
            verts=shape.verts,
        )
    shape.to_mesh(mesh)
    shape.free()
    made = bpy.data.objects.new(name, mesh)
    made.location = 0.0, 0.0, -30.0
    bpy.context.collection.objects.link(made)
    return made


def painted(name, color):
    material = bpy.data.materials.new(name)
    material.diffuse_color = (*color, 1.0)
    return material


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
