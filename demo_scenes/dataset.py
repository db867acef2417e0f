"""A data set for learning: rendered scenes with depth, instance and class masks, and boxes as COCO JSON, by Blender alone.

    python demo_scenes/dataset.py --scenes 100 --output output/dataset

Every scene has other counts, another camera and another sun; which ones, its number alone decides. ``esh.scatter`` places stones,
mushrooms and sticks so that none overlap. Each scene is rendered twice: once with light, and once with one ray a pixel, whose color
is the number of the instance, the number of its class and the depth. So masks have no mixed pixels at edges.

    images/000000.png      the picture
    instances/000000.png   16 bits: number of the instance, from 1; 0 is ground
    classes/000000.png     8 bits: number of the class, from 1; 0 is ground
    depth/000000.npy       float32, distance along the camera's axis [m]; infinite where nothing is
    scenes/000000.json     what is in it, and its camera; a scene that has this file is not rendered again
    coco.json              images, categories, and for each instance that is seen its box, area and mask
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from pathlib import Path

import bpy
import esh
import numpy as np
from PIL import Image
from scene_parts import add_camera, collection, mesh_object, set_render

__all__ = ["build", "main", "write_scene"]

# Name -> smallest and largest count, footprint of the largest instance [m²], color.
CLASSES = {
    "stone": (10, 40, 0.30, (0.30, 0.29, 0.27)),
    "mushroom": (15, 60, 0.06, (0.55, 0.16, 0.07)),
    "stick": (5, 25, None, (0.20, 0.12, 0.06)),
}
GROUND = (9.0, 7.0)
NUMBER = "instance_number"
CLASS = "class_number"


def lathe(profile: list[tuple[float, float]], corners: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and faces of a profile (radius, height) [m] that is turned about z."""
    radius, height = np.array(profile).T
    angle = np.arange(corners) * 2.0 * math.pi / corners
    rings = np.stack(
        [np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle)), np.repeat(height[:, None], corners, axis=1)],
        axis=-1,
    )
    index = np.arange(len(profile) * corners).reshape(len(profile), corners)
    following = np.roll(index, -1, axis=1)
    face = np.stack([index[:-1], following[:-1], following[1:], index[1:]], axis=-1).reshape(-1, 4)
    return rings.reshape(-1, 3), face


