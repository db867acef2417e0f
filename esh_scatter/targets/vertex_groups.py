"""Reading vertex groups whole. Blender's Python hands weights out one vertex at a time; geometry nodes see them as attributes.

Of 100,000 vertices the one takes 40 ms, the other 2; but data that are made for it have Blender look at all objects of the file again.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import repeat
from operator import itemgetter

import bmesh
import bpy
import numpy as np

from .depsgraph import evaluated_depsgraph

__all__ = ["can_be_listed", "list_weights", "read_vertex_groups"]

# What a group, by its number, and the attribute that its weights are copied to are called while they are read.
_GROUP = "esh_scatter group {}"
_COPY = "esh_scatter weights {}"


def read_vertex_groups(
    evaluated: bpy.types.Object, mesh: bpy.types.Mesh, names: Sequence[str], context: bpy.types.Context
) -> dict[str, np.ndarray]:
    """Return the weights of vertex groups, shape ``[v]``, float32, by name; 0 for vertices that are not in a group.

    Geometry nodes copy them to attributes, on a copy of the mesh (which shares its data) in a scene of its own that is removed
    again: the object and its scene are not touched. While weights are painted nothing is made that a stroke must not meet.

    Args:
        evaluated: Mesh object as evaluated.
        mesh: What :meth:`to_mesh` has made of it.
        names: Groups to read.
        context: Whose dependency graph it was evaluated in.
    """
    if not names:
        return {}
    painted = context.view_layer.objects.active
    if painted is not None and painted.mode == "WEIGHT_PAINT" and can_be_listed(evaluated):
        numbers = [evaluated.vertex_groups[name].index for name in names]
        return dict(zip(names, list_weights(mesh, numbers), strict=True))
    data = bpy.data
    depsgraph = evaluated_depsgraph(context)
    copy = data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)
    item = data.objects.new(copy.name, copy)
    scene = data.scenes.new(copy.name)
    group = _copying_group(len(names))
    try:
        for number, name in enumerate(names):
            # An attribute, "position" or a UV map, may have the same name.
            if name in item.vertex_groups:
                item.vertex_groups[name].name = _GROUP.format(number)
        item.modifiers.new(group.name, "NODES").node_group = group
        scene.collection.objects.link(item)
        layer = scene.view_layers[0]
        layer.update()
        copied = item.evaluated_get(layer.depsgraph).data.attributes
        weights = {name: np.empty(len(copy.vertices), np.float32) for name in names}
        for number, values in enumerate(weights.values()):
            copied[_COPY.format(number)].data.foreach_get("value", values)
        return weights
    finally:
        data.scenes.remove(scene)
        data.objects.remove(item)
        data.meshes.remove(copy)
        data.node_groups.remove(group)


def can_be_listed(evaluated: bpy.types.Object) -> bool:
    """Tell whether the weights of an object as evaluated are numbered as its groups are.

    Geometry nodes may bring groups of other objects, which come first.
    """
    return all(modifier.type != "NODES" for modifier in evaluated.modifiers if modifier.show_viewport)


def list_weights(mesh: bpy.types.Mesh, groups: Sequence[int]) -> list[np.ndarray]:
    """Return the weights of groups by their numbers, each of shape ``[v]``, float32, and make nothing in the file."""
    count = len(mesh.vertices)
    made = bmesh.new()
    try:
        made.from_mesh(mesh, face_normals=False, vertex_normals=False)
        layer = made.verts.layers.deform.active
        if layer is None or not count:
            return [np.zeros(count, np.float32) for _ in groups]
        made.verts.ensure_lookup_table()
        # Without a line of Python for every vertex.
        weight_of = type(made.verts[0][layer]).get
        return [
            np.fromiter(
                map(weight_of, map(itemgetter(layer), made.verts), repeat(group), repeat(0.0)), np.float32, count
            )
            for group in groups
        ]
    finally:
        made.free()


def _copying_group(count: int) -> bpy.types.NodeTree:
    """Make a node group that copies the weights of so many vertex groups to attributes."""
    group = bpy.data.node_groups.new("ESH Scatter Weights", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    geometry = group.nodes.new("NodeGroupInput").outputs["Geometry"]
    for number in range(count):
        weight = group.nodes.new("GeometryNodeInputNamedAttribute")
        store = group.nodes.new("GeometryNodeStoreNamedAttribute")
        for node, name in ((weight, _GROUP), (store, _COPY)):
            node.data_type = "FLOAT"
            node.inputs["Name"].default_value = name.format(number)
        group.links.new(geometry, store.inputs["Geometry"])
        group.links.new(_enabled(weight.outputs, "Attribute"), _enabled(store.inputs, "Value"))
        geometry = store.outputs["Geometry"]
    group.links.new(geometry, group.nodes.new("NodeGroupOutput").inputs["Geometry"])
    return group


def _enabled(sockets: Sequence[bpy.types.NodeSocket], name: str) -> bpy.types.NodeSocket:
    """Return the socket of this name that is there for the chosen type."""
    return next(socket for socket in sockets if socket.enabled and socket.name == name)
