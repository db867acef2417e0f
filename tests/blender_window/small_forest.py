"""Hills and what grows on them, as the pictures of windows show them: trees, logs, mushrooms and pebbles of a few faces each."""

import math

import bmesh
import bpy
from mathutils import Euler, Matrix

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
