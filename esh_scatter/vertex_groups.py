"""Reading vertex groups whole. Blender's Python hands weights out one vertex at a time; geometry nodes see them as attributes."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

__all__ = ["read_vertex_groups"]

# What the attribute that holds the weights of a group is called, with the group's number.
_COPY = "esh_scatter weights {}"


def read_vertex_groups(
    evaluated: bpy.types.Object, names: Sequence[str], context: bpy.types.Context
) -> dict[str, np.ndarray]:
    """Return the weights of vertex groups, shape ``[v]``, float32, by name; 0 for vertices that are not in a group.

    They are copied to attributes of an object that is in a scene of its own for as long as this takes, with a copy of the mesh
    that shares its data.

    Args:
        evaluated: Mesh object as evaluated.
        names: Groups to read.
        context: Whose dependency graph it was evaluated in.
    """
    if not names:
        return {}
    data = bpy.data
    mesh = data.meshes.new_from_object(
        evaluated, preserve_all_data_layers=True, depsgraph=context.evaluated_depsgraph_get()
    )
    item = data.objects.new(mesh.name, mesh)
    group = _copying_group(names)
    item.modifiers.new(group.name, "NODES").node_group = group
    scene = data.scenes.new(mesh.name)
    try:
        scene.collection.objects.link(item)
        layer = scene.view_layers[0]
        layer.update()
        copied = item.evaluated_get(layer.depsgraph).data.attributes
        weights = {name: np.empty(len(mesh.vertices), np.float32) for name in names}
        for number, values in enumerate(weights.values()):
            copied[_COPY.format(number)].data.foreach_get("value", values)
        return weights
    finally:
        data.scenes.remove(scene)
        data.objects.remove(item)
        data.node_groups.remove(group)
        data.meshes.remove(mesh)


def _copying_group(names: Sequence[str]) -> bpy.types.NodeTree:
    """Make a node group that stores every vertex group as an attribute."""
    group = bpy.data.node_groups.new("ESH Scatter Weights", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    geometry = group.nodes.new("NodeGroupInput").outputs["Geometry"]
    for number, name in enumerate(names):
        weight = group.nodes.new("GeometryNodeInputNamedAttribute")
        weight.inputs["Name"].default_value = name
        store = group.nodes.new("GeometryNodeStoreNamedAttribute")
        store.inputs["Name"].default_value = _COPY.format(number)
        for node in (weight, store):
            node.data_type = "FLOAT"
        group.links.new(geometry, store.inputs["Geometry"])
        group.links.new(_enabled(weight.outputs, "Attribute"), _enabled(store.inputs, "Value"))
        geometry = store.outputs["Geometry"]
    group.links.new(geometry, group.nodes.new("NodeGroupOutput").inputs["Geometry"])
    return group


def _enabled(sockets: Sequence[bpy.types.NodeSocket], name: str) -> bpy.types.NodeSocket:
    """Return the socket of this name that is there for the chosen type."""
    return next(socket for socket in sockets if socket.enabled and socket.name == name)
