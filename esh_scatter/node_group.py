"""The geometry node group of a result: it puts the right object on every point."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from .target import RESULT_TAG

__all__ = ["HIDE_RENDER", "HIDE_VIEWPORT", "INSTANCE_INDEX", "ROTATION", "SCALE", "build_node_group", "shown_by"]

INSTANCE_INDEX = "instance_index"
ROTATION = "rotation"
SCALE = "scale"
HIDE_VIEWPORT = "hide_viewport"
HIDE_RENDER = "hide_render"


def build_node_group(name: str, sources: Sequence[bpy.types.Object]) -> bpy.types.NodeTree:
    """Make a node group that instances ``sources[instance_index]`` on each point, turned and scaled by attributes.

    The sources' own rotation and scale count and stay live, their location does not. They are picked by comparing the
    index, one branch each, so that nothing depends on the order in which a list of instances is joined. Points may be hidden by
    attributes; a point without these shows.
    """
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    group[RESULT_TAG] = True
    group.is_modifier = True
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")

    def add(kind: str, column: int, row: int) -> bpy.types.Node:
        node = group.nodes.new(kind)
        node.location = (240.0 * column, -260.0 * row)
        return node

    def attribute(attribute_name: str, kind: str, row: int) -> bpy.types.NodeSocket:
        node = add("GeometryNodeInputNamedAttribute", 0, row)
        node.data_type = kind
        node.inputs["Name"].default_value = attribute_name
        return next(socket for socket in node.outputs if socket.enabled and socket.name == "Attribute")

    def link(source: bpy.types.NodeSocket, node: bpy.types.Node, socket: str) -> None:
        group.links.new(source, node.inputs[socket])

    def hide(index: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return the index, or -1 where an attribute hides the point in the viewport or in renders."""
        hidden = add("GeometryNodeSwitch", 1, -2)
        hidden.input_type = "BOOLEAN"
        group.links.new(add("GeometryNodeIsViewport", 0, -3).outputs[0], hidden.inputs["Switch"])
        group.links.new(attribute(HIDE_RENDER, "BOOLEAN", -2), hidden.inputs["False"])
        group.links.new(attribute(HIDE_VIEWPORT, "BOOLEAN", -1), hidden.inputs["True"])
        chosen = add("GeometryNodeSwitch", 1, -1)
        chosen.input_type = "INT"
        group.links.new(hidden.outputs[0], chosen.inputs["Switch"])
        group.links.new(index, chosen.inputs["False"])
        chosen.inputs["True"].default_value = -1
        return chosen.outputs[0]

    points = add("NodeGroupInput", 0, 0).outputs["Geometry"]
    index = hide(attribute(INSTANCE_INDEX, "INT", 1))
    rotation = attribute(ROTATION, "QUATERNION", 2)
    scale = attribute(SCALE, "FLOAT_VECTOR", 3)
    join = add("GeometryNodeJoinGeometry", 5, 0)
    for number, source in enumerate(sources):
        compare = add("FunctionNodeCompare", 1, number)
        compare.data_type = "INT"
        compare.operation = "EQUAL"
        first, second = (socket for socket in compare.inputs if socket.enabled and socket.type == "INT")
        group.links.new(index, first)
        second.default_value = number
        info = add("GeometryNodeObjectInfo", 2, number)
        info.inputs["Object"].default_value = source
        info.inputs["As Instance"].default_value = True
        transform = add("GeometryNodeTransform", 3, number)
        link(info.outputs["Geometry"], transform, "Geometry")
        link(info.outputs["Rotation"], transform, "Rotation")
        link(info.outputs["Scale"], transform, "Scale")
        instance = add("GeometryNodeInstanceOnPoints", 4, number)
        link(points, instance, "Points")
        link(compare.outputs["Result"], instance, "Selection")
        link(transform.outputs["Geometry"], instance, "Instance")
        # Picking the one instance, rather than wrapping it, keeps the instances flat: one level, one object each.
        instance.inputs["Pick Instance"].default_value = True
        link(rotation, instance, "Rotation")
        link(scale, instance, "Scale")
        link(instance.outputs["Instances"], join, "Geometry")
    link(join.outputs["Geometry"], add("NodeGroupOutput", 6, 0), "Geometry")
    return group


def shown_by(group: bpy.types.NodeTree) -> list[bpy.types.Object | None]:
    """Return the objects that a node group instances, in the order that ``instance_index`` counts."""
    return [node.inputs["Object"].default_value for node in group.nodes if node.bl_idname == "GeometryNodeObjectInfo"]
