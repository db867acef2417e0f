"""Materials, sky and air of the forest, built as node trees."""

from __future__ import annotations

import math

import bpy
from shader_nodes import (
    Color,
    add_bump,
    add_node,
    attribute,
    calculate,
    color_ramp,
    mix_colors,
    new_material,
    noise,
    per_instance,
)

__all__ = ["bark", "foliage", "grass", "ground", "set_sky"]

# Air: the distance over which two thirds of the light of a thing is lost [m], and the color that takes its place.
VISIBILITY = 1500.0
HAZE: Color = (0.64, 0.58, 0.53)
HAZE_STRENGTH = 0.6


def _finish(tree: bpy.types.NodeTree, shader: bpy.types.NodeSocket) -> None:
    """Put the air between the shader and the eye: cheaper than a volume, and free of noise."""
    view = add_node(tree, "ShaderNodeCameraData")
    path = add_node(tree, "ShaderNodeLightPath")
    loss = calculate(tree, "EXPONENT", calculate(tree, "DIVIDE", view.outputs["View Distance"], -VISIBILITY))
    amount = calculate(tree, "MULTIPLY", calculate(tree, "SUBTRACT", 1.0, loss), path.outputs["Is Camera Ray"])
    air = add_node(tree, "ShaderNodeEmission")
    air.inputs["Color"].default_value = (*HAZE, 1.0)
    air.inputs["Strength"].default_value = HAZE_STRENGTH
    mix = add_node(tree, "ShaderNodeMixShader")
    tree.links.new(amount, mix.inputs[0])
    tree.links.new(shader, mix.inputs[1])
    tree.links.new(air.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], add_node(tree, "ShaderNodeOutputMaterial").inputs["Surface"])


def _surface(tree: bpy.types.NodeTree, color: bpy.types.NodeSocket, roughness: float = 0.9) -> bpy.types.Node:
    node = add_node(tree, "ShaderNodeBsdfPrincipled")
    tree.links.new(color, node.inputs["Base Color"])
    node.inputs["Roughness"].default_value = roughness
    node.inputs["Specular IOR Level"].default_value = 0.15
    return node


def bark(name: str, dark: Color, light: Color) -> bpy.types.Material:
    """Bark or stone: two colors, mottled."""
    material, tree = new_material(name)
    color = color_ramp(tree, noise(tree, 0.5), [(0.3, dark), (0.7, light)])
    _finish(tree, _surface(tree, color).outputs[0])
    return material


def foliage(name: str, hues: list[tuple[float, Color]], shade: float, translucent: float) -> bpy.types.Material:
    """Leaves or needles.

    Args:
        name: Of the material.
        hues: From which every tree takes its own color: position 0..1 and color.
        shade: Brightness of the innermost leaves beside the outermost.
        translucent: Share of the light that shines through.
    """
    material, tree = new_material(name)
    hue = color_ramp(tree, per_instance(tree), hues)
    depth = color_ramp(tree, attribute(tree, "tint"), [(0.0, (shade,) * 3), (1.0, (1.4, 1.35, 1.2))])
    color = mix_colors(tree, 1.0, hue, depth, "MULTIPLY")
    through = add_node(tree, "ShaderNodeBsdfTranslucent")
    tree.links.new(color, through.inputs["Color"])
    mix = add_node(tree, "ShaderNodeMixShader")
    mix.inputs[0].default_value = translucent
    tree.links.new(_surface(tree, color, 0.65).outputs[0], mix.inputs[1])
    tree.links.new(through.outputs[0], mix.inputs[2])
    _finish(tree, mix.outputs[0])
    return material


def grass(name: str) -> bpy.types.Material:
    """Dry autumn grass."""
    return foliage(
        name,
        [(0.0, (0.12, 0.13, 0.035)), (0.5, (0.20, 0.17, 0.055)), (1.0, (0.31, 0.23, 0.09))],
        shade=0.6,
        translucent=0.35,
    )


