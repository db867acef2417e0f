"""Materials and light of the pizzas, built as node trees."""

from __future__ import annotations

import bpy
from mathutils import Vector
from shader_nodes import (
    Color,
    add_bump,
    add_node,
    attribute,
    calculate,
    color_ramp,
    connect,
    mix_colors,
    new_material,
    noise,
    object_place,
    per_instance,
)

__all__ = ["anchovy", "bed", "calyx", "chilli", "dough", "ham", "mushroom", "salami", "set_light", "wood"]


def _food(
    tree: bpy.types.NodeTree,
    color: object,
    *,
    roughness: object = 0.4,
    below: tuple[float, Color] | None = None,
    oil: object = 0.0,
) -> bpy.types.Node:
    """A moist surface.

    Args:
        tree: Where the node is made.
        color: Of the surface.
        roughness: Of its own shine.
        below: How far light spreads under the surface [m], and which color spreads how far.
        oil: Weight of a clear film over it.
    """
    node = add_node(tree, "ShaderNodeBsdfPrincipled")
    connect(tree, color, node.inputs["Base Color"])
    connect(tree, roughness, node.inputs["Roughness"])
    connect(tree, oil, node.inputs["Coat Weight"])
    node.inputs["Coat Roughness"].default_value = 0.12
    node.inputs["Coat IOR"].default_value = 1.46
    node.inputs["Specular IOR Level"].default_value = 0.45
    if below:
        # Light that spreads by a diffusion profile: random walks take several times as long.
        node.subsurface_method = "BURLEY"
        node.inputs["Subsurface Weight"].default_value = 0.55
        node.inputs["Subsurface Scale"].default_value = below[0]
        node.inputs["Subsurface Radius"].default_value = below[1]
    return node


def _output(tree: bpy.types.NodeTree, surface: bpy.types.Node) -> None:
    tree.links.new(surface.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])


def _vary(tree: bpy.types.NodeTree, color: bpy.types.NodeSocket, low: Color, high: Color) -> bpy.types.NodeSocket:
    """Give every piece a shade of its own, between two factors."""
    return mix_colors(tree, 1.0, color, color_ramp(tree, per_instance(tree), [(0.0, low), (1.0, high)]), "MULTIPLY")


def _cells(tree: bpy.types.NodeTree, size: float, place: bpy.types.NodeSocket, output: str) -> bpy.types.NodeSocket:
    """Cells of about ``size`` [m]: ``"Distance"`` from their middles, in cells, or their ``"Color"``."""
    node = add_node(tree, "ShaderNodeTexVoronoi")
    node.inputs["Scale"].default_value = 1.0 / size
    tree.links.new(place, node.inputs["Vector"])
    return node.outputs[output]


def _distort(
    tree: bpy.types.NodeTree, place: bpy.types.NodeSocket, wavelength: float, by: float
) -> bpy.types.NodeSocket:
    """Shift a place by noise, up to ``by`` [m]."""
    texture = add_node(tree, "ShaderNodeTexNoise")
    texture.inputs["Scale"].default_value = 1.0 / wavelength
    tree.links.new(place, texture.inputs["Vector"])
    shift = add_node(tree, "ShaderNodeVectorMath", operation="MULTIPLY_ADD")
    tree.links.new(texture.outputs["Color"], shift.inputs[0])
    shift.inputs[1].default_value = (2.0 * by,) * 3
    tree.links.new(place, shift.inputs[2])
    return shift.outputs[0]