def stone(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return a flattened ball with dents, half in the ground."""
    turn = np.linspace(-0.5, 0.5, 13) * math.pi
    vertex, face = lathe([(0.3 * math.cos(t), 0.2 * math.sin(t)) for t in turn])
    for direction in random.normal(size=(9, 3)):
        direction /= np.linalg.norm(direction)
        beyond = vertex @ direction - random.uniform(0.13, 0.2)
        vertex -= np.outer(np.maximum(beyond, 0.0), direction)
    return vertex + (0.0, 0.0, 0.06), face


def material(name: str, color: tuple[float, float, float], roughness: float) -> bpy.types.Material:
    """Return a surface whose brightness differs from instance to instance."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    surface = nodes["Principled BSDF"]
    surface.inputs["Roughness"].default_value = roughness
    shade = nodes.new("ShaderNodeHueSaturation")
    shade.inputs["Color"].default_value = (*color, 1.0)
    spread = nodes.new("ShaderNodeMapRange")
    spread.inputs["To Min"].default_value, spread.inputs["To Max"].default_value = 0.6, 1.5
    links.new(nodes.new("ShaderNodeObjectInfo").outputs["Random"], spread.inputs["Value"])
    links.new(spread.outputs["Result"], shade.inputs["Value"])
    links.new(shade.outputs["Color"], surface.inputs["Base Color"])
    return made


def label_material() -> bpy.types.Material:
    """Return a surface that shines in the number of the instance, the number of its class, and the depth [m]."""
    made = bpy.data.materials.new("labels")
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.clear()
    shine = nodes.new("ShaderNodeEmission")
    mix = nodes.new("ShaderNodeCombineXYZ")
    for socket, name in (("X", NUMBER), ("Y", CLASS)):
        attribute = nodes.new("ShaderNodeAttribute")
        attribute.attribute_type, attribute.attribute_name = "INSTANCER", name
        links.new(attribute.outputs["Fac"], mix.inputs[socket])
    links.new(nodes.new("ShaderNodeCameraData").outputs["View Z Depth"], mix.inputs["Z"])
    links.new(mix.outputs["Vector"], shine.inputs["Color"])
    links.new(shine.outputs["Emission"], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return made


def build(number: int, *, device: str = "auto", max_steps: int = 60) -> esh.ScatterResult:
    """Make the scene of this number in an empty file; ``device`` and ``max_steps`` are those of ``esh.scatter``."""
    bpy.ops.wm.read_homefile(use_empty=True)
    random = np.random.default_rng([number, 1])
    scene = bpy.context.scene
    vertex, face = lathe([(0.0, 0.0), (1.0, 0.0)], 4)
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * GROUND
    ground = mesh_object("Ground", np.column_stack([corners, np.zeros(4)]), np.array([[0, 1, 2, 3]]))
    ground.data.materials.append(material("soil", tuple(random.uniform(0.05, 0.16, 3)), 0.95))
    scene.collection.objects.link(ground)

    kinds = collection("Kinds", scene.collection, hidden=True)
    shapes = {
        "stone": [stone(random) for _ in range(3)],
        "mushroom": [
            lathe(
                [
                    (0.0, 0.0),
                    (0.035, 0.0),
                    (0.03, high),
                    (reach, high - 0.01),
                    (0.7 * reach, high + 0.06),
                    (0.0, high + 0.08),
                ]
            )
            for high, reach in ((0.1, 0.1), (0.18, 0.13))
        ],
        "stick": [lathe([(0.0, -0.5), (0.028, -0.5), (0.02, 0.5), (0.0, 0.5)], 9)],
    }
    classes = []
    for name, (fewest, most, area, color) in CLASSES.items():
        surface = material(name, color, 0.8)
        variants = collection(name, kinds)
        for vertex, face in shapes[name]:
            if name == "stick":  # lying along x
                vertex = vertex[:, [2, 1, 0]] * (1.0, 1.0, -1.0) + (0.0, 0.0, 0.028)
            item = mesh_object(name, vertex, face, smooth=name != "stone")
            item.data.materials.append(surface)
            variants.objects.link(item)
        count = int(random.integers(fewest, most + 1))
        spread = None if area is None else (0.4 * area, area)
        classes.append(esh.ScatterClass(name, [esh.ScatterSize("any", count, variants, spread)], direction="none"))
    bpy.context.view_layer.update()
    result = esh.scatter(ground, classes, seed=number, device=device, max_steps=max_steps)
    mesh = result.object.data
    count = len(mesh.vertices)
    class_index = np.empty(count, np.int32)
    mesh.attributes["class_index"].data.foreach_get("value", class_index)
    # Floats, which shaders read; 0 is whatever is no instance.
    for name, values in ((NUMBER, np.arange(1, count + 1)), (CLASS, class_index + 1)):
        mesh.attributes.new(name, "FLOAT", "POINT").data.foreach_set("value", values.astype(np.float32))

    around, high, away = random.uniform(0.0, 2.0 * math.pi), random.uniform(0.4, 1.3), random.uniform(5.0, 8.0)
    eye = (away * math.cos(high) * math.cos(around), away * math.cos(high) * math.sin(around), away * math.sin(high))
    aim = (*random.uniform(-0.8, 0.8, 2), 0.0)
    scene.camera = add_camera(scene, "Camera", eye, aim, lens=random.uniform(28.0, 50.0), clip_end=100.0)
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.data.angle = random.uniform(2.0, 5.0), random.uniform(0.005, 0.1)
    sun.rotation_euler = (random.uniform(0.1, 1.1), 0.0, random.uniform(0.0, 2.0 * math.pi))
    scene.collection.objects.link(sun)
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    sky = scene.world.node_tree.nodes["Background"]
    sky.inputs["Color"].default_value = (*random.uniform(0.3, 0.7, 3), 1.0)
    return result


def render_picture(path: Path, size: tuple[int, int], samples: int, number: int) -> None:
    """Render the scene as a camera sees it."""
    scene = bpy.context.scene
    set_render(scene, *size, samples, number)
    scene.render.filepath = str(path.resolve())
    bpy.ops.render.render(write_still=True)


def render_labels() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the instance, the class and the depth [m] of every pixel, shapes ``[height, width]``."""
    scene = bpy.context.scene
    layer = bpy.context.view_layer
    layer.material_override = label_material()
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    cycles = scene.cycles
    cycles.samples = 1
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    # One ray through the middle of each pixel.
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 0.01
    scene.render.use_motion_blur = False
    scene.view_settings.view_transform = "Raw"
    scene.view_settings.look = "None"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    with tempfile.TemporaryDirectory(prefix="labels-") as folder:
        scene.render.filepath = str(Path(folder) / "labels.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        image.colorspace_settings.name = "Non-Color"
        width, height = image.size
        pixels = np.empty(width * height * 4, np.float32)
        image.pixels.foreach_get(pixels)
        bpy.data.images.remove(image)
    pixels = pixels.reshape(height, width, 4)[::-1]
    depth = np.where(pixels[..., 2] > 0.0, pixels[..., 2], np.inf).astype(np.float32)
    return np.round(pixels[..., 0]).astype(np.uint16), np.round(pixels[..., 1]).astype(np.uint8), depth


def camera_of(scene: bpy.types.Scene, size: tuple[int, int]) -> dict:
    """Return a scene's camera as computer vision has it: x to the right, y down, z into the scene.

    ``intrinsics`` are pixels, shape ``[3, 3]``: the middle of the upper left one is at (0.5, 0.5). ``from_world`` takes meters of the
    scene to meters before the camera, shape ``[4, 4]``; the third of these is what the depth says.
    """
    camera = scene.camera
    # The sensor is as wide as the longer side of the picture.
    focal = camera.data.lens / camera.data.sensor_width * max(size)
    turned = np.diag([1.0, -1.0, -1.0, 1.0]) @ np.linalg.inv(np.array(camera.matrix_world))
    intrinsics = [[focal, 0.0, 0.5 * size[0]], [0.0, focal, 0.5 * size[1]], [0.0, 0.0, 1.0]]
    return {"intrinsics": intrinsics, "from_world": turned.tolist()}


def run_lengths(mask: np.ndarray) -> list[int]:
    """Return a mask as COCO's uncompressed run lengths: columns one after the other, beginning with what is not in it."""
    flat = mask.T.ravel()
    change = np.flatnonzero(np.diff(flat)) + 1
    runs = np.diff(np.concatenate([[0], change, [flat.size]])).tolist()
    return [0, *runs] if flat[0] else runs


def annotations(instance: np.ndarray, kind: np.ndarray) -> list[dict]:
    """Return COCO's annotations of all instances in an image, without numbers of their own."""
    found = []
    for number in np.unique(instance[instance > 0]).tolist():
        mask = instance == number
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        x, y = int(columns[0]), int(rows[0])
        found.append(
            {
                "category_id": int(kind[mask][0]),
                "instance": number,
                "bbox": [x, y, int(columns[-1]) - x + 1, int(rows[-1]) - y + 1],
                "area": int(mask.sum()),
                "iscrowd": 0,
                "segmentation": {"size": list(mask.shape), "counts": run_lengths(mask)},
            }
        )
    return found


def write_scene(number: int, output: Path, size: tuple[int, int], samples: int, **options) -> None:
    """Make, render and write the scene of this number."""
    name = f"{number:06d}"
    result = build(number, **options)
    render_picture(output / "images" / f"{name}.png", size, samples, number)
    instance, kind, depth = render_labels()
    Image.fromarray(instance).save(output / "instances" / f"{name}.png")
    Image.fromarray(kind).save(output / "classes" / f"{name}.png")
    np.save(output / "depth" / f"{name}.npy", depth)
    about = {
        "image": {"id": number, "file_name": f"images/{name}.png", "width": size[0], "height": size[1]},
        "camera": camera_of(bpy.context.scene, size),
        "annotations": annotations(instance, kind),
        "report": result.report.to_dict(),
    }
    # Last: what is there, is whole.
    beside = output / "scenes" / f".{name}.json"
    beside.write_text(json.dumps(about), encoding="utf-8")
    beside.replace(output / "scenes" / f"{name}.json")


def write_coco(output: Path, numbers: range) -> int:
    """Join what is known of all scenes into one file; returns the number of annotations."""
    scenes = [json.loads((output / "scenes" / f"{number:06d}.json").read_text(encoding="utf-8")) for number in numbers]
    listed = [entry | {"image_id": scene["image"]["id"]} for scene in scenes for entry in scene["annotations"]]
    content = {
        "info": {"description": "ESH Scatter: stones, mushrooms and sticks"},
        "images": [scene["image"] for scene in scenes],
        "categories": [{"id": index, "name": name} for index, name in enumerate(CLASSES, 1)],
        "annotations": [entry | {"id": index} for index, entry in enumerate(listed, 1)],
    }
    (output / "coco.json").write_text(json.dumps(content), encoding="utf-8")
    return len(listed)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="Render scenes with masks, depth and boxes.")
    parser.add_argument("--scenes", type=int, default=100, help="number of scenes (default: 100)")
    parser.add_argument("--first", type=int, default=0, help="number of the first scene (default: 0)")
    parser.add_argument("--output", type=Path, default=Path("output/dataset"))
    parser.add_argument("--size", type=int, nargs=2, default=(640, 480), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--samples", type=int, default=32, help="rays a pixel of the pictures (default: 32)")
    parser.add_argument("--device", default="auto", help="of the solver")
    options = parser.parse_args(arguments)
    for folder in ("images", "instances", "classes", "depth", "scenes"):
        (options.output / folder).mkdir(parents=True, exist_ok=True)
    numbers = range(options.first, options.first + options.scenes)
    left = [number for number in numbers if not (options.output / "scenes" / f"{number:06d}.json").exists()]
    start = time.perf_counter()
    for done, number in enumerate(left, 1):
        write_scene(number, options.output, tuple(options.size), options.samples, device=options.device)
        seconds = (time.perf_counter() - start) / done
        print(f"scene {number:06d}: {seconds:.1f} s a scene, {seconds * (len(left) - done):.0f} s left", flush=True)
    print(f"{write_coco(options.output, numbers)} instances in {len(numbers)} images: {options.output / 'coco.json'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
