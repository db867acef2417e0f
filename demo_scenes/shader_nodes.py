"""Node trees in few words: what every material of the demo scenes is made of."""

from __future__ import annotations

import bpy

__all__ = [
    "Color",
    "add_bump",
    "add_node",
    "attribute",
    "calculate",
    "color_ramp",
    "connect",
    "mix_colors",
    "new_material",
    "noise",
    "object_place",
    "per_instance",
]

Color = tuple[float, float, float]


def add_node(tree: bpy.types.NodeTree, kind: str, /, **values: object) -> bpy.types.Node:
    """Add a node of Blender's type ``kind`` and set its properties (not its sockets)."""
    node = tree.nodes.new(kind)
    for key, value in values.items():
        setattr(node, key, value)
    return node


def connect(tree: bpy.types.NodeTree, value: object, socket: bpy.types.NodeSocket) -> None:
    """Feed ``socket`` by an output socket, a number or a color."""
    if isinstance(value, bpy.types.NodeSocket):
        tree.links.new(value, socket)
    elif isinstance(value, tuple) and len(value) == 3 and socket.type == "RGBA":
        socket.default_value = (*value, 1.0)
    else:
        socket.default_value = value


def color_ramp(
    tree: bpy.types.NodeTree, factor: bpy.types.NodeSocket, stops: list[tuple[float, Color]]
) -> bpy.types.NodeSocket:
    """Turn a number into a color between ``stops``: positions 0..1 and colors."""
    node = add_node(tree, "ShaderNodeValToRGB")
    tree.links.new(factor, node.inputs[0])
    elements = node.color_ramp.elements
    while len(elements) < len(stops):
        elements.new(1.0)
    for element, (position, color) in zip(elements, stops, strict=True):
        element.position = position
        element.color = (*color, 1.0)
    return node.outputs[0]


def calculate(tree: bpy.types.NodeTree, operation: str, *inputs: object) -> bpy.types.NodeSocket:
    """Apply one of the Math node's operations to sockets and numbers."""
    node = add_node(tree, "ShaderNodeMath", operation=operation)
    for socket, value in zip(node.inputs, inputs, strict=False):
        connect(tree, value, socket)
    return node.outputs[0]


def mix_colors(
    tree: bpy.types.NodeTree, factor: object, a: object, b: object, blend: str = "MIX"
) -> bpy.types.NodeSocket:
    """Mix two colors; ``factor`` 0 is all ``a``."""
    node = add_node(tree, "ShaderNodeMix", data_type="RGBA", blend_type=blend)
    for socket, value in zip((node.inputs[0], node.inputs[6], node.inputs[7]), (factor, a, b), strict=True):
        connect(tree, value, socket)
    return node.outputs[2]


def noise(
    tree: bpy.types.NodeTree, wavelength: float, detail: float = 4.0, place: bpy.types.NodeSocket | None = None
) -> bpy.types.NodeSocket:
    """Noise 0..1 of a wavelength [m], at ``place`` or else in meters of the world."""
    if place is None:
        place = add_node(tree, "ShaderNodeNewGeometry").outputs["Position"]
    node = add_node(tree, "ShaderNodeTexNoise")
    node.inputs["Scale"].default_value = 1.0 / wavelength
    node.inputs["Detail"].default_value = detail
    tree.links.new(place, node.inputs["Vector"])
    return node.outputs[0]


def attribute(tree: bpy.types.NodeTree, name: str) -> bpy.types.NodeSocket:
    """Read a number that the mesh carries."""
    return add_node(tree, "ShaderNodeAttribute", attribute_name=name).outputs["Fac"]


def per_instance(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
    """A number 0..1 that every object and every instance has for itself."""
    return add_node(tree, "ShaderNodeObjectInfo").outputs["Random"]


def object_place(
    tree: bpy.types.NodeTree, stretch: tuple[float, float, float] = (1.0, 1.0, 1.0)
) -> bpy.types.NodeSocket:
    """Where a point is in its own object [m], and for every instance in another part of a texture."""
    place = add_node(tree, "ShaderNodeVectorMath", operation="MULTIPLY")
    tree.links.new(add_node(tree, "ShaderNodeTexCoord").outputs["Object"], place.inputs[0])
    place.inputs[1].default_value = stretch
    shift = add_node(tree, "ShaderNodeVectorMath", operation="SCALE")
    shift.inputs[0].default_value = (3.1, 1.7, 2.3)
    tree.links.new(per_instance(tree), shift.inputs["Scale"])
    total = add_node(tree, "ShaderNodeVectorMath", operation="ADD")
    tree.links.new(place.outputs[0], total.inputs[0])
    tree.links.new(shift.outputs[0], total.inputs[1])
    return total.outputs[0]


def add_bump(
    tree: bpy.types.NodeTree, surface: bpy.types.Node, height: bpy.types.NodeSocket, depth: float, strength: float = 1.0
) -> None:
    """Let ``height`` 0..1 shape the shading of ``surface`` as if it rose by ``depth`` [m]."""
    bump = add_node(tree, "ShaderNodeBump")
    bump.inputs["Strength"].default_value = strength
    bump.inputs["Distance"].default_value = depth
    tree.links.new(height, bump.inputs["Height"])
    tree.links.new(bump.outputs[0], surface.inputs["Normal"])


def new_material(name: str) -> tuple[bpy.types.Material, bpy.types.NodeTree]:
    """Make a material with an empty node tree."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    material.node_tree.nodes.clear()
    return material, material.node_tree
