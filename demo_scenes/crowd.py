"""A crowd on a square that looks at a stage: people in coats of eight colors, tall and small, around a fountain and under trees.

    python demo_scenes/crowd.py --output output

The nearer to the stage, the denser they stand. They keep off the stage, the fountain, the trees and the lamps, and nobody stands in
another. All turn towards the stage, give or take as much as heads turn.
"""

from __future__ import annotations

import math
from itertools import pairwise

import bpy
import esh
import numpy as np
import surface_shapes as shapes
from gallery_parts import Built, add, check_counts, check_overlaps, run, seen, variants
from scene_parts import add_camera, collection
from shader_nodes import Color, add_bump, add_node, calculate, color_ramp, mix_colors, new_material, noise
from shader_nodes import per_instance as random_of
from surface_materials import glossy, leafy, mottled, set_light

__all__ = ["build", "main", "test_final"]

SEED = 12
# The square, around the origin [m]; the stage is at its northern end.
SQUARE = (44.0, 36.0)
STAGE = (0.0, 14.2)
STAGE_SIZE = (15.0, 6.0, 1.25)
# Where everybody looks: the middle of the stage.
LOOK_AT = (0.0, 13.4)
# How far a person may look to either side of it [rad].
SPREAD = math.radians(22.0)
FOUNTAIN = (-9.5, -3.0, 3.1)
TREES = ((-17.5, 7.0), (-17.5, -0.5), (-17.5, -8.0), (17.5, 7.0), (17.5, -0.5), (17.5, -8.0))
# Color of a coat -> how many grown-ups and children wear it.
COATS: dict[str, tuple[Color, int, int]] = {
    "red": ((0.58, 0.045, 0.035), 95, 16),
    "navy": ((0.03, 0.06, 0.17), 150, 12),
    "mustard": ((0.72, 0.40, 0.05), 85, 18),
    "teal": ((0.03, 0.27, 0.27), 85, 14),
    "cream": ((0.74, 0.66, 0.52), 100, 10),
    "brown": ((0.17, 0.085, 0.045), 110, 8),
    "sky": ((0.20, 0.42, 0.66), 80, 18),
    "pink": ((0.72, 0.25, 0.30), 60, 20),
}
# Ground that a grown-up and a child take [m²].
ROOM = {"grown-up": 0.21, "child": 0.12}
COAT, SKIN, HAIR, LEGS, SHOES = range(5)


def _ellipsoid(middle: tuple[float, float, float], half: tuple[float, float, float], detail: int = 3) -> shapes.Shape:
    vertex, face = shapes.ball(detail)
    return vertex * half + middle, face


def _limb(ends: list[tuple[float, float, float]], radii: list[float], sides: int = 10) -> shapes.Shape:
    """A rounded tube along points, of triangles."""
    path, reach = np.array(ends, float), np.array(radii)
    way = path[-1] - path[0]
    way /= np.linalg.norm(way)
    path = np.concatenate(
        [
            path[:1] - 0.9 * reach[0] * way,
            path[:1] - 0.5 * reach[0] * way,
            path,
            path[-1:] + 0.5 * reach[-1] * way,
            path[-1:] + 0.9 * reach[-1] * way,
        ]
    )
    reach = np.concatenate([[0.02 * reach[0], 0.82 * reach[0]], reach, [0.82 * reach[-1], 0.02 * reach[-1]]])
    side = np.cross(way, (0.31, 0.94, 0.1))
    side /= np.linalg.norm(side)
    other = np.cross(way, side)
    angle = np.arange(sides) * 2.0 * np.pi / sides
    ring = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * other
    vertex = (path[:, None] + reach[:, None, None] * ring).reshape(-1, 3)
    quads = shapes.grid_faces(len(path), sides, round_columns=True)
    return vertex, np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])


