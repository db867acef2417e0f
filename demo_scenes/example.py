"""Makes example.blend: hills with a mixed forest, with all settings in the sidebar, to open and to change.

python demo_scenes/example.py
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from pathlib import Path

import bpy
import esh
from scene_parts import add_camera

FILE = Path(__file__).resolve().with_name("example.blend")


def main(file: Path) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    esh.register()
    try:
        if bpy.ops.esh.example() != {"FINISHED"}:
            raise SystemExit("The example cannot be added")
        scene = bpy.context.scene
        scene.name = "Example"
        sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
        sun.rotation_euler, sun.data.energy = (0.9, 0.2, 0.6), 3.0
        scene.collection.objects.link(sun)
        scene.camera = add_camera(scene, "Camera", (0.0, -44.0, 36.0), (0.0, 0.0, -0.5), lens=38.0)
        scene.world = bpy.data.worlds.new("Sky")
        scene.world.use_nodes = True
        scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.45, 0.6, 0.8, 1.0)
        scene.view_settings.view_transform = "Standard"
        ground = bpy.data.objects["Example Ground"]
        bpy.ops.object.select_all(action="DESELECT")
        ground.select_set(True)
        bpy.context.view_layer.objects.active = ground
        # A file keeps where it was saved.
        with tempfile.TemporaryDirectory() as folder:
            saved = Path(folder) / "example.blend"
            bpy.ops.wm.save_as_mainfile(filepath=str(saved), compress=True, check_existing=False)
            shutil.copyfile(saved, file)
    finally:
        esh.unregister()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--output", type=Path, default=FILE, help="where the file is written")
    main(parser.parse_args().output)
