"""What the Blender example is set in: colored shapes, a sun, a camera, Cycles. Nothing of ESH Scatter is in here."""

from pathlib import Path

import bpy

__all__ = ["add", "render"]


def add(shape: str, color: tuple[float, float, float], **arguments: object) -> bpy.types.Object:
    """Add one of Blender's own shapes ("cone", "grid") in a color."""
    getattr(bpy.ops.mesh, f"primitive_{shape}_add")(**arguments)
    material = bpy.data.materials.new(shape)
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*color, 1.0)
    bpy.context.object.data.materials.append(material)
    return bpy.context.object


def render(picture: Path) -> None:
    """Render 40 m by 40 m around the origin, from the south."""
    scene = bpy.context.scene
    bpy.ops.object.light_add(type="SUN", rotation=(0.9, 0.2, 0.6))
    bpy.context.object.data.energy = 3.0
    bpy.ops.object.camera_add(location=(0.0, -44.0, 36.0), rotation=(0.88, 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.camera.data.lens = 38.0
    scene.world = bpy.data.worlds.new("Sky")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.45, 0.6, 0.8, 1.0)
    scene.view_settings.view_transform = "Standard"
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 16, True
    scene.render.resolution_x, scene.render.resolution_y = 800, 500
    scene.render.filepath = str(picture.resolve())
    bpy.ops.render.render(write_still=True)
