"""A pebble beach: five kinds of stones of all sizes, none over another, around driftwood and a starfish.

    python demo_scenes/beach.py --output output

Every stone has a size of its own. The larger ones keep apart by their outlines, so that they lie close together however long they are.
Shells lie where the last high water has left them, between two altitudes. Below the water line stones are wet.
"""

from __future__ import annotations

import bpy
import esh
import numpy as np
import surface_shapes as shapes
from gallery_parts import Built, add, check_counts, check_overlaps, run, variants
from mathutils import Vector
from scene_parts import add_camera
from shader_nodes import Color, add_bump, add_node, calculate, color_ramp, mix_colors, new_material, noise, object_place
from shader_nodes import per_instance as random_of
from surface_materials import set_light

__all__ = ["build", "main", "test_final"]

SEED = 5
# Half of the width, and where the beach begins and ends [m]; the water line is near y = 1.
WIDE, NEAR, FAR = 1.6, -1.0, 2.5
# Areas of small, middling and large stones [m²].
SMALL, MIDDLING, LARGE = (0.0002, 0.0011), (0.0012, 0.005), (0.006, 0.019)
# Kind -> colors of its stones, size of its grains as a share of a stone, counts of small, middling and large ones.
STONES: dict[str, tuple[list[Color], float, tuple[int, int, int]]] = {
    "granite": ([(0.30, 0.29, 0.28), (0.44, 0.42, 0.40), (0.50, 0.44, 0.41)], 0.05, (700, 250, 40)),
    "slate": ([(0.07, 0.085, 0.10), (0.13, 0.15, 0.17), (0.16, 0.19, 0.19)], 0.6, (800, 260, 36)),
    "sandstone": ([(0.46, 0.30, 0.16), (0.56, 0.41, 0.25), (0.40, 0.25, 0.15)], 0.35, (500, 180, 28)),
    "quartz": ([(0.72, 0.69, 0.63), (0.80, 0.77, 0.72), (0.74, 0.63, 0.54)], 0.8, (260, 80, 10)),
    "jasper": ([(0.30, 0.075, 0.045), (0.36, 0.13, 0.075), (0.22, 0.07, 0.06)], 0.45, (220, 80, 10)),
}
SHELLS = 46


