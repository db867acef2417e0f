"""Materials of the surface demos, as node trees."""

from __future__ import annotations

import bpy
from shader_nodes import (
    Color,
    add_bump,
    add_node,
    calculate,
    color_ramp,
    mix_colors,
    new_material,
    noise,
    per_instance,
)

__all__ = ["glossy", "leafy", "mottled", "set_light"]


def _finish(tree: bpy.types.NodeTree, color: object, roughness: float, coat: float = 0.0) -> bpy.types.Node:
    node = add_node(tree, "ShaderNodeBsdfPrincipled")
    if isinstance(color, tuple):
        node.inputs["Base Color"].default_value = (*color, 1.0)
    else:
        tree.links.new(color, node.inputs["Base Color"])
    node.inputs["Roughness"].default_value = roughness
    node.inputs["Coat Weight"].default_value = coat
    tree.links.new(node.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return node


def mottled(
    name: str,
    stops: list[tuple[float, Color]],
    wavelength: float,
    *,
    roughness: float = 0.85,
    bump: float = 0.0,
    fine: float = 0.12,
) -> bpy.types.Material:
    """A rough material of several colors in patches.

    Args:
        name: Of the material.
        stops: Colors over the noise, 0..1.
        wavelength: Of the patches [m].
        roughness: Of the surface.
        bump: Height of its bumps [m].
        fine: Their wavelength, as a share of that of the patches.
    """
    material, tree = new_material(name)
    patches = noise(tree, wavelength, 8.0)
    node = _finish(tree, color_ramp(tree, patches, stops), roughness)
    if bump:
        add_bump(tree, node, noise(tree, fine * wavelength, 10.0), bump)
    return material


def glossy(
    name: str, color: Color, *, roughness: float = 0.25, coat: float = 0.6, under: float = 0.0
) -> bpy.types.Material:
    """A smooth material of one color; with light that wanders ``under`` its skin [m]."""
    material, tree = new_material(name)
    node = _finish(tree, color, roughness, coat)
    if under:
        node.inputs["Subsurface Weight"].default_value = 0.35
        node.inputs["Subsurface Scale"].default_value = under
    return material


def leafy(
    name: str, hues: list[tuple[float, Color]], *, roughness: float = 0.7, through: float = 0.3
) -> bpy.types.Material:
    """What has a color of its own in every instance, lighter in places of the world, and lets some light through."""
    material, tree = new_material(name)
    hue = color_ramp(tree, per_instance(tree), hues)
    place = color_ramp(tree, noise(tree, 0.35), [(0.3, (0.55, 0.55, 0.55)), (0.7, (1.25, 1.25, 1.15))])
    color = mix_colors(tree, 1.0, hue, place, "MULTIPLY")
    node = add_node(tree, "ShaderNodeBsdfPrincipled")
    tree.links.new(color, node.inputs["Base Color"])
    node.inputs["Roughness"].default_value = roughness
    glow = add_node(tree, "ShaderNodeBsdfTranslucent")
    tree.links.new(color, glow.inputs["Color"])
    mix = add_node(tree, "ShaderNodeMixShader")
    mix.inputs[0].default_value = through
    tree.links.new(node.outputs[0], mix.inputs[1])
    tree.links.new(glow.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def set_light(
    scene: bpy.types.Scene,
    sun: tuple[float, float, float],
    strength: float,
    sky: Color,
    glow: float,
    warm: Color = (1.0, 0.93, 0.82),
) -> None:
    """Light a scene by a sun, by where its light comes from, and a sky of one color that is brighter above."""
    from mathutils import Vector

    lamp = bpy.data.lights.new("Sun", "SUN")
    lamp.energy, lamp.angle, lamp.color = strength, 0.05, warm
    item = bpy.data.objects.new("Sun", lamp)
    item.rotation_euler = Vector(sun).to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(item)
    world = bpy.data.worlds.new("Sky")
    world.use_nodes = True
    scene.world = world
    tree = world.node_tree
    background = tree.nodes["Background"]
    up = add_node(tree, "ShaderNodeSeparateXYZ")
    tree.links.new(add_node(tree, "ShaderNodeTexCoord").outputs["Generated"], up.inputs[0])
    share = calculate(tree, "MULTIPLY_ADD", up.outputs[2], 0.5, 0.5)
    dark = tuple(0.45 * c for c in sky)
    tree.links.new(
        color_ramp(tree, share, [(0.35, dark), (0.6, sky), (1.0, tuple(1.35 * c for c in sky))]),
        background.inputs["Color"],
    )
    background.inputs["Strength"].default_value = glow
