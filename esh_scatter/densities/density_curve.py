"""Curves that bend the values of layers. Blender has none among properties: each lies in a node of a hidden node group of its own."""

from __future__ import annotations

from typing import Any

import bpy

__all__ = ["copy_curve", "curve_node", "curve_points", "curve_record", "make_curve", "remove_curve"]

# Blender hides what has a name that begins with a dot.
NAME = ".ESH Scatter Curve"
# Points that stand for a curve; between them it is straight.
POINTS = 129


def make_curve() -> bpy.types.NodeTree:
    """Make a curve that leaves all values as they are."""
    tree = bpy.data.node_groups.new(NAME, "ShaderNodeTree")
    tree.nodes.new("ShaderNodeFloatCurve")
    return tree


def curve_node(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    """Return the node that has the curve, or None where somebody has taken it out."""
    return next((node for node in tree.nodes if node.bl_idname == "ShaderNodeFloatCurve"), None)


def curve_points(tree: bpy.types.NodeTree) -> tuple[tuple[float, float], ...] | None:
    """Return a curve as points (x, y) from 0 to 1."""
    node = curve_node(tree)
    if node is None:
        return None
    mapping = node.mapping
    mapping.initialize()
    along = [i / (POINTS - 1) for i in range(POINTS)]
    return tuple((x, min(1.0, max(0.0, mapping.evaluate(mapping.curves[0], x)))) for x in along)


def curve_record(tree: bpy.types.NodeTree) -> list[Any]:
    """Return what a curve says, as plain data."""
    node = curve_node(tree)
    return [[*point.location, point.handle_type] for point in node.mapping.curves[0].points] if node else []


def copy_curve(tree: bpy.types.NodeTree | None) -> bpy.types.NodeTree | None:
    """Return a curve of its own that says the same."""
    return None if tree is None else tree.copy()


def remove_curve(tree: bpy.types.NodeTree | None) -> None:
    """Remove a curve that nothing else uses; called once it is no longer pointed to."""
    if tree is not None and not tree.users:
        bpy.data.node_groups.remove(tree)
