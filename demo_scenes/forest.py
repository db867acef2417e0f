"""A mixed forest on real land, from two density textures to a rendered picture, by one command.

    python demo_scenes/forest.py --output output

1. The ground: a real elevation model (``terrain.py``).
2. Two density textures made from altitude and slope, saved as PNG files and read back as images, as an artist would
   hand them over: pines high and steep, beeches low and gentle, clearings in both.
3. Trees by code (``trees.py``), two sizes of each class, three shape variants of each size.
4. One call of ``esh.scatter`` places all of them at once.
5. ``forest.blend``, ``forest-plan.png`` and, rendered by Cycles, ``forest.png``; the report; the scene's own checks.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path

import bpy
import esh
import materials
import numpy as np
import terrain as land
import trees
from scene_parts import add_camera, collection, mesh_object, save, save_textures, set_render

__all__ = ["build", "main", "test_final"]

SEED = 11
VARIANTS = 3
# class -> size -> (count, height [m], crown radius [m], footprint [m²]); the footprint is the disc under the crown.
TREES = {
    "pine": {"large": (1450, 20.0, 3.3), "small": (1800, 10.0, 1.9)},
    "beech": {"large": (700, 15.0, 4.2), "small": (900, 8.5, 2.5)},
}
COLORS = {"pine": (0.09, 0.30, 0.24), "beech": (0.85, 0.48, 0.12)}
# Where the picture is taken from, and at which point it looks: x, y, height above the ground [m].
EYE = (76.0, -262.0, 22.0)
AIM = (38.0, 20.0, 2.0)
# Meadows without trees along the valley's floor, from the camera onwards: x, y, radius [m].
CLEARINGS = ((74.0, -258.0, 38.0), (74.0, -208.0, 29.0), (64.0, -155.0, 18.0), (55.0, -105.0, 12.0))
SUN_ELEVATION = math.radians(23.0)
SUN_AZIMUTH = math.radians(238.0)


def footprint(crown_radius: float) -> float:
    """Area under a crown [m²]."""
    return math.pi * crown_radius**2


def tree_object(name: str, tree: trees.TreeMesh, surfaces: list[bpy.types.Material]) -> bpy.types.Object:
    """Make an object of a modeled tree; ``surfaces`` are its bark and its foliage."""
    item = mesh_object(name, tree.vertex, tree.face)
    for material in surfaces:
        item.data.materials.append(material)
    item.data.polygons.foreach_set("material_index", tree.material.astype(np.int32))
    tint = item.data.attributes.new("tint", "FLOAT", "FACE")
    tint.data.foreach_set("value", tree.tint.astype(np.float32))
    return item


def model_trees(scene: bpy.types.Scene) -> dict[tuple[str, str], bpy.types.Collection]:
    """Model every class and size in :data:`VARIANTS` shapes, one collection for each size."""
    pine_bark = materials.bark("Pine bark", (0.035, 0.024, 0.018), (0.11, 0.07, 0.05))
    beech_bark = materials.bark("Beech bark", (0.09, 0.085, 0.075), (0.24, 0.22, 0.19))
    needles = materials.foliage(
        "Needles", [(0.0, (0.03, 0.075, 0.035)), (0.5, (0.05, 0.105, 0.038)), (1.0, (0.085, 0.125, 0.04))], 0.35, 0.12
    )
    leaves = materials.foliage(
        "Beech leaves",
        [
            (0.0, (0.34, 0.075, 0.014)),
            (0.35, (0.50, 0.17, 0.018)),
            (0.7, (0.58, 0.30, 0.035)),
            (1.0, (0.33, 0.28, 0.05)),
        ],
        0.3,
        0.4,
    )
    library = collection("Tree library", scene.collection)
    library.hide_render = True
    made = {}
    for kind, sizes in TREES.items():
        for size, (_, height, radius) in sizes.items():
            members = collection(f"{kind} {size}", library)
            for variant in range(VARIANTS):
                seed = 100 * (size == "large") + variant
                factor = 1.0 + 0.1 * (variant - 1)
                if kind == "pine":
                    tree = trees.pine(height * factor, radius, 30 if size == "large" else 19, seed)
                else:
                    tree = trees.beech(height * factor, radius, 13 if size == "large" else 9,
                                       8000 if size == "large" else 3600, seed)  # fmt: skip
                surfaces = [pine_bark, needles] if kind == "pine" else [beech_bark, leaves]
                item = tree_object(f"{kind} {size} {variant + 1}", tree, surfaces)
                item["trunk_radius"] = tree.trunk_radius
                members.objects.link(item)
            made[kind, size] = members
    return made


def add_undergrowth(scene: bpy.types.Scene, terrain: land.Terrain) -> None:
    """Put grass and rocks before the camera, where one is near enough to see them; each shares one of a few meshes."""
    rng = np.random.default_rng(SEED)
    group = collection("Undergrowth", scene.collection)
    blade, stone = materials.grass("Grass"), materials.bark("Stone", (0.09, 0.085, 0.08), (0.30, 0.28, 0.25))
    tufts = [tree_object("Tuft", trees.grass_tuft(0.8, 46, seed), [stone, blade]).data for seed in range(4)]
    stones = [tree_object("Boulder", trees.boulder(1.0, seed), [stone]).data for seed in range(4)]
    ahead = math.atan2(AIM[1] - EYE[1], AIM[0] - EYE[0])
    for count, meshes, near, far, small, large in (
        (7000, tufts, 12.0, 150.0, 0.45, 1.3),
        (60, stones, 16.0, 110.0, 0.3, 1.9),
    ):
        distance = near + (far - near) * rng.random(count) ** 0.8
        angle = ahead + rng.uniform(-0.62, 0.62, count)
        x, y = EYE[0] + distance * np.cos(angle), EYE[1] + distance * np.sin(angle)
        z = terrain.height_at(x, y)
        for place in zip(x, y, z, strict=True):
            item = bpy.data.objects.new("Undergrowth", meshes[rng.integers(len(meshes))])
            item.location = place
            item.rotation_euler[2] = rng.uniform(0.0, 2.0 * math.pi)
            item.scale = [small + (large - small) * rng.random() ** 2] * 3
            group.objects.link(item)


def build(output: Path, max_steps: int = 100) -> tuple[esh.ScatterResult, land.Terrain, dict[str, np.ndarray]]:
    """Build the whole scene in an empty file.

    Args:
        output: Existing folder for the density textures.
        max_steps: Of the sampler.

    Returns:
        The scatter's result, the terrain and the density textures.
    """
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.unit_settings.system = "METRIC"
    terrain = land.load_terrain()
    low, high = float(terrain.height.min()), float(terrain.height.max())
    ground = mesh_object("Ground", *terrain.faces(), smooth=True)
    ground.data.materials.append(materials.ground("Ground", low, high, wooded=False))
    backdrop = mesh_object("Backdrop", *land.load_backdrop(), smooth=True)
    backdrop.data.materials.append(materials.ground("Distant forest", low, high, wooded=True))
    for item in (ground, backdrop):
        scene.collection.objects.link(item)
    # What was just linked is in the view layer only from now on.
    bpy.context.view_layer.update()

    # begin: scatter
    textures = land.density_textures(terrain, keep_clear=CLEARINGS)
    images = save_textures({f"forest-{kind}": texture for kind, texture in textures.items()}, output)
    sources = model_trees(scene)
    classes = [
        esh.ScatterClass(
            kind,
            [
                esh.ScatterSize(size, count, sources[kind, size], area=footprint(radius))
                for size, (count, _, radius) in sizes.items()
            ],
            density=esh.ImageDensity(images[f"forest-{kind}"]),
            color=COLORS[kind],
        )
        for kind, sizes in TREES.items()
    ]
    result = esh.scatter(
        ground, classes, seed=SEED, max_steps=max_steps, align_to_normal=0.1, scale_jitter=0.12, name="Forest"
    )
    # end: scatter
    for layer in scene.view_layers[0].layer_collection.children:
        if layer.name == "Tree library":
            layer.exclude = True
    add_undergrowth(scene, terrain)
    materials.set_sky(scene, SUN_ELEVATION, SUN_AZIMUTH)
    eye, aim = ((x, y, float(terrain.height_at([x], [y])[0]) + above) for x, y, above in (EYE, AIM))
    scene.camera = add_camera(scene, "Camera", eye, aim, lens=33.0, clip_end=20_000.0)
    return result, terrain, textures


def placed_trees(result: bpy.types.Object) -> dict[tuple[str, str], tuple[np.ndarray, np.ndarray]]:
    """Read what Blender really instances, as the renderer sees it.

    Returns:
        For every (class, size): the instances' matrices, shape ``[n, 4, 4]``, and the lowest ring of each trunk in the
        world, shape ``[n, k, 3]`` [m].
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    matrices: dict[str, list[np.ndarray]] = {}
    for instance in depsgraph.object_instances:
        if instance.is_instance and instance.parent.original == result:
            matrices.setdefault(instance.object.original.name, []).append(np.array(instance.matrix_world))
    found: dict[tuple[str, str], list[tuple[np.ndarray, np.ndarray]]] = {}
    for name, matrix in matrices.items():
        kind, size, _ = name.split(" ")
        mesh = bpy.data.objects[name].data
        vertex = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", vertex)
        vertex = vertex.reshape(-1, 3)
        ring = vertex[vertex[:, 2] < -0.9 * trees.ROOT_DEPTH]
        stack = np.stack(matrix)
        world = ring @ stack[:, :3, :3].transpose(0, 2, 1) + stack[:, None, :3, 3]
        found.setdefault((kind, size), []).append((stack, world))
    return {
        key: (np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts]))
        for key, parts in found.items()
    }