def person(seed: int, child: bool = False) -> tuple[shapes.Shape, np.ndarray]:
    """Somebody 1.7 m tall, or 1.15 m, who looks along y; and what each face is: coat, skin, hair, legs or shoes.

    ``seed`` chooses build, hair, and what the arms do.
    """
    random = np.random.default_rng(seed)
    pieces: list[tuple[shapes.Shape, int]] = []
    wide = random.uniform(0.92, 1.1)
    stance = random.uniform(0.08, 0.11)
    for side in (-1.0, 1.0):
        step = 0.05 * side * random.uniform(-1.0, 1.0)
        pieces.append((_limb([(side * stance, step, 0.09), (side * 0.09, 0.0, 0.78)], [0.062, 0.088]), LEGS))
        pieces.append((_ellipsoid((side * stance, step + 0.05, 0.05), (0.055, 0.125, 0.055), 2), SHOES))
    # A coat that widens downwards: rings from its hem to the shoulders.
    hem = random.choice([0.62, 0.72, 0.48])
    flare = random.uniform(1.0, 1.25)
    profile = [(hem, 0.205 * flare, 0.150 * flare), (hem + 0.02, 0.215 * flare, 0.160 * flare), (0.95, 0.185, 0.135),
               (1.15, 0.200, 0.140), (1.32, 0.215, 0.135), (1.40, 0.185, 0.115), (1.45, 0.090, 0.085), (1.46, 0.0, 0.0)]  # fmt: skip
    angle = np.arange(20) * 2.0 * np.pi / 20
    rings = [
        np.stack([wide * a * np.cos(angle), b * np.sin(angle), np.full(20, h)], 1)
        for h, a, b in [(hem, 0.0, 0.0), *profile]
    ]
    quads = shapes.grid_faces(len(rings), 20, round_columns=True)
    pieces.append(((np.concatenate(rings), np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])), COAT))
    pose = random.choice(["hang", "up", "one", "clap"], p=[0.42, 0.2, 0.2, 0.18])
    for side in (-1.0, 1.0):
        shoulder = (side * 0.215 * wide, 0.0, 1.34)
        if pose == "up" or (pose == "one" and side > 0.0):
            elbow, hand = (side * 0.31, 0.10, 1.50), (side * 0.27, 0.16, 1.82)
        elif pose == "clap":
            elbow, hand = (side * 0.28, 0.12, 1.10), (side * 0.05, 0.34, 1.26)
        else:
            elbow, hand = (side * 0.29 * wide, 0.0, 1.06), (side * 0.27 * wide, 0.07, 0.82)
        pieces.append((_limb([shoulder, elbow], [0.072, 0.06]), COAT))
        pieces.append((_limb([elbow, hand], [0.06, 0.046]), COAT))
        pieces.append((_ellipsoid(hand, (0.05, 0.05, 0.058), 2), SKIN))
    pieces.append((_limb([(0.0, 0.0, 1.42), (0.0, 0.01, 1.52)], [0.06, 0.056]), SKIN))
    pieces.append((_ellipsoid((0.0, 0.015, 1.63), (0.112, 0.122, 0.14)), SKIN))
    pieces.append((_ellipsoid((0.0, 0.145, 1.615), (0.02, 0.024, 0.026), 1), SKIN))
    kind = random.choice(["short", "long", "bun", "hat"])
    pieces.append((_ellipsoid((0.0, -0.018, 1.665), (0.124, 0.128, 0.128)), COAT if kind == "hat" else HAIR))
    if kind == "long":
        pieces.append((_ellipsoid((0.0, -0.055, 1.55), (0.122, 0.085, 0.19)), HAIR))
    elif kind == "bun":
        pieces.append((_ellipsoid((0.0, -0.07, 1.80), (0.062, 0.062, 0.058), 2), HAIR))
    elif kind == "hat":
        pieces.append((_ellipsoid((0.0, 0.0, 1.815), (0.042, 0.042, 0.042), 2), LEGS))
    shape = shapes.joined([piece for piece, _ in pieces])
    faces = np.concatenate([np.full(len(piece[1]), part) for piece, part in pieces])
    vertex = shape[0]
    if child:
        # Shorter, with a larger head.
        head = np.clip((vertex[:, 2:] - 1.42) / 0.1, 0.0, 1.0)
        vertex = 0.64 * vertex * (1.0 + head * (0.28, 0.28, 0.0)) + head * (0.0, 0.0, 0.18) * (vertex[:, 2:] - 1.42)
    return (vertex, shape[1]), faces