def ground_height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height of the beach above the water [m]: it falls towards the sea, over a step that the waves have made."""
    place = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    swell = (0.02 * shapes.waves(place, 1.1, 3, 2) + 0.004 * shapes.waves(place, 0.2, 4, 2)).reshape(x.shape)
    line = 1.0 + 0.12 * np.sin(1.7 * x + 0.6) - 0.1 * x
    return 0.085 * (line - y) + 0.02 * np.tanh(6.0 * (line - 0.3 - y)) + 0.02 + swell


def pebble(seed: int, narrowest: float = 0.62) -> shapes.Shape:
    """A stone that water has rounded: flat, some 10 cm long, a third of it in the ground; at its narrowest so wide as long."""
    random = np.random.default_rng(seed)
    vertex, face = shapes.ball(4)
    # Between a ball and a box, and never quite either.
    power = random.uniform(0.62, 0.9)
    vertex = np.sign(vertex) * np.abs(vertex) ** power
    vertex = vertex * (0.05, 0.05 * random.uniform(narrowest, 0.96), 0.05 * random.uniform(0.38, 0.6))
    outward = vertex / np.linalg.norm(vertex, axis=1, keepdims=True)
    vertex = vertex + (0.006 * shapes.waves(vertex, 0.11, seed + 50, 2))[:, None] * outward
    low, high = vertex[:, 2].min(), vertex[:, 2].max()
    return vertex - (0.0, 0.0, low + 0.3 * (high - low)), face


def shell(seed: int) -> shapes.Shape:
    """Half of a cockle that lies on its rim, ribbed."""
    random = np.random.default_rng(seed)
    rings, sides = 14, 61
    share = np.linspace(0.02, 1.0, rings)[:, None]
    angle = np.linspace(-1.15, 1.15, sides)
    reach = share * (1.0 + 0.035 * np.cos(26.0 * angle) * share) * np.cos(0.52 * angle) ** 0.5
    x, y = reach * np.cos(angle), reach * np.sin(angle) * 1.05
    high = 0.42 * np.sqrt(np.maximum(1.0 - (share - 0.42) ** 2 / 0.34, 0.0)) * np.cos(1.2 * angle) ** 0.4
    high = high * (1.0 + 0.05 * np.cos(26.0 * angle)) - 0.04
    vertex = np.stack([x - 0.5, y, high], axis=-1).reshape(-1, 3)
    return 0.016 * random.uniform(0.85, 1.15) * vertex, shapes.grid_faces(rings, sides)


def driftwood() -> shapes.Shape:
    """A branch that the sea has washed ashore, with the stump of a twig."""
    pieces = []
    for points, thick in (
        ([(-0.62, 0.0, 0.035), (-0.25, 0.05, 0.05), (0.1, 0.0, 0.045), (0.42, 0.07, 0.05), (0.66, 0.17, 0.075)],
         [0.034, 0.056, 0.05, 0.041, 0.02]),
        ([(0.08, 0.0, 0.05), (0.2, -0.07, 0.1), (0.27, -0.14, 0.15)], [0.036, 0.025, 0.016]),
    ):  # fmt: skip
        knots = np.linspace(0.0, 1.0, len(points))
        along = np.linspace(0.0, 1.0, 60)
        path = np.stack([np.interp(along, knots, c) for c in np.array(points).T], axis=1)
        for _ in range(60):
            path[1:-1] = 0.25 * path[:-2] + 0.5 * path[1:-1] + 0.25 * path[2:]
        way = np.gradient(path, axis=0)
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        side = np.cross(way, (0.0, 0.0, 1.0))
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        up = np.cross(side, way)
        turn = np.arange(40) * 2.0 * np.pi / 40
        ring = side[:, None] * np.cos(turn)[:, None] + up[:, None] * np.sin(turn)[:, None]
        reach = (
            np.interp(along, knots, thick)[:, None] * np.minimum(1.0, 30.0 * np.minimum(along, 1.0 - along))[:, None]
        )
        surface = (path[:, None] + reach[..., None] * ring).reshape(-1, 3)
        ridges = np.repeat(reach[:, 0], 40) * 0.16 * shapes.waves(surface * (0.25, 1.0, 1.0), 0.07, 9, 3)
        pieces.append((surface + ridges[:, None] * ring.reshape(-1, 3), shapes.grid_faces(60, 40, round_columns=True)))
    return shapes.joined(pieces)


def starfish() -> shapes.Shape:
    """A starfish of five bent arms, 22 cm across."""
    sides, rings = 160, 16
    angle = np.arange(sides) * 2.0 * np.pi / sides
    arm = np.abs((angle * 5.0 / (2.0 * np.pi)) % 1.0 - 0.5) * 2.0
    outline = 0.032 + 0.078 * arm**1.8
    share = np.linspace(1.0, 0.0, rings)[:, None]
    bend = angle + 0.22 * share**2 * np.sin(2.0 * angle + 0.6)
    reach = outline * share
    thick = 0.03 * np.sqrt(np.maximum(1.0 - share**2, 0.0)) * (0.45 + 0.55 * arm**1.5 * share + 0.4 * (1.0 - share))
    vertex = np.stack([reach * np.cos(bend), reach * np.sin(bend), thick], axis=-1).reshape(-1, 3)
    vertex[:, 2] += 0.0012 * np.maximum(shapes.waves(vertex, 0.012, 8, 2), 0.0) - 0.002
    return vertex, shapes.grid_faces(rings, sides, round_columns=True)


def _wetness(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
    """How wet a place is, 0..1: by its height above the water, with a ragged edge."""
    split = add_node(tree, "ShaderNodeSeparateXYZ")
    tree.links.new(add_node(tree, "ShaderNodeNewGeometry").outputs["Position"], split.inputs[0])
    ragged = calculate(tree, "MULTIPLY_ADD", noise(tree, 0.3, 5.0), 0.07, -0.035)
    height = calculate(tree, "ADD", split.outputs[2], ragged)
    return color_ramp(tree, calculate(tree, "MULTIPLY_ADD", height, 5.0, 0.3), [(0.42, (1.0,) * 3), (0.62, (0.0,) * 3)])


def _wettable(
    tree: bpy.types.NodeTree, color: bpy.types.NodeSocket, roughness: float, darker: float = 0.42
) -> bpy.types.Node:
    """A surface that is darker and shines where it is wet."""
    wet = _wetness(tree)
    surface = add_node(tree, "ShaderNodeBsdfPrincipled")
    dark = mix_colors(tree, 1.0, color, (darker,) * 3, "MULTIPLY")
    tree.links.new(mix_colors(tree, wet, color, dark), surface.inputs["Base Color"])
    tree.links.new(calculate(tree, "MULTIPLY_ADD", wet, 0.12 - roughness, roughness), surface.inputs["Roughness"])
    tree.links.new(surface.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return surface


def stone_material(name: str, colors: list[Color], grain: float) -> bpy.types.Material:
    """Stone, of which every instance has a color of its own, with grains or cloudy bands."""
    material, tree = new_material(name)
    base = color_ramp(tree, random_of(tree), [(i / (len(colors) - 1), c) for i, c in enumerate(colors)])
    place = object_place(tree, (1.0, 1.0, 2.2) if grain > 0.3 else (1.0, 1.0, 1.0))
    shade = color_ramp(
        tree, noise(tree, 0.1 * grain, 6.0, place), [(0.36, (0.62,) * 3), (0.5, (1.0,) * 3), (0.66, (1.34,) * 3)]
    )
    color = mix_colors(tree, 1.0, base, shade, "MULTIPLY")
    if name in ("slate", "jasper"):
        # A vein of quartz runs through some of them.
        layer = calculate(tree, "ABSOLUTE", calculate(tree, "SUBTRACT", noise(tree, 0.16, 1.5, place), 0.5))
        vein = color_ramp(tree, layer, [(0.004, (1.0,) * 3), (0.011, (0.0,) * 3)])
        color = mix_colors(tree, vein, color, (0.66, 0.63, 0.58))
    surface = _wettable(tree, color, 0.62)
    add_bump(tree, surface, noise(tree, 0.008, 6.0, place), 0.0012, 0.7)
    return material


def sand_material() -> bpy.types.Material:
    """Coarse sand and grit."""
    material, tree = new_material("Sand")
    grit = noise(tree, 0.009, 3.0)
    sand = color_ramp(tree, grit, [(0.3, (0.085, 0.07, 0.055)), (0.5, (0.21, 0.165, 0.12)), (0.72, (0.42, 0.35, 0.27))])
    # Grains of all colors, too small to be placed one by one.
    grains = add_node(tree, "ShaderNodeTexVoronoi")
    grains.inputs["Scale"].default_value = 95.0
    tree.links.new(add_node(tree, "ShaderNodeNewGeometry").outputs["Position"], grains.inputs["Vector"])
    hue = add_node(tree, "ShaderNodeSeparateColor")
    tree.links.new(grains.outputs["Color"], hue.inputs[0])
    kinds = color_ramp(
        tree,
        hue.outputs[0],
        [
            (0.0, (0.10, 0.11, 0.12)),
            (0.35, (0.34, 0.31, 0.28)),
            (0.6, (0.50, 0.38, 0.25)),
            (0.8, (0.66, 0.62, 0.56)),
            (1.0, (0.30, 0.12, 0.08)),
        ],
    )
    rim = color_ramp(tree, grains.outputs["Distance"], [(0.25, (1.0,) * 3), (0.62, (0.18,) * 3)])
    color = mix_colors(tree, 0.72, sand, mix_colors(tree, 1.0, kinds, rim, "MULTIPLY"))
    grit = calculate(tree, "SUBTRACT", calculate(tree, "MULTIPLY", grit, 0.3), grains.outputs["Distance"])
    surface = _wettable(tree, color, 0.9)
    add_bump(tree, surface, grit, 0.008, 1.0)
    return material


def plain(name: str, stops: list[tuple[float, Color]], wavelength: float, roughness: float) -> bpy.types.Material:
    """Wood, shells and a starfish."""
    material, tree = new_material(name)
    place = object_place(tree, (0.18, 1.0, 1.0) if name == "Driftwood" else (1.0, 1.0, 1.0))
    pattern = noise(tree, wavelength, 7.0, place)
    surface = _wettable(tree, color_ramp(tree, pattern, stops), roughness, 0.6)
    add_bump(tree, surface, pattern, 0.15 * wavelength, 0.8)
    return material


def water_material() -> bpy.types.Material:
    """Clear water, greener where it is deep, with foam where it is shallow."""
    material, tree = new_material("Water")
    ripple = calculate(tree, "ADD", noise(tree, 0.22, 3.0), calculate(tree, "MULTIPLY", noise(tree, 0.05, 2.0), 0.18))
    depth = add_node(tree, "ShaderNodeAttribute", attribute_name="depth").outputs["Fac"]
    glass = add_node(tree, "ShaderNodeBsdfPrincipled")
    glass.inputs["Roughness"].default_value = 0.03
    glass.inputs["IOR"].default_value = 1.33
    glass.inputs["Transmission Weight"].default_value = 1.0
    tint = color_ramp(tree, depth, [(0.0, (0.97, 0.99, 0.98)), (0.5, (0.42, 0.74, 0.72)), (1.0, (0.10, 0.36, 0.40))])
    tree.links.new(tint, glass.inputs["Base Color"])
    add_bump(tree, glass, ripple, 0.03, 0.55)
    foam = add_node(tree, "ShaderNodeBsdfPrincipled")
    foam.inputs["Base Color"].default_value = (0.86, 0.9, 0.9, 1.0)
    foam.inputs["Roughness"].default_value = 0.9
    cells = add_node(tree, "ShaderNodeTexVoronoi", feature="DISTANCE_TO_EDGE")
    cells.inputs["Scale"].default_value = 13.0
    place = add_node(tree, "ShaderNodeVectorMath", operation="ADD")
    tree.links.new(add_node(tree, "ShaderNodeNewGeometry").outputs["Position"], place.inputs[0])
    bend = add_node(tree, "ShaderNodeVectorMath", operation="SCALE")
    swirl = add_node(tree, "ShaderNodeTexNoise")
    swirl.inputs["Scale"].default_value = 7.0
    tree.links.new(swirl.outputs["Color"], bend.inputs[0])
    bend.inputs["Scale"].default_value = 0.16
    tree.links.new(bend.outputs[0], place.inputs[1])
    tree.links.new(place.outputs[0], cells.inputs["Vector"])
    band = color_ramp(
        tree,
        calculate(tree, "ADD", depth, calculate(tree, "MULTIPLY_ADD", noise(tree, 0.25, 3.0), 0.16, -0.08)),
        [(0.0, (0.30,) * 3), (0.045, (0.16,) * 3), (0.13, (0.02,) * 3), (0.17, (0.075,) * 3), (0.23, (0.0,) * 3)],
    )
    lace = calculate(tree, "LESS_THAN", cells.outputs["Distance"], band)
    mix = add_node(tree, "ShaderNodeMixShader")
    tree.links.new(lace, mix.inputs[0])
    tree.links.new(glass.outputs[0], mix.inputs[1])
    tree.links.new(foam.outputs[0], mix.inputs[2])
    # The sun shines through: without caustics, glass would throw the shadow of a stone.
    path = add_node(tree, "ShaderNodeLightPath")
    clear = add_node(tree, "ShaderNodeBsdfTransparent")
    tree.links.new(tint, clear.inputs["Color"])
    shadow = add_node(tree, "ShaderNodeMixShader")
    tree.links.new(path.outputs["Is Shadow Ray"], shadow.inputs[0])
    tree.links.new(mix.outputs[0], shadow.inputs[1])
    tree.links.new(clear.outputs[0], shadow.inputs[2])
    tree.links.new(shadow.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def _add_sea(step: float) -> None:
    """Add the water, and the ground below it and beside the beach, wider and farther than a camera sees."""
    aside = np.arange(0.0, 1.8, step)
    aside = np.concatenate([aside, np.geomspace(1.85, 16.0, 12)])
    away = np.concatenate([np.arange(0.4, 3.0, step), np.geomspace(3.05, 24.0, 12)])
    x, y = np.meshgrid(np.concatenate([-aside[:0:-1], aside]), away)
    height = ground_height(x, y)
    water = add("Water", shapes.grid(x, y, np.zeros_like(x)), water_material())
    depth = water.data.attributes.new("depth", "FLOAT", "POINT")
    depth.data.foreach_set("value", np.clip(-height / 0.16, 0.0, 1.0).ravel().astype(np.float32))
    add("Sea Floor", shapes.grid(x, y, height - 0.006), bpy.data.materials["Sand"])


def _add_driftwood() -> bpy.types.Object:
    """Lay a branch onto the sand."""
    wood = plain(
        "Driftwood", [(0.3, (0.20, 0.165, 0.13)), (0.55, (0.46, 0.40, 0.33)), (0.8, (0.62, 0.56, 0.48))], 0.03, 0.85
    )
    branch = add("Driftwood", driftwood(), wood)
    branch.location = (-0.5, 0.12, float(ground_height(np.array(-0.5), np.array(0.12))) - 0.012)
    branch.rotation_euler = (0.02, 0.03, 0.42)
    return branch


def _add_starfish() -> bpy.types.Object:
    """Lay a starfish onto the sand."""
    star = add(
        "Starfish", starfish(), plain("Starfish", [(0.3, (0.52, 0.11, 0.03)), (0.7, (0.78, 0.27, 0.07))], 0.012, 0.6)
    )
    star.location = (0.4, -0.16, float(ground_height(np.array(0.4), np.array(-0.16))) + 0.012)
    star.rotation_euler = (-0.06, 0.04, 0.5)
    return star


def build(device: str = "auto", quick: bool = False) -> Built:
    """Build the beach in an empty file."""
    scene = bpy.context.scene
    step = 0.06 if quick else 0.015
    x, y = np.meshgrid(np.arange(-WIDE, WIDE + step, step), np.arange(NEAR, FAR + step, step))
    height = ground_height(x, y)
    beach = add("Beach", shapes.grid(x, y, height), sand_material())
    _add_sea(0.2 if quick else 0.03)
    branch, star = _add_driftwood(), _add_starfish()
    share = 0.03 if quick else 1.0
    stones, gravel = {}, {}
    for number, (name, (colors, grain, _)) in enumerate(STONES.items()):
        rock = stone_material(name, colors, grain)
        stones[name] = variants(name, [(pebble(20 * number + k), None) for k in range(5)], rock)
        gravel[name] = variants(f"{name} gravel", [(pebble(20 * number + 9 + k, 0.88), None) for k in range(3)], rock)
    cream = plain(
        "Shell", [(0.3, (0.78, 0.66, 0.52)), (0.6, (0.86, 0.78, 0.68)), (0.8, (0.80, 0.52, 0.38))], 0.012, 0.4
    )
    shells = variants("Shell", [(shell(k), None) for k in range(3)], cream)
    bpy.context.view_layer.update()

    kinds = list(STONES)[:2] if quick else list(STONES)
    counts = {name: [max(round(share * n), 2) for n in reversed(STONES[name][2])] for name in kinds}

    # begin: scatter
    dry_enough = esh.AltitudeDensity(-0.12, 1.0, falloff=0.02)
    classes = [
        esh.ScatterClass(
            name,
            [
                esh.ScatterSize("large", large, stones[name], area=LARGE),
                esh.ScatterSize("middling", middling, stones[name], area=MIDDLING),
                esh.ScatterSize("small", small, gravel[name], area=SMALL, line=False),  # nearly round: discs will do
            ],
            density=dry_enough,
        )
        for name, (large, middling, small) in counts.items()
    ]
    high_water = esh.AltitudeDensity(0.055, 0.085, falloff=0.012)
    classes.append(
        esh.ScatterClass("shell", [esh.ScatterSize("any", max(round(share * SHELLS), 2), shells)], density=high_water)
    )
    result = esh.scatter(
        beach,
        classes,
        obstacles=[esh.ScatterObstacle(branch, margin=0.004), esh.ScatterObstacle(star, margin=0.006)],
        class_separation=0.4,
        size_emphasis=2.0,
        tilt=0.12,
        seed=SEED,
        device=device,
        max_steps=30 if quick else 80,
        name="Pebbles",
    )
    # end: scatter
    set_light(scene, (-0.85, 0.16, 0.6), 7.5, (0.60, 0.74, 0.92), 0.72, (1.0, 0.84, 0.64))
    scene.view_settings.exposure = 0.4
    camera = add_camera(scene, "Camera", (0.06, -1.62, 0.92), (0.0, 0.26, 0.02), lens=36.0, clip_end=60.0)
    camera.data.dof.use_dof, camera.data.dof.focus_distance, camera.data.dof.aperture_fstop = True, 1.75, 5.6
    scene.camera = camera
    return Built([result], {"keep off": [branch, star]})


def test_final(built: Built) -> dict[str, float]:
    """Check the beach: exact counts, no stone over another, nothing on the driftwood and the starfish, shells at the high water.

    Raises:
        AssertionError: Something is not as it should be; the message says what.
    """
    (result,) = built.results
    total = check_counts(built)
    overlaps = check_overlaps(built)
    place = result.instances.position
    for item in built.more["keep off"]:
        inside = _under(item, place)
        assert not inside.any(), f"{inside.sum()} stones lie under the {item.name.lower()}"
    off = np.abs(place[:, 2] - ground_height(place[:, 0], place[:, 1]))
    assert off.max() < 0.02, f"a stone lies {off.max():.3f} m off the ground"
    names = [c.name for c in result.placement.problem.classes]
    height = place[result.placement.class_index == names.index("shell"), 2]
    assert height.min() > 0.03 and height.max() < 0.11, f"shells lie from {height.min():.3f} to {height.max():.3f} m"
    return {"placed": total, "overlaps": overlaps, "covered": result.report.covered}


def _under(item: bpy.types.Object, place: np.ndarray) -> np.ndarray:
    """Which places ``[n, 3]`` lie over or under an object, seen from above."""
    inverse = item.matrix_world.inverted()
    down = inverse.to_3x3() @ Vector((0.0, 0.0, -1.0))
    return np.array(
        [item.ray_cast(inverse @ Vector((x, y, 10.0)), down, distance=100.0)[0] for x, y, _ in place.tolist()]
    )


def main(arguments: list[str] | None = None) -> None:
    """Run the scene from the command line."""
    run("beach", __doc__.splitlines()[0], build, test_final, seed=SEED, arguments=arguments)


if __name__ == "__main__":
    main()
