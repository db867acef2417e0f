"""What every demo scene does with Blender: objects of arrays, collections, textures, camera, rendering, saving."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from PIL import Image

__all__ = ["add_camera", "collection", "mesh_object", "save", "save_textures", "set_render"]


def mesh_object(name: str, vertex: np.ndarray, face: np.ndarray, smooth: bool = False) -> bpy.types.Object:
    """Make an object, not yet in any collection, of vertices ``[n, 3]`` and faces ``[m, 3 or 4]``."""
    mesh = bpy.data.meshes.new(name)
    sides = face.shape[1]
    mesh.vertices.add(len(vertex))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(vertex, np.float32).ravel())
    mesh.loops.add(face.size)
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(face, np.int32).ravel())
    mesh.polygons.add(len(face))
    mesh.polygons.foreach_set("loop_start", np.arange(0, face.size, sides, dtype=np.int32))
    mesh.polygons.foreach_set("use_smooth", np.full(len(face), smooth))
    mesh.update(calc_edges=True)
    return bpy.data.objects.new(name, mesh)


def collection(name: str, parent: bpy.types.Collection, hidden: bool = False) -> bpy.types.Collection:
    """Make a collection below ``parent``; a hidden one holds what is only seen as instances."""
    made = bpy.data.collections.new(name)
    parent.children.link(made)
    made.hide_viewport = made.hide_render = hidden
    return made


def save_textures(textures: dict[str, np.ndarray], folder: Path) -> dict[str, bpy.types.Image]:
    """Write textures 0..1 as 8-bit PNG files of their names, and load them, as data and not as color."""
    loaded = {}
    for name, texture in textures.items():
        path = folder / f"{name}.png"
        Image.fromarray(np.round(255.0 * texture).astype(np.uint8)).save(path)
        image = bpy.data.images.load(str(path.resolve()))
        image.colorspace_settings.name = "Non-Color"
        # Nothing in the scene shows it: without this it would not be saved.
        image.use_fake_user = True
        loaded[name] = image
    return loaded


def add_camera(
    scene: bpy.types.Scene,
    name: str,
    eye: tuple[float, float, float],
    aim: tuple[float, float, float],
    *,
    lens: float,
    clip_end: float = 1000.0,
) -> bpy.types.Object:
    """Set a camera at ``eye`` that looks at ``aim`` [m], with the upper edge of its picture upwards or else along y.

    Args:
        scene: Where the camera is linked; it is not made the scene's camera.
        name: Of the camera.
        eye: Where it stands.
        aim: What is in the middle of the picture.
        lens: Focal length for a sensor of 36 mm [mm].
        clip_end: Nothing farther is seen [m].
    """
    data = bpy.data.cameras.new(name)
    data.lens = lens
    data.clip_start, data.clip_end = clip_end * 1e-4, clip_end
    camera = bpy.data.objects.new(name, data)
    camera.location = eye
    camera.rotation_euler = (Vector(aim) - Vector(eye)).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(camera)
    return camera


def set_render(scene: bpy.types.Scene, width: int, height: int, samples: int, seed: int) -> None:
    """Choose Cycles with few samples, a denoiser where this Blender has one, and a filmic look."""
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.render.use_persistent_data = True
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = samples
    cycles.seed = seed
    cycles.use_adaptive_sampling = True
    cycles.adaptive_threshold = 0.03
    cycles.max_bounces, cycles.diffuse_bounces, cycles.transmission_bounces = 4, 2, 2
    cycles.use_fast_gi = False
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.use_denoising = True
    try:
        cycles.denoiser = "OPENIMAGEDENOISE"
    except TypeError:
        cycles.use_denoising = False
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = "AgX - Punchy"
    scene.render.image_settings.file_format = "PNG"


def save(path: Path) -> None:
    """Save the file with its textures inside, and their paths relative to it."""
    for image in bpy.data.images:
        if image.source == "FILE" and image.filepath:
            image.pack()
            image.filepath = f"//{Path(bpy.path.abspath(image.filepath)).name}"
    bpy.context.preferences.filepaths.save_version = 0
    bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), compress=True)