def dough() -> bpy.types.Material:
    """Crust: pale and floury below, golden to dark brown where it was nearest the fire."""
    material, tree = new_material("Crust")
    place = object_place(tree)
    fine = noise(tree, 0.004, 6.0, place)
    baked = calculate(tree, "ADD", attribute(tree, "brown"), calculate(tree, "MULTIPLY_ADD", fine, 0.24, -0.12))
    color = color_ramp(
        tree,
        baked,
        [
            (0.0, (0.80, 0.60, 0.33)),
            (0.22, (0.74, 0.46, 0.17)),
            (0.45, (0.58, 0.27, 0.065)),
            (0.68, (0.34, 0.115, 0.024)),
            (0.88, (0.115, 0.036, 0.012)),
            (1.0, (0.035, 0.016, 0.010)),
        ],
    )
    dust = calculate(
        tree,
        "MULTIPLY",
        attribute(tree, "flour"),
        color_ramp(tree, noise(tree, 0.0016, 3.0, place), [(0.35, (0.0,) * 3), (0.7, (0.75,) * 3)]),
    )
    color = mix_colors(tree, dust, color, (0.86, 0.80, 0.70))
    surface = _food(tree, color, roughness=0.55, below=(0.003, (1.0, 0.55, 0.25)), oil=0.06)
    add_bump(tree, surface, noise(tree, 0.0022, 5.0, place), 0.0006, 0.55)
    _output(tree, surface)
    return material


def bed() -> bpy.types.Material:
    """Tomato sauce, and cheese over it: orange where it is thin, cream where it is thick, brown where it is toasted."""
    material, tree = new_material("Sauce and cheese")
    place = object_place(tree)
    pulp = noise(tree, 0.005, 6.0, place)
    sauce = color_ramp(
        tree, pulp, [(0.3, (0.36, 0.022, 0.006)), (0.55, (0.55, 0.050, 0.010)), (0.75, (0.66, 0.11, 0.018))]
    )
    cheese = attribute(tree, "cheese")
    uneven = calculate(
        tree, "ADD", cheese, calculate(tree, "MULTIPLY_ADD", noise(tree, 0.007, 4.0, place), 0.36, -0.18)
    )
    melted = color_ramp(
        tree,
        uneven,
        [
            (0.10, (0.62, 0.115, 0.016)),
            (0.34, (0.74, 0.27, 0.040)),
            (0.60, (0.84, 0.50, 0.16)),
            (0.95, (0.86, 0.68, 0.39)),
        ],
    )
    share = color_ramp(tree, uneven, [(0.06, (0.0,) * 3), (0.30, (1.0,) * 3)])
    color = mix_colors(tree, share, sauce, melted)
    toast = calculate(
        tree,
        "ADD",
        attribute(tree, "toast"),
        calculate(tree, "MULTIPLY_ADD", noise(tree, 0.003, 4.0, place), 0.3, -0.16),
    )
    browned = color_ramp(
        tree, toast, [(0.30, (0.74, 0.34, 0.06)), (0.58, (0.42, 0.14, 0.022)), (0.90, (0.13, 0.04, 0.012))]
    )
    color = mix_colors(tree, color_ramp(tree, toast, [(0.12, (0.0,) * 3), (0.46, (1.0,) * 3)]), color, browned)
    # Oregano.
    herb = _cells(tree, 0.0052, _distort(tree, place, 0.002, 0.0012), "Distance")
    where = color_ramp(tree, noise(tree, 0.018, 2.0, place), [(0.48, (0.0,) * 3), (0.56, (1.0,) * 3)])
    fleck = calculate(tree, "MULTIPLY", color_ramp(tree, herb, [(0.13, (1.0,) * 3), (0.17, (0.0,) * 3)]), where)
    color = mix_colors(tree, calculate(tree, "MULTIPLY", fleck, 0.85), color, (0.045, 0.065, 0.012))
    film = color_ramp(tree, noise(tree, 0.02, 3.0, place), [(0.35, (0.25,) * 3), (0.65, (0.9,) * 3)])
    surface = _food(tree, color, roughness=0.36, below=(0.004, (1.0, 0.45, 0.16)), oil=film)
    relief = calculate(tree, "ADD", noise(tree, 0.0045, 5.0, place), calculate(tree, "MULTIPLY", fleck, 0.6))
    add_bump(tree, surface, relief, 0.0011, 0.5)
    _output(tree, surface)
    return material