def _by_person(name: str, colors: list[Color], spread: int) -> bpy.types.Material:
    """One of some colors for each person; ``spread`` makes what is chosen differ from material to material."""
    material, tree = new_material(name)
    chance = calculate(tree, "FRACT", calculate(tree, "MULTIPLY", random_of(tree), float(spread)))
    color = color_ramp(tree, chance, [(i / len(colors), c) for i, c in enumerate(colors)])
    color.node.color_ramp.interpolation = "CONSTANT"
    surface = add_node(tree, "ShaderNodeBsdfPrincipled")
    tree.links.new(color, surface.inputs["Base Color"])
    surface.inputs["Roughness"].default_value = 0.75
    tree.links.new(surface.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def coat_material() -> bpy.types.Material:
    """Cloth in the color of the class, a little lighter or darker on each person."""
    material, tree = new_material("Coat")
    color = add_node(tree, "ShaderNodeAttribute", attribute_type="INSTANCER", attribute_name="class_color").outputs[
        "Color"
    ]
    shade = color_ramp(tree, random_of(tree), [(0.0, (0.7,) * 3), (1.0, (1.3,) * 3)])
    surface = add_node(tree, "ShaderNodeBsdfPrincipled")
    tree.links.new(mix_colors(tree, 1.0, color, shade, "MULTIPLY"), surface.inputs["Base Color"])
    surface.inputs["Roughness"].default_value = 0.85
    tree.links.new(surface.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def paving_material() -> bpy.types.Material:
    """Slabs of warm stone in rows, no two alike."""
    material, tree = new_material("Paving")
    place = add_node(tree, "ShaderNodeNewGeometry").outputs["Position"]
    bricks = add_node(tree, "ShaderNodeTexBrick")
    tree.links.new(place, bricks.inputs["Vector"])
    bricks.inputs["Scale"].default_value = 1.0
    bricks.inputs["Brick Width"].default_value, bricks.inputs["Row Height"].default_value = 1.1, 0.62
    bricks.inputs["Mortar Size"].default_value, bricks.inputs["Mortar Smooth"].default_value = 0.014, 0.2
    for name, color in (("Color1", (0.36, 0.30, 0.25)), ("Color2", (0.50, 0.43, 0.36)), ("Mortar", (0.17, 0.15, 0.13))):
        bricks.inputs[name].default_value = (*color, 1.0)
    stains = color_ramp(tree, noise(tree, 3.5, 6.0), [(0.3, (0.78,) * 3), (0.7, (1.16,) * 3)])
    surface = add_node(tree, "ShaderNodeBsdfPrincipled")
    tree.links.new(mix_colors(tree, 1.0, bricks.outputs["Color"], stains, "MULTIPLY"), surface.inputs["Base Color"])
    surface.inputs["Roughness"].default_value = 0.7
    add_bump(tree, surface, calculate(tree, "SUBTRACT", 1.0, bricks.outputs["Fac"]), 0.02, 0.5)
    tree.links.new(surface.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def glowing(name: str, color: Color, strength: float) -> bpy.types.Material:
    """What shines by itself."""
    material, tree = new_material(name)
    light = add_node(tree, "ShaderNodeEmission")
    light.inputs["Color"].default_value = (*color, 1.0)
    light.inputs["Strength"].default_value = strength
    tree.links.new(light.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def _boxes(*boxes: tuple[tuple[float, float, float], tuple[float, float, float]]) -> shapes.Shape:
    """Boxes on their undersides: size, and the middle of the underside."""
    made = []
    for size, (x, y, z) in boxes:
        vertex, face = shapes.box(size)
        made.append((vertex + (x, y, z + 0.5 * size[2]), face))
    return shapes.joined(made)


def _joined_by(pieces: list[tuple[shapes.Shape, int]]) -> tuple[shapes.Shape, np.ndarray]:
    return shapes.joined([piece for piece, _ in pieces]), np.concatenate([np.full(len(p[1]), k) for p, k in pieces])


def _link(
    name: str,
    made: tuple[shapes.Shape, np.ndarray],
    holder: bpy.types.Collection,
    *materials: bpy.types.Material,
    smooth: bool = False,
) -> bpy.types.Object:
    item = shapes.link(name, made[0], holder, smooth)
    for material in materials:
        item.data.materials.append(material)
    item.data.polygons.foreach_set("material_index", made[1].astype(np.int32))
    return item


def _add_stage(holder: bpy.types.Collection) -> None:
    """Add the stage: a platform with a roof on four masts, a screen, loudspeakers, lamps."""
    (x, y), (wide, deep, high) = STAGE, STAGE_SIZE
    dark = glossy("Stage Black", (0.018, 0.018, 0.022), roughness=0.5, coat=0.0)
    boards = mottled("Boards", [(0.3, (0.10, 0.06, 0.035)), (0.7, (0.17, 0.105, 0.06))], 0.6, roughness=0.6)
    steel = glossy("Steel", (0.34, 0.35, 0.37), roughness=0.4, coat=0.2)
    canvas = glossy("Canvas", (0.74, 0.12, 0.07), roughness=0.8, coat=0.0)
    screen = glowing("Screen", (1.0, 0.42, 0.12), 2.2)
    lamp = glowing("Lamp", (1.0, 0.80, 0.5), 14.0)
    back, front = y + 0.5 * deep, y - 0.5 * deep
    pieces = [
        (_boxes(((wide, deep, high - 0.06), (x, y, 0.0))), 0),
        (_boxes(((wide, deep, 0.06), (x, y, high - 0.06))), 1),
    ]
    masts = [(side * (0.5 * wide - 0.3), where) for side in (-1, 1) for where in (front + 0.3, back - 0.3)]
    pieces.append((_boxes(*[((0.32, 0.32, 6.6), (a, b, 0.0)) for a, b in masts]), 2))
    pieces.append((_boxes(((wide, 0.3, 0.3), (x, front + 0.3, 6.5)), ((wide, 0.3, 0.3), (x, back - 0.3, 6.5))), 2))
    roof = np.array(
        [
            (sx * (0.5 * wide + 0.5), yy, zz)
            for yy, zz in ((front - 1.0, 6.9), (y, 8.1), (back + 0.6, 6.9))
            for sx in (-1, 1)
        ]
    ) + (x, 0.0, 0.0)
    pieces.append(((roof, np.array([(0, 1, 3, 2), (2, 3, 5, 4)])), 3))
    valance = np.array([(sx * (0.5 * wide + 0.5) + x, front - 1.0, z) for z in (6.3, 6.9) for sx in (-1, 1)])
    pieces.append(((valance, np.array([(0, 1, 3, 2)])), 3))
    pieces.append((_boxes(((wide - 1.0, 0.2, 4.6), (x, back - 0.6, high))), 0))
    pieces.append((_boxes(((7.2, 0.1, 3.4), (x, back - 0.78, high + 0.8))), 4))
    speakers = [(side * (0.5 * wide + 1.1), front + 0.6, z) for side in (-1, 1) for z in (0.0, 1.5, 3.0)]
    pieces.append((_boxes(*[((1.3, 1.1, 1.42), place) for place in speakers]), 0))
    lamps = [(x + dx, front + 0.2, 6.15) for dx in np.linspace(-6.0, 6.0, 9)]
    pieces.append((_boxes(*[((0.34, 0.34, 0.34), place) for place in lamps]), 5))
    pieces.append((_boxes(((1.4, 0.9, 0.8), (x - 4.6, y + 1.4, high)), ((1.4, 0.9, 1.1), (x + 4.6, y + 1.4, high))), 0))
    _link("Stage", _joined_by(pieces), holder, dark, boards, steel, canvas, screen, lamp)
    for number, where in enumerate([front + 1.0, front + 2.2, front + 2.6, front + 3.4]):
        spot = bpy.data.lights.new("Spot", "SPOT")
        spot.energy, spot.spot_size, spot.shadow_soft_size = 900.0, 0.8, 0.2
        spot.color = ((1.0, 0.55, 0.35), (1.0, 0.8, 0.5), (0.9, 0.4, 0.7), (1.0, 0.7, 0.4))[number]
        item = bpy.data.objects.new("Spot", spot)
        item.location = (x + 3.2 * (number - 1.5), where, 6.4)
        holder.objects.link(item)


def _add_band(holder: bpy.types.Collection, parts: list[bpy.types.Material]) -> None:
    """Add four musicians, who look at the crowd."""
    x, y, high = STAGE[0], STAGE[1], STAGE_SIZE[2]
    black = glossy("Band", (0.03, 0.03, 0.035), roughness=0.7, coat=0.0)
    red = glossy("Guitar", (0.45, 0.03, 0.02), roughness=0.2)
    for number, (dx, dy) in enumerate(((0.0, -1.7), (-2.7, -1.0), (2.7, -1.0), (0.6, 1.2))):
        item = _link(f"Musician {number + 1}", person(300 + number), holder, black, *parts[1:], smooth=True)
        item.location = (x + dx, y + dy, high)
        item.rotation_euler[2] = math.pi + 0.15 * (number - 1)
    for dx, dy in ((-2.7, -1.32), (2.7, -1.32)):
        body = _ellipsoid((x + dx, y + dy, high + 1.05), (0.26, 0.07, 0.19))
        neck = _limb([(x + dx + 0.1, y + dy, high + 1.1), (x + dx + 0.85, y + dy, high + 1.42)], [0.035, 0.03])
        _link("Guitar", _joined_by([(body, 0), (neck, 0)]), holder, red, smooth=True)
    drums = [
        shapes.lathe(np.array([(0.0, 0.0), (r, 0.0), (r, h), (0.0, h)]), 24)
        for r, h in ((0.42, 0.6), (0.26, 0.35), (0.26, 0.35))
    ]
    placed = [
        (v + (x + a, y + b, high + c), f)
        for (v, f), (a, b, c) in zip(drums, ((0.6, 0.4, 0.0), (0.1, 0.5, 0.55), (1.1, 0.5, 0.55)), strict=True)
    ]
    _link("Drums", _joined_by([(piece, 0) for piece in placed]), holder, red)


def _add_fountain(holder: bpy.types.Collection) -> None:
    x, y, radius = FOUNTAIN
    stone = mottled("Fountain", [(0.3, (0.44, 0.40, 0.35)), (0.7, (0.58, 0.53, 0.46))], 0.8, roughness=0.7, bump=0.01)
    water = glossy("Fountain Water", (0.10, 0.26, 0.30), roughness=0.05, coat=1.0)
    rim = [
        (radius, 0.0),
        (radius, 0.55),
        (radius - 0.1, 0.62),
        (radius - 0.45, 0.62),
        (radius - 0.5, 0.5),
        (radius - 0.5, 0.2),
        (0.0, 0.2),
    ]
    column = [
        (0.55, 0.2),
        (0.5, 0.5),
        (0.26, 0.6),
        (0.22, 1.5),
        (0.4, 1.65),
        (1.25, 1.95),
        (1.28, 2.05),
        (1.1, 2.0),
        (0.22, 1.85),
        (0.18, 2.5),
        (0.3, 2.65),
        (0.0, 2.9),
    ]
    pool = [(radius - 0.48, 0.44), (0.0, 0.44)]
    bowl = [(1.15, 2.0), (0.0, 2.0)]
    pieces = [(shapes.lathe(np.array(p), 48), k) for p, k in ((rim, 0), (column, 0), (pool, 1), (bowl, 1))]
    shape, faces = _joined_by(pieces)
    _link("Fountain", ((shape[0] + (x, y, 0.0), shape[1]), faces), holder, stone, water)


def _add_trees(holder: bpy.types.Collection, leaves_of_bough: int) -> None:
    bark = mottled("Bark", [(0.3, (0.09, 0.06, 0.04)), (0.7, (0.2, 0.14, 0.09))], 0.3, roughness=0.95)
    leaves = leafy("Leaves", [(0.0, (0.10, 0.19, 0.03)), (0.5, (0.17, 0.26, 0.04)), (1.0, (0.26, 0.31, 0.05))])
    box = mottled("Planter", [(0.3, (0.22, 0.20, 0.18)), (0.7, (0.32, 0.29, 0.26))], 0.5, roughness=0.8)
    random = np.random.default_rng(SEED)
    for number, (x, y) in enumerate(TREES):
        tubes = [_limb([(0.0, 0.0, 0.3), (0.05, 0.0, 1.8), (0.0, 0.05, 3.6)], [0.19, 0.14, 0.08])]
        crown = []
        for _ in range(11):
            middle = random.normal(0.0, (0.75, 0.75, 0.55))
            crown.append(
                _leaves(
                    middle + (0.0, 0.0, 4.3), random.uniform(0.75, 1.05), int(random.integers(1 << 30)), leaves_of_bough
                )
            )
        trunk = shapes.joined(tubes)
        _link(
            f"Trunk {number + 1}",
            ((trunk[0] + (x, y, 0.0), trunk[1]), np.zeros(len(trunk[1]))),
            holder,
            bark,
            smooth=True,
        )
        top = shapes.joined(crown)
        _link(f"Crown {number + 1}", ((top[0] + (x, y, 0.0), top[1]), np.zeros(len(top[1]))), holder, leaves)
        _link(f"Planter {number + 1}", (_boxes(((1.9, 1.9, 0.5), (x, y, 0.0))), np.zeros(6)), holder, box)


def _leaves(middle: np.ndarray, radius: float, seed: int, count: int) -> shapes.Shape:
    """Leaves on a ball, bent outwards at random."""
    random = np.random.default_rng(seed)
    way = random.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    place = middle + radius * random.uniform(0.75, 1.05, (count, 1)) * way
    facing = way + random.normal(0.0, 0.55, (count, 3))
    along = np.cross(facing, random.normal(size=(count, 3)))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(facing / np.linalg.norm(facing, axis=1, keepdims=True), along)
    half = random.uniform(0.10, 0.17, (count, 1))
    corner = np.stack(
        [place - half * along, place + 0.6 * half * across, place + half * along, place - 0.6 * half * across], 1
    )
    return corner.reshape(-1, 3), np.arange(4 * count).reshape(-1, 4)


def _add_houses(holder: bpy.types.Collection) -> None:
    """Add rows of houses behind the stage and along the sides, each of its own color and height."""
    random = np.random.default_rng(SEED + 1)
    plaster = [
        (0.66, 0.43, 0.30),
        (0.70, 0.57, 0.38),
        (0.56, 0.36, 0.30),
        (0.60, 0.58, 0.52),
        (0.46, 0.52, 0.50),
        (0.72, 0.50, 0.40),
    ]
    walls = [
        mottled(f"Plaster {k + 1}", [(0.3, tuple(0.88 * c for c in color)), (0.7, color)], 2.0, roughness=0.9)
        for k, color in enumerate(plaster)
    ]
    tiles = mottled("Tiles", [(0.3, (0.22, 0.075, 0.045)), (0.7, (0.36, 0.14, 0.08))], 0.5, roughness=0.9, bump=0.02)
    glass, lit = glossy("Glass", (0.05, 0.07, 0.09), roughness=0.1), glowing("Lit", (1.0, 0.66, 0.30), 1.6)
    frame = glossy("Frames", (0.72, 0.69, 0.62), roughness=0.6, coat=0.0)
    for start, way, out in (
        ((-31.0, 21.5), (1.0, 0.0), (0.0, -1.0)),
        ((-24.0, 19.5), (0.0, -1.0), (1.0, 0.0)),
        ((24.0, 19.5), (0.0, -1.0), (-1.0, 0.0)),
    ):
        along = 0.0
        while along < (62.0 if way[0] else 50.0):
            wide, tall = random.uniform(6.0, 8.5), random.uniform(8.0, 12.0)
            _add_house(
                holder,
                start,
                way,
                out,
                along,
                wide,
                tall,
                random,
                [walls[random.integers(len(walls))], tiles, glass, lit, frame],
            )
            along += wide


def _add_house(
    holder: bpy.types.Collection,
    start: tuple[float, float],
    way: tuple[float, float],
    out: tuple[float, float],
    along: float,
    wide: float,
    tall: float,
    random: np.random.Generator,
    materials: list[bpy.types.Material],
) -> None:
    """A house with a gable, which stands so far along a row and looks out of it."""

    def placed(shape: shapes.Shape) -> shapes.Shape:
        # Modeled along x, with the front at y = 0 and the house behind it, at y > 0.
        vertex, face = shape
        x, y = vertex[:, 0] + along, vertex[:, 1]
        flat = np.array(start) + x[:, None] * np.array(way) - y[:, None] * np.array(out)
        return np.column_stack([flat, vertex[:, 2]]), face

    deep, rise = 8.0, 0.42 * wide
    pieces = [(_boxes(((wide, deep, tall), (0.5 * wide, 0.5 * deep, 0.0))), 0)]
    gable = np.array(
        [(0.0, 0.0, tall), (wide, 0.0, tall), (0.5 * wide, 0.0, tall + rise), (0.5 * wide, 0.0, tall + rise)]
    )
    pieces.append(((gable, np.array([(0, 1, 2, 3)])), 0))
    over = 0.25
    roof = np.array(
        [
            (x, y, z)
            for y in (-over, deep)
            for x, z in ((-over, tall - over), (0.5 * wide, tall + rise + 0.1), (wide + over, tall - over))
        ]
    )
    pieces.append(((roof, np.array([(0, 1, 4, 3), (1, 2, 5, 4)])), 1))
    columns, rows = max(round(wide / 2.2), 2), int(tall / 3.0)
    for row in range(rows):
        for column in range(columns):
            x = wide * (column + 0.5) / columns
            size = (1.0, 0.08, 1.55) if row else (1.25, 0.08, 2.1)
            z = 0.9 + 3.0 * row if row else 0.2
            pieces.append((_boxes(((size[0] + 0.25, 0.06, size[2] + 0.25), (x, -0.02, z - 0.12))), 4))
            pieces.append((_boxes((size, (x, -0.04, z))), 3 if random.random() < 0.28 else 2))
    shape, faces = _joined_by([(placed(piece), k) for piece, k in pieces])
    _link("House", (shape, faces), holder, *materials)


def _add_lights(holder: bpy.types.Collection) -> None:
    """Add strings of bulbs over the square."""
    bulb, wire = glowing("Bulb", (1.0, 0.72, 0.36), 9.0), glossy("Wire", (0.02, 0.02, 0.02), roughness=0.7, coat=0.0)
    pieces: list[tuple[shapes.Shape, int]] = []
    for y in (7.5, 0.5, -6.5):
        share = np.linspace(0.0, 1.0, 41)
        path = np.stack([-23.5 + 47.0 * share, np.full(41, y), 8.2 - 2.6 * 4.0 * share * (1.0 - share)], 1)
        for place in path[1:-1]:
            vertex, face = shapes.ball(2)
            pieces.append(((0.09 * vertex + place - (0.0, 0.0, 0.1), face), 0))
        for a, b in pairwise(path):
            pieces.append((_limb([tuple(a), tuple(b)], [0.012, 0.012], 4), 1))
    _link("Bulbs", _joined_by(pieces), holder, bulb, wire)


def _materials_of_people() -> list[bpy.types.Material]:
    """Make what people are colored with: coats, skin, hair, legs and shoes."""
    parts = [
        coat_material(),
        _by_person(
            "Skin",
            [(0.62, 0.37, 0.25), (0.72, 0.48, 0.35), (0.36, 0.19, 0.11), (0.55, 0.31, 0.19), (0.17, 0.085, 0.05)],
            7,
        ),
        _by_person(
            "Hair",
            [(0.03, 0.02, 0.015), (0.10, 0.05, 0.025), (0.42, 0.26, 0.10), (0.30, 0.11, 0.04), (0.45, 0.43, 0.40)],
            11,
        ),
        _by_person(
            "Legs",
            [(0.03, 0.045, 0.085), (0.06, 0.05, 0.045), (0.16, 0.13, 0.10), (0.10, 0.13, 0.19), (0.02, 0.02, 0.022)],
            13,
        ),
        glossy("Shoes", (0.03, 0.022, 0.018), roughness=0.5, coat=0.0),
    ]
    return parts


def _add_streets(paving: bpy.types.Material) -> None:
    """Add the ground beyond the square."""
    beyond = add(
        "Streets",
        (
            np.array([(-90, -90, -0.02), (90, -90, -0.02), (90, 90, -0.02), (-90, 90, -0.02)], float),
            np.array([(0, 1, 2, 3)]),
        ),
        paving,
    )
    beyond.hide_select = True


def build(device: str = "auto", quick: bool = False) -> Built:
    """Build the square in an empty file."""
    scene = bpy.context.scene
    wide, deep = 0.5 * np.array(SQUARE)
    x, y = np.meshgrid(np.linspace(-wide, wide, 45), np.linspace(-deep, deep, 37))
    square = add("Square", shapes.grid(x, y, 0.0 * x), paving_material())
    stage = collection("Stage and Loudspeakers", scene.collection)
    _add_stage(stage)
    stood = collection("Fountain and Trees", scene.collection)
    _add_fountain(stood)
    _add_trees(stood, 20 if quick else 420)
    parts = _materials_of_people()
    around = collection("Town", scene.collection)
    _add_band(around, parts)
    if not quick:
        _add_houses(around)
        _add_lights(around)
    _add_streets(square.data.materials[0])
    people = {
        "grown-up": variants("Grown-up", [person(k) for k in range(3 if quick else 16)], *parts),
        "child": variants("Child", [person(100 + k, child=True) for k in range(2 if quick else 8)], *parts),
    }
    bpy.context.view_layer.update()
    share, coats = (0.2, dict(list(COATS.items())[:2])) if quick else (1.0, COATS)

    # begin: scatter
    near_the_stage = esh.DensityStack(
        [
            esh.DensityLayer(esh.DistanceDensity(stage, near=2.0, far=30.0, falloff="sharp")),
            esh.DensityLayer(esh.NoiseDensity(scale=5.0, cover=0.8, softness=1.0, seed=3), strength=0.6),
        ]
    )
    classes = [
        esh.ScatterClass(
            coat,
            [
                esh.ScatterSize(size, max(round(share * count), 1), people[size], area=ROOM[size], line=False)
                for size, count in zip(ROOM, counts, strict=True)
            ],
            density=near_the_stage,
            color=color,
            look_at=esh.LookAt((*LOOK_AT, 0.0), SPREAD, front="y"),
        )
        for coat, (color, *counts) in coats.items()
    ]
    result = esh.scatter(
        square,
        classes,
        obstacles=[esh.ScatterObstacle(stage, margin=1.1), esh.ScatterObstacle(stood, margin=0.25)],
        class_separation=0.7,
        align_to_normal=0.0,
        scale_jitter=0.07,
        seed=SEED,
        device=device,
        max_steps=30 if quick else 60,
        name="Crowd",
    )
    # end: scatter
    set_light(scene, (-0.42, -0.72, 0.60), 4.6, (0.46, 0.58, 0.86), 0.7, (1.0, 0.74, 0.48))
    scene.view_settings.exposure = 0.3
    scene.camera = add_camera(scene, "Camera", (7.5, -25.0, 9.8), (-1.2, 4.6, 1.9), lens=33.0, clip_end=300.0)
    return Built([result], {"stage": stage, "stood": stood})


def test_final(built: Built) -> dict[str, float]:
    """Check the crowd: exact counts, nobody in another or on the stage or in the fountain, and all look at the stage.

    Raises:
        AssertionError: Something is not as it should be; the message says what.
    """
    total = check_counts(built)
    overlaps = check_overlaps(built)
    matrix = seen(built.results[0])
    place = matrix[:, :2, 3]
    (x, y), (wide, deep, _) = STAGE, STAGE_SIZE
    off = np.maximum(np.abs(place[:, 0] - x) - 0.5 * wide, np.abs(place[:, 1] - y) - 0.5 * deep)
    assert off.min() > 1.0, f"somebody stands {off.min():.2f} m from the stage"
    dry = np.hypot(place[:, 0] - FOUNTAIN[0], place[:, 1] - FOUNTAIN[1]) - FOUNTAIN[2]
    assert dry.min() > 0.2, f"somebody stands {dry.min():.2f} m from the fountain"
    for tree in TREES:
        assert np.abs(place - tree).max(axis=1).min() > 0.95, f"somebody stands in the planter at {tree}"
    forward = matrix[:, :2, 1] / np.linalg.norm(matrix[:, :3, 1], axis=1, keepdims=True)
    to = np.array(LOOK_AT) - place
    to /= np.linalg.norm(to, axis=1, keepdims=True)
    angle = np.arccos(np.clip((forward * to).sum(axis=1), -1.0, 1.0))
    assert angle.max() < SPREAD + 1e-3, f"somebody looks {math.degrees(angle.max()):.1f} degrees past the stage"
    upright = matrix[:, 2, 2] / np.linalg.norm(matrix[:, :3, 2], axis=1)
    assert upright.min() > 0.9999, "somebody does not stand upright"
    front = place[:, 1] > np.median(place[:, 1])
    return {
        "placed": total,
        "overlaps": overlaps,
        "in the front half": front.mean(),
        "most past the stage": angle.max(),
    }


def main(arguments: list[str] | None = None) -> None:
    """Run the scene from the command line."""
    run("crowd", __doc__.splitlines()[0], build, test_final, seed=SEED, arguments=arguments)


if __name__ == "__main__":
    main()