def test_final(
    result: esh.ScatterResult, terrain: land.Terrain, textures: dict[str, np.ndarray], blend: Path
) -> dict[str, float]:
    """Check the finished forest; the scene is read back from ``blend``, so nothing counts that was not saved.

    Returns:
        What was measured, by name.

    Raises:
        AssertionError: Something is not as it should be; the message says what.
    """
    name = result.object.name
    for entry in result.report.classes:
        for size in entry.sizes:
            asked = TREES[entry.name][size.name][0]
            assert size.asked == size.placed == asked, f"{entry.name} {size.name}: {asked} asked, {size.placed} placed"

    bpy.ops.wm.open_mainfile(filepath=str(blend.resolve()))
    for kind in textures:
        image = bpy.data.images.get(f"forest-{kind}.png")
        assert image and image.packed_file and image.filepath.startswith("//"), f"forest-{kind}.png is not in the file"
    found = placed_trees(bpy.data.objects[name])
    place, radius, trunk, kinds = [], [], [], []
    for kind, sizes in TREES.items():
        for size, (count, _, crown) in sizes.items():
            matrix, root = found[kind, size]
            assert len(matrix) == count, f"{kind} {size}: {count} asked, {len(matrix)} instances"
            above = matrix[:, 2, 3] - terrain.height_at(matrix[:, 0, 3], matrix[:, 1, 3])
            assert np.abs(above).max() < 0.1, f"{kind} {size}: a tree is {np.abs(above).max():.2f} m off the ground"
            root_above = root[..., 2] - terrain.height_at(root[..., 0], root[..., 1])
            assert root_above.max() < 0.0, f"{kind} {size}: a trunk ends {root_above.max():.2f} m above the ground"
            upright = matrix[:, 2, 2] / np.linalg.norm(matrix[:, :3, 2], axis=1)
            assert upright.min() > math.cos(math.radians(12.0)), f"{kind} {size}: a tree leans over"
            place.append(matrix[:, :2, 3])
            radius.append(np.full(count, crown))
            members = bpy.data.collections[f"{kind} {size}"].objects
            trunk.append(np.full(count, max(item["trunk_radius"] for item in members)))
            kinds.append(np.full(count, list(TREES).index(kind)))
    measured = _check_spacing(np.concatenate(place), np.concatenate(radius), np.concatenate(trunk))
    for index, (kind, texture) in enumerate(textures.items()):
        chosen = np.concatenate(kinds) == index
        measured[f"{kind}_texture_correlation"] = _check_texture(
            kind, np.round(255 * texture), np.concatenate(place)[chosen], np.concatenate(radius)[chosen], terrain
        )
    return measured