def salami() -> bpy.types.Material:
    """Dark red meat with specks of fat of two sizes, glistening."""
    material, tree = new_material("Salami")
    place = object_place(tree)
    grain = noise(tree, 0.003, 5.0, place)
    meat = color_ramp(
        tree, grain, [(0.30, (0.17, 0.013, 0.010)), (0.52, (0.33, 0.030, 0.018)), (0.72, (0.46, 0.065, 0.035))]
    )
    bent = _distort(tree, place, 0.003, 0.0011)
    large = color_ramp(tree, _cells(tree, 0.0052, bent, "Distance"), [(0.25, (1.0,) * 3), (0.33, (0.0,) * 3)])
    small = color_ramp(tree, _cells(tree, 0.0024, bent, "Distance"), [(0.22, (0.85,) * 3), (0.32, (0.0,) * 3)])
    fat = calculate(tree, "MAXIMUM", large, small)
    color = mix_colors(tree, fat, meat, (0.80, 0.50, 0.34))
    color = _vary(tree, color, (0.80, 0.76, 0.72), (1.12, 1.05, 1.0))
    color = mix_colors(tree, calculate(tree, "MULTIPLY", attribute(tree, "rim"), 0.8), color, (0.12, 0.012, 0.006))
    surface = _food(tree, color, roughness=0.34, below=(0.002, (1.0, 0.30, 0.18)), oil=0.4)
    add_bump(tree, surface, calculate(tree, "SUBTRACT", grain, calculate(tree, "MULTIPLY", fat, 0.25)), 0.0006, 0.5)
    _output(tree, surface)
    return material


def ham() -> bpy.types.Material:
    """Cooked ham: pink, with paler fibers, browned along folds and edges."""
    material, tree = new_material("Ham")
    place = object_place(tree)
    streak = noise(tree, 0.006, 5.0, _distort(tree, object_place(tree, (1.0, 0.4, 1.0)), 0.012, 0.004))
    color = color_ramp(
        tree,
        streak,
        [
            (0.28, (0.55, 0.17, 0.12)),
            (0.48, (0.68, 0.28, 0.20)),
            (0.64, (0.74, 0.37, 0.27)),
            (0.78, (0.80, 0.54, 0.42)),
        ],
    )
    color = _vary(tree, color, (0.88, 0.82, 0.78), (1.06, 1.03, 1.0))
    scorch = color_ramp(tree, noise(tree, 0.008, 3.0, place), [(0.40, (0.0,) * 3), (0.70, (0.8,) * 3)])
    exposed = calculate(
        tree, "MAXIMUM", attribute(tree, "edge"), calculate(tree, "MULTIPLY", attribute(tree, "fold"), 0.8)
    )
    color = mix_colors(tree, calculate(tree, "MULTIPLY", exposed, scorch), color, (0.36, 0.095, 0.035))
    surface = _food(tree, color, roughness=0.42, below=(0.003, (1.0, 0.32, 0.22)), oil=0.16)
    add_bump(tree, surface, noise(tree, 0.0020, 5.0, place), 0.0006, 0.6)
    _output(tree, surface)
    return material


def mushroom() -> bpy.types.Material:
    """Champignon: cream flesh, brown skin and gills, golden where it was roasted."""
    material, tree = new_material("Mushroom")
    place = object_place(tree)
    roast = noise(tree, 0.007, 5.0, place)
    color = color_ramp(
        tree,
        roast,
        [
            (0.30, (0.74, 0.60, 0.42)),
            (0.48, (0.66, 0.48, 0.28)),
            (0.62, (0.50, 0.29, 0.125)),
            (0.78, (0.32, 0.15, 0.052)),
        ],
    )
    color = mix_colors(tree, calculate(tree, "MULTIPLY", attribute(tree, "edge"), 0.45), color, (0.52, 0.29, 0.12))
    color = mix_colors(tree, calculate(tree, "MULTIPLY", attribute(tree, "skin"), 0.85), color, (0.24, 0.105, 0.040))
    lamella = noise(tree, 0.0014, 2.0, object_place(tree, (1.0, 0.15, 1.0)))
    dark = color_ramp(tree, lamella, [(0.35, (0.055, 0.026, 0.014)), (0.65, (0.20, 0.10, 0.05))])
    color = mix_colors(tree, calculate(tree, "MULTIPLY", attribute(tree, "gills"), 0.92), color, dark)
    color = _vary(tree, color, (0.84, 0.82, 0.78), (1.05, 1.04, 1.02))
    surface = _food(tree, color, roughness=0.48, below=(0.003, (1.0, 0.62, 0.35)), oil=0.28)
    add_bump(tree, surface, noise(tree, 0.0022, 5.0, place), 0.0005, 0.5)
    _output(tree, surface)
    return material