def ground(name: str, low: float, high: float, wooded: bool) -> bpy.types.Material:
    """The land: grass below, soil and needles above, rock where it is steep.

    Args:
        name: Of the material.
        low: Altitude of the valleys' floors [m].
        high: Altitude of the tops [m].
        wooded: Paint a distant forest on it: the backdrop carries no trees.
    """
    material, tree = new_material(name)
    place = add_node(tree, "ShaderNodeNewGeometry")
    split = add_node(tree, "ShaderNodeSeparateXYZ")
    tree.links.new(place.outputs["Position"], split.inputs[0])
    facing = add_node(tree, "ShaderNodeSeparateXYZ")
    tree.links.new(place.outputs["Normal"], facing.inputs[0])
    rise = calculate(tree, "DIVIDE", calculate(tree, "SUBTRACT", split.outputs[2], low), high - low)
    altitude = calculate(
        tree, "ADD", rise, calculate(tree, "MULTIPLY", calculate(tree, "SUBTRACT", noise(tree, 45.0), 0.5), 0.45)
    )
    if wooded:
        color = color_ramp(
            tree,
            altitude,
            [
                (0.06, (0.16, 0.15, 0.05)),
                (0.14, (0.22, 0.10, 0.025)),
                (0.42, (0.13, 0.075, 0.022)),
                (0.60, (0.025, 0.045, 0.02)),
            ],
        )
        canopy = color_ramp(tree, noise(tree, 9.0, 2.0), [(0.35, (0.35,) * 3), (0.65, (1.2,) * 3)])
        color = mix_colors(tree, 1.0, color, canopy, "MULTIPLY")
    else:
        color = color_ramp(
            tree,
            altitude,
            [
                (0.0, (0.115, 0.135, 0.035)),
                (0.3, (0.17, 0.125, 0.045)),
                (0.55, (0.11, 0.07, 0.03)),
                (0.9, (0.10, 0.085, 0.05)),
            ],
        )
        patch = color_ramp(tree, noise(tree, 5.0), [(0.3, (0.62, 0.62, 0.55)), (0.7, (1.25, 1.2, 1.1))])
        color = mix_colors(tree, 1.0, color, patch, "MULTIPLY")
        stubble = color_ramp(tree, noise(tree, 0.45, 2.0), [(0.35, (0.6,) * 3), (0.65, (1.3,) * 3)])
        color = mix_colors(tree, 1.0, color, stubble, "MULTIPLY")
        rock = color_ramp(tree, noise(tree, 1.6), [(0.3, (0.10, 0.095, 0.09)), (0.7, (0.27, 0.25, 0.225))])
        # cos 27 degrees and cos 35 degrees.
        bare = calculate(tree, "ADD", facing.outputs[2], calculate(tree, "MULTIPLY", noise(tree, 6.0), 0.12))
        steep = color_ramp(tree, bare, [(0.87, (1.0,) * 3), (0.93, (0.0,) * 3)])
        color = mix_colors(tree, steep, color, rock)
    surface = _surface(tree, color, 0.95)
    add_bump(
        tree,
        surface,
        noise(tree, 11.0 if wooded else 0.9, 3.0),
        depth=12.0 if wooded else 0.35,
        strength=0.9 if wooded else 0.5,
    )
    _finish(tree, surface.outputs[0])
    return material


def _clouds(tree: bpy.types.NodeTree, sky: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Draw thin high clouds over ``sky``, drawn out along the wind and closer together towards the horizon."""
    ray = add_node(tree, "ShaderNodeTexCoord")
    split = add_node(tree, "ShaderNodeSeparateXYZ")
    tree.links.new(ray.outputs["Generated"], split.inputs[0])
    rise = calculate(tree, "ADD", calculate(tree, "MAXIMUM", split.outputs[2], 0.0), 0.12)
    plane = add_node(tree, "ShaderNodeCombineXYZ")
    tree.links.new(calculate(tree, "DIVIDE", split.outputs[0], rise), plane.inputs[0])
    tree.links.new(calculate(tree, "MULTIPLY", calculate(tree, "DIVIDE", split.outputs[1], rise), 1.9), plane.inputs[1])
    noise = add_node(tree, "ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 0.75
    noise.inputs["Detail"].default_value = 7.0
    noise.inputs["Distortion"].default_value = 0.35
    tree.links.new(plane.outputs[0], noise.inputs["Vector"])
    cover = color_ramp(tree, noise.outputs[0], [(0.45, (0.0,) * 3), (0.68, (0.9,) * 3)])
    bright = mix_colors(tree, 1.0, sky, (1.7, 1.45, 1.25), "MULTIPLY")
    return mix_colors(tree, cover, sky, mix_colors(tree, 0.55, bright, (5.6, 4.9, 4.2)))


def set_sky(scene: bpy.types.Scene, elevation: float, azimuth: float) -> None:
    """Light the scene by a physical sky and a low, warm sun.

    Args:
        scene: What is lit.
        elevation: The sun's height above the horizon [rad].
        azimuth: Where the sun stands, clockwise from north (y) [rad].
    """
    world = bpy.data.worlds.new("Sky")
    scene.world = world
    world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    sky = add_node(tree, "ShaderNodeTexSky")
    kinds = sky.bl_rna.properties["sky_type"].enum_items.keys()
    # Blender 5 calls the Nishita model by how it scatters; its brighter successor would need another exposure.
    sky.sky_type = next(kind for kind in ("NISHITA", "SINGLE_SCATTERING") if kind in kinds)
    sky.sun_disc = False
    sky.sun_elevation = elevation
    sky.sun_rotation = azimuth
    sky.air_density = 1.2
    for dust in ("dust_density", "aerosol_density"):
        if hasattr(sky, dust):
            setattr(sky, dust, 1.6)
    light = add_node(tree, "ShaderNodeBackground")
    light.inputs["Strength"].default_value = 0.19
    tree.links.new(_clouds(tree, sky.outputs[0]), light.inputs["Color"])
    tree.links.new(light.outputs[0], add_node(tree, "ShaderNodeOutputWorld").inputs["Surface"])
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy = 11.0
    sun.color = (1.0, 0.79, 0.54)
    sun.angle = math.radians(0.8)
    lamp = bpy.data.objects.new("Sun", sun)
    lamp.rotation_euler = (math.pi / 2 - elevation, 0.0, math.pi - azimuth)
    scene.collection.objects.link(lamp)