def _check_spacing(place: np.ndarray, radius: np.ndarray, trunk: np.ndarray) -> dict[str, float]:
    """No trunk stands in another's, none deep in another's crown, and crowns seldom reach far into each other."""
    deepest, meeting = np.inf, 0
    for i in range(len(place) - 1):
        distance = np.hypot(*(place[i + 1 :] - place[i]).T)
        assert (distance > 1.5 * (trunk[i] + trunk[i + 1 :])).all(), f"two trunks at {place[i]} are in one another"
        share = distance / (radius[i] + radius[i + 1 :])
        deepest = min(deepest, float(share.min()))
        meeting += int((share < 0.85).sum())
    assert deepest > 0.4, f"a tree stands in another: {deepest:.2f} of the sum of their crowns' radii apart"
    assert meeting < 0.05 * len(place), f"{meeting} pairs of crowns are in one another"
    return {"closest_crowns_over_touching_ones": deepest, "pairs_of_crowns_deep_in_each_other": float(meeting)}


def _check_texture(
    kind: str, texture: np.ndarray, place: np.ndarray, radius: np.ndarray, terrain: land.Terrain
) -> float:
    """Trees stand where their texture is, nowhere that it is black; returns the correlation of what is placed with it."""
    rows, columns = texture.shape
    column = np.clip(((place[:, 0] / terrain.size[0] + 0.5) * columns).astype(int), 0, columns - 1)
    row = np.clip(((0.5 - place[:, 1] / terrain.size[1]) * rows).astype(int), 0, rows - 1)
    near = np.pad(texture, 1, mode="edge")
    near = np.maximum.reduce([near[i : i + rows, j : j + columns] for i in range(3) for j in range(3)])
    astray = int((near[row, column] == 0).sum())
    assert astray == 0, f"{astray} trees of class {kind} stand where its texture is black"
    # Cells of 25 m or so: a handful of trees in each.
    cells = (max(rows // 13, 1), max(columns // 13, 1))
    edges = [np.linspace(0, n, c + 1) for n, c in zip(texture.shape, cells, strict=True)]
    placed, *_ = np.histogram2d(row + 0.5, column + 0.5, bins=edges, weights=radius**2)
    at_row, at_column = np.indices(texture.shape) + 0.5
    wanted, *_ = np.histogram2d(
        at_row.ravel(), at_column.ravel(), bins=edges, weights=(texture / np.cos(terrain.slope())).ravel()
    )
    correlation = float(np.corrcoef(placed.ravel(), wanted.ravel())[0, 1])
    assert correlation > 0.8, f"the texture of class {kind} is not to be recognized: correlation {correlation:.2f}"
    return correlation


def main(arguments: list[str] | None = None) -> None:
    """Run the scene from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder for the pictures and the .blend")
    parser.add_argument("--width", type=int, default=1280, help="width of the picture in pixels (16:9)")
    parser.add_argument("--samples", type=int, default=24, help="Cycles samples per pixel")
    parser.add_argument("--max-steps", type=int, default=100, help="steps of the sampler at most")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()

    def tell(text: str) -> None:
        print(f"[{time.perf_counter() - start:5.1f} s] {text}", flush=True)

    tell("building the ground and the trees, and placing them")
    result, terrain, textures = build(options.output, options.max_steps)
    print(result.report, flush=True)
    tell("built")
    esh.draw_plan(result.placement, options.output / "forest-plan.png", colors=list(COLORS.values()))
    scene = bpy.context.scene
    set_render(scene, options.width, round(options.width * 9 / 16), options.samples, SEED)
    scene.view_settings.exposure = 0.95
    blend = options.output / "forest.blend"
    save(blend)
    tell(f"wrote {blend} and forest-plan.png")
    scene.render.filepath = str((options.output / "forest.png").resolve())
    tell("rendering forest.png, which takes a minute or two")
    bpy.ops.render.render(write_still=True)
    tell("rendered forest.png")
    for key, value in test_final(result, terrain, textures, blend).items():
        print(f"{key}: {value:.3g}")
    tell("all checks passed")


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