def chilli() -> bpy.types.Material:
    """Red pods, some of them still orange, with a tight waxy skin."""
    material, tree = new_material("Chilli")
    place = object_place(tree)
    hue = color_ramp(
        tree,
        per_instance(tree),
        [(0.0, (0.50, 0.008, 0.004)), (0.7, (0.66, 0.018, 0.005)), (1.0, (0.70, 0.075, 0.006))],
    )
    blotch = color_ramp(tree, noise(tree, 0.012, 3.0, place), [(0.45, (1.0,) * 3), (0.8, (0.55, 0.45, 0.4))])
    color = mix_colors(tree, 1.0, hue, blotch, "MULTIPLY")
    surface = _food(tree, color, roughness=0.26, below=(0.002, (1.0, 0.2, 0.1)), oil=0.9)
    add_bump(tree, surface, noise(tree, 0.006, 2.0, place), 0.0006, 0.25)
    _output(tree, surface)
    return material


def calyx() -> bpy.types.Material:
    """The green stem of a chilli."""
    material, tree = new_material("Chilli stem")
    color = color_ramp(
        tree, noise(tree, 0.005, 3.0, object_place(tree)), [(0.3, (0.07, 0.14, 0.018)), (0.7, (0.19, 0.26, 0.045))]
    )
    _output(tree, _food(tree, color, roughness=0.5, oil=0.2))
    return material


def anchovy() -> bpy.types.Material:
    """Anchovy in oil: rosy brown flesh, dark along the middle, a remainder of silver skin along its edges."""
    material, tree = new_material("Anchovy")
    fiber = noise(tree, 0.0032, 5.0, object_place(tree, (0.35, 1.8, 1.0)))
    color = color_ramp(
        tree, fiber, [(0.30, (0.20, 0.050, 0.022)), (0.5, (0.40, 0.135, 0.062)), (0.70, (0.60, 0.29, 0.165))]
    )
    away = calculate(tree, "ABSOLUTE", calculate(tree, "SUBTRACT", attribute(tree, "across"), 0.5))
    middle = color_ramp(tree, away, [(0.02, (0.85,) * 3), (0.10, (0.0,) * 3)])
    color = mix_colors(tree, middle, color, (0.12, 0.026, 0.014))
    patch = color_ramp(tree, noise(tree, 0.007, 3.0, object_place(tree)), [(0.40, (0.0,) * 3), (0.62, (0.8,) * 3)])
    edge = color_ramp(tree, away, [(0.26, (0.0,) * 3), (0.44, (1.0,) * 3)])
    silver = calculate(tree, "MULTIPLY", patch, edge)
    color = mix_colors(tree, silver, color, (0.50, 0.47, 0.43))
    color = _vary(tree, color, (0.80, 0.78, 0.76), (1.15, 1.12, 1.1))
    surface = _food(tree, color, roughness=0.36, below=(0.002, (1.0, 0.4, 0.25)), oil=0.45)
    connect(tree, calculate(tree, "MULTIPLY", silver, 0.4), surface.inputs["Metallic"])
    add_bump(tree, surface, fiber, 0.0009, 0.8)
    _output(tree, surface)
    return material


