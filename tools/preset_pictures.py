"""Render the pictures of the presets: ``python tools/preset_pictures.py`` writes one beside each, and ``docs/presets.jpg`` of all.

Every preset is applied as the sidebar does it, on a flat square, and rendered with Cycles. Needs pip's bpy and Pillow.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from pathlib import Path

import bpy
import numpy as np
from esh import scatter
from esh.esh_scatter import registration
from esh.esh_scatter.editing.preset_files import built_in_presets
from mathutils import Vector
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parent.parent
SIDE = 12.0
# What lies flat is seen from above.
FLAT = {"stippling", "hatching", "mosaic", "pizza", "confetti"}
# Colors of grounds, those of the others are earth.
EARTH = (0.16, 0.12, 0.07)
GROUNDS = {
    "stippling": (0.9, 0.88, 0.82),
    "hatching": (0.9, 0.88, 0.82),
    "mosaic": (0.35, 0.33, 0.3),
    "pizza": (0.75, 0.35, 0.12),
    "confetti": (0.3, 0.3, 0.34),
    "crowd": (0.4, 0.38, 0.35),
    "meadow": (0.10, 0.17, 0.04),
    "pebbles": (0.45, 0.38, 0.28),
}
# The sheet: pictures in a row, and room for their names below each.
COLUMNS, LABEL, GAP = 4, 26, 8


def main() -> None:
    """Render them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", help="names of presets: mixed_forest; all where none is given")
    parser.add_argument("--pixels", type=int, default=224, help="sides of the pictures")
    parser.add_argument("--samples", type=int, default=12, help="of Cycles, per pixel")
    parser.add_argument("--device", default="cpu", help="where objects are placed")
    options = parser.parse_args()
    presets = {Path(path): name for path, name in built_in_presets().items()}
    for path in presets:
        if not options.only or path.stem in options.only:
            render(path, options.pixels, options.samples, options.device)
    draw_sheet(presets, ROOT / "docs" / "presets.jpg")


def render(path: Path, pixels: int, samples: int, device: str) -> None:
    """Render one preset into a picture beside it."""
    bpy.ops.wm.read_homefile(use_empty=True)
    registration.register()
    try:
        _shaded_ball()
        bpy.ops.mesh.primitive_grid_add(size=SIDE, x_subdivisions=24, y_subdivisions=24)
        _paint(bpy.context.object, GROUNDS.get(path.stem, EARTH))
        bpy.ops.esh.preset_apply(filepath=str(path))
        made = bpy.context.scene.esh_scatter.active
        positional, named = made.arguments(bpy.context.scene)
        result = scatter(*positional, **{**named, "device": device})
        print(path.stem, len(result.placement.position), "placed", flush=True)
        _light()
        _look(path.stem in FLAT)
        with tempfile.TemporaryDirectory() as folder:
            _render(Path(folder) / "picture.png", pixels, samples)
            with Image.open(Path(folder) / "picture.png") as picture:
                picture.convert("RGB").save(path.with_suffix(".jpg"), quality=80, optimize=True)
    finally:
        registration.unregister()


def draw_sheet(presets: dict[Path, str], target: Path) -> None:
    """Draw all pictures with their names."""
    pictures = [(name, path.with_suffix(".jpg")) for path, name in presets.items() if path.with_suffix(".jpg").exists()]
    with Image.open(pictures[0][1]) as first:
        side = first.width
    rows = math.ceil(len(pictures) / COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * (side + GAP) - GAP, rows * (side + LABEL)), "white")
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(14)
    for number, (name, path) in enumerate(pictures):
        x, y = number % COLUMNS * (side + GAP), number // COLUMNS * (side + LABEL)
        with Image.open(path) as picture:
            sheet.paste(picture, (x, y))
        draw.text((x + side / 2, y + side + LABEL / 2), name, fill=(30, 30, 30), font=font, anchor="mm")
    sheet.save(target, quality=85, optimize=True)


def _shaded_ball() -> None:
    """The picture that presets of images follow: a ball in the light, and its shadow."""
    y, x = np.mgrid[1.0:-1.0:256j, -1.0:1.0:256j]
    r = np.hypot(x, y) / 0.72
    z = np.sqrt(np.maximum(1.0 - r**2, 0.0))
    light = np.clip((-0.5 * x + 0.55 * y) / 0.72 + 0.65 * z, 0.03, 1.0)
    shadow = np.clip(1.6 * np.hypot((x - 0.3) / 0.75, (y + 0.72) / 0.16) - 0.8, 0.25, 1.0)
    values = np.where(r < 1.0, light, shadow)
    image = bpy.data.images.new("ball", 256, 256, is_data=True)
    pixels = np.ones((256, 256, 4), np.float32)
    # Blender's first row is the lowest.
    pixels[..., :3] = values[::-1, :, None]
    image.pixels.foreach_set(pixels.ravel())


def _paint(item: bpy.types.Object, color: tuple[float, float, float]) -> None:
    material = bpy.data.materials.new("Ground")
    if material.node_tree is None:
        material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    shader.inputs["Roughness"].default_value = 0.95
    item.data.materials.append(material)


def _light() -> None:
    scene = bpy.context.scene
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.data.angle = 3.6, math.radians(3.0)
    sun.rotation_euler = (math.radians(48.0), 0.0, math.radians(-35.0))
    scene.collection.objects.link(sun)
    scene.world = bpy.data.worlds.new("Sky")
    scene.world.color = (0.62, 0.70, 0.82)
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.62, 0.70, 0.82, 1.0)
    background.inputs["Strength"].default_value = 0.7


def _look(from_above: bool) -> None:
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    if from_above:
        camera.data.type, camera.data.ortho_scale = "ORTHO", SIDE
        camera.location = (0.0, 0.0, 20.0)
        return
    camera.data.lens = 50.0
    camera.location = (0.0, -0.95 * SIDE, 0.62 * SIDE)
    camera.rotation_euler = (Vector((0.0, 0.3, 0.0)) - camera.location).to_track_quat("-Z", "Y").to_euler()


def _render(path: Path, pixels: int, samples: int) -> None:
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = samples, True
    scene.cycles.max_bounces = 3
    scene.render.resolution_x = scene.render.resolution_y = pixels
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Standard"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