def wood(
    name: str, dark: Color, light: Color, *, plank: float | None = None, shine: float = 0.45
) -> bpy.types.Material:
    """Wood with its grain along x.

    Args:
        name: Of the material.
        dark: Late wood.
        light: Early wood.
        plank: Width of the planks it is joined from [m]; None is one piece.
        shine: Roughness.
    """
    material, tree = new_material(name)
    place = object_place(tree)
    gap: object = 0.0
    if plank:
        split = add_node(tree, "ShaderNodeSeparateXYZ")
        tree.links.new(place, split.inputs[0])
        row = calculate(tree, "DIVIDE", split.outputs[1], plank)
        number = calculate(tree, "FLOOR", row)
        part = calculate(tree, "ABSOLUTE", calculate(tree, "SUBTRACT", calculate(tree, "FRACT", row), 0.5))
        gap = color_ramp(tree, part, [(0.480, (0.0,) * 3), (0.492, (1.0,) * 3)])
        shift = add_node(tree, "ShaderNodeCombineXYZ")
        for socket, factor in zip(shift.inputs, (0.731, 0.0, 1.37), strict=True):
            connect(tree, calculate(tree, "MULTIPLY", number, factor), socket)
        total = add_node(tree, "ShaderNodeVectorMath", operation="ADD")
        tree.links.new(place, total.inputs[0])
        tree.links.new(shift.outputs[0], total.inputs[1])
        place = total.outputs[0]
    stretched = add_node(tree, "ShaderNodeVectorMath", operation="MULTIPLY")
    tree.links.new(_distort(tree, place, 0.25, 0.012), stretched.inputs[0])
    stretched.inputs[1].default_value = (0.10, 1.0, 1.0)
    ring = add_node(tree, "ShaderNodeTexWave", wave_type="RINGS", rings_direction="X")
    ring.inputs["Scale"].default_value = 14.0
    ring.inputs["Distortion"].default_value = 5.0
    ring.inputs["Detail"].default_value = 3.0
    ring.inputs["Detail Scale"].default_value = 2.0
    tree.links.new(stretched.outputs[0], ring.inputs["Vector"])
    fiber_place = add_node(tree, "ShaderNodeVectorMath", operation="MULTIPLY")
    tree.links.new(place, fiber_place.inputs[0])
    fiber_place.inputs[1].default_value = (0.04, 1.0, 1.0)
    fiber = noise(tree, 0.0018, 4.0, fiber_place.outputs[0])
    tone = calculate(
        tree, "ADD", calculate(tree, "MULTIPLY", ring.outputs["Fac"], 0.45), calculate(tree, "MULTIPLY", fiber, 0.55)
    )
    color = color_ramp(tree, tone, [(0.15, dark), (0.75, light)])
    stain = color_ramp(tree, noise(tree, 0.11, 4.0, place), [(0.3, (0.72,) * 3), (0.7, (1.1,) * 3)])
    color = mix_colors(tree, 1.0, color, stain, "MULTIPLY")
    if plank:
        color = mix_colors(tree, gap, color, (0.006, 0.004, 0.003))
    surface = add_node(tree, "ShaderNodeBsdfPrincipled")
    tree.links.new(color, surface.inputs["Base Color"])
    surface.inputs["Roughness"].default_value = shine
    surface.inputs["Specular IOR Level"].default_value = 0.35
    height = calculate(tree, "SUBTRACT", fiber, calculate(tree, "MULTIPLY", gap, 2.5)) if plank else fiber
    add_bump(tree, surface, height, 0.0010, 0.35)
    _output(tree, surface)
    return material


def _lamp(scene: bpy.types.Scene, name: str, place: tuple, size: float, power: float, color: Color) -> None:
    """Add a round, soft lamp that looks at the origin; size [m], power [W]."""
    light = bpy.data.lights.new(name, "AREA")
    light.shape, light.size, light.energy, light.color = "DISK", size, power, color
    lamp = bpy.data.objects.new(name, light)
    lamp.location = place
    lamp.rotation_euler = (-Vector(place)).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(lamp)


def set_light(scene: bpy.types.Scene) -> None:
    """Light food as a photographer does: a window from behind and the left, a warm fill from the front, a dim room."""
    _lamp(scene, "Window", (-2.0, 1.35, 1.9), 1.2, 225.0, (1.0, 0.95, 0.88))
    _lamp(scene, "Fill", (1.8, -1.4, 1.8), 1.8, 20.0, (1.0, 0.80, 0.60))
    world = bpy.data.worlds.new("Kitchen")
    scene.world = world
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (1.0, 0.88, 0.74, 1.0)
    background.inputs["Strength"].default_value = 0.26
