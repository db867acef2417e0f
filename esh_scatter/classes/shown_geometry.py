"""What Blender shows of an object that a scatter places, where that is more than the object's own mesh.

Instances of an object carry what its geometry nodes instance, and of its matrix only rotation and scale. Objects of excluded or
hidden collections are evaluated only where something shown uses them. So they are looked at through the same nodes that a result
places them with, on an object that is there for a moment.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ..targets.depsgraph import evaluated_depsgraph
from ..targets.target import head_of, shown_collection
from .node_tree import Socket, Tree

__all__ = ["as_it_stands", "is_shown_as_it_is", "realized", "repeats_by", "source_instance"]

# Cosine between two axes of an object, above which it is sheared: its instances are turned and scaled, but not sheared.
SHEARED = 1e-5
# How an object repeats others that are its children, or its particles.
_INSTANCERS = {"VERTS": "vertices", "FACES": "faces"}


def repeats_by(item: bpy.types.Object) -> str | None:
    """Say by what an object repeats others, which no measurement sees; None if it does not."""
    if item.instance_type in _INSTANCERS and item.children:
        return _INSTANCERS[item.instance_type]
    systems = [system.settings for system in item.particle_systems]
    return "particles" if any(one.render_type in {"OBJECT", "COLLECTION"} for one in systems) else None


def is_shown_as_it_is(item: bpy.types.Object, context: bpy.types.Context) -> bool:
    """Tell whether instances of an object show its evaluated mesh, turned and scaled as its matrix says, and nothing else."""
    if item.type == "EMPTY":
        return shown_collection(item) is None
    if any(modifier.type == "NODES" for modifier in item.modifiers):
        return False
    evaluated = item.evaluated_get(evaluated_depsgraph(context))
    if not evaluated.is_evaluated:
        return not _differs_evaluated(item)
    axes = np.array(evaluated.matrix_world)[:3, :3].T
    axes = axes / np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-30)
    return bool(np.abs((axes @ axes.T)[[0, 0, 1], [1, 2, 2]]).max() < SHEARED)


def _differs_evaluated(item: bpy.types.Object) -> bool:
    """Tell whether an object may be another one once it is evaluated."""
    keys = getattr(item.data, "shape_keys", None)
    moved = item.parent or item.constraints or item.animation_data or item.delta_scale[:] != (1.0, 1.0, 1.0)
    return bool(moved or item.modifiers or keys or any(item.delta_rotation_euler) or item.rotation_mode != "XYZ")


@contextmanager
def realized(
    item: bpy.types.Object | bpy.types.Collection, context: bpy.types.Context
) -> Iterator[bpy.types.Mesh | None]:
    """Give what instances of an object, or of a collection as one, show: as a mesh around its origin, turned and scaled as it is.

    None where Blender does not let anything be made at the moment, as while it draws, or where there is no mesh.
    """
    try:
        tree = Tree("ESH Scatter Measure")
    except (AttributeError, RuntimeError):
        yield None
        return
    mesh = bpy.data.meshes.new("ESH Scatter Measure")
    looking = bpy.data.objects.new("ESH Scatter Measure", mesh)
    try:
        _build(tree, item)
        looking.modifiers.new("Measure", "NODES").node_group = tree.group
        context.scene.collection.objects.link(looking)
        evaluated = looking.evaluated_get(evaluated_depsgraph(context))
        try:
            yield evaluated.to_mesh() if evaluated.is_evaluated else None
        finally:
            evaluated.to_mesh_clear()
    finally:
        bpy.data.objects.remove(looking)
        bpy.data.meshes.remove(mesh)
        bpy.data.node_groups.remove(tree.group)


def source_instance(
    tree: Tree,
    source: bpy.types.Object | bpy.types.Collection | Socket,
    *,
    empty: bool,
    head: bpy.types.Object | None,
) -> Socket:
    """Add the nodes that give an object, or a collection as one, as an instance around its origin; see :func:`as_it_stands`.

    Args:
        tree: Gets the nodes.
        source: The object or the collection, or an input that gives it.
        empty: Whether it is an empty that shows a collection: the instance is one of that collection. Instances of an empty that is
            hidden show nothing.
        head: Object of the collection that the others hang on, and whose origin stands on the points.
    """
    as_one = (
        source.type == "COLLECTION"
        if isinstance(source, bpy.types.NodeSocket)
        else isinstance(source, bpy.types.Collection)
    )
    info = tree.add("GeometryNodeCollectionInfo" if as_one else "GeometryNodeObjectInfo")
    tree.link(source, info.inputs["Collection" if as_one else "Object"])
    if not as_one:
        info.inputs["As Instance"].default_value = not empty
    instance = info.outputs["Instances" if as_one else "Geometry"]
    return instance if head is None else _around(tree, source, instance, head)


def _around(tree: Tree, collection: bpy.types.Collection | Socket, instance: Socket, head: bpy.types.Object) -> Socket:
    """Move the instance of a collection so that an object of it is at the origin, wherever that object and the offset are now."""
    # Only in relation to an object does Blender tell a collection's offset.
    own = tree.add("GeometryNodeCollectionInfo", transform_space="RELATIVE")
    tree.link(collection, own.inputs["Collection"])
    position = tree.call("GeometryNodeInputPosition")
    place = tree.call(
        "GeometryNodeSampleIndex", own.outputs["Instances"], position, data_type="FLOAT_VECTOR", domain="INSTANCE"
    )
    this, its = tree.add("GeometryNodeObjectInfo"), tree.add("GeometryNodeObjectInfo")
    tree.link(tree.call("GeometryNodeSelfObject"), this.inputs["Object"])
    tree.link(head, its.inputs["Object"])
    offset = tree.call("FunctionNodeTransformPoint", place, this.outputs["Transform"])
    move = tree.add("GeometryNodeTransform")
    tree.link(instance, move.inputs["Geometry"])
    tree.link(tree.vector("SUBTRACT", offset, its.outputs["Location"]), move.inputs["Translation"])
    return move.outputs["Geometry"]


def as_it_stands(tree: Tree, instance: Socket, shown: Socket) -> Socket:
    """Turn and scale geometry as the object of an instance that :func:`source_instance` gave is turned and scaled."""
    transform = tree.add("GeometryNodeTransform")
    tree.link(shown, transform.inputs["Geometry"])
    for name in ("Rotation", "Scale"):
        if name in instance.node.outputs:
            tree.link(instance.node.outputs[name], transform.inputs[name])
    return transform.outputs["Geometry"]


def _build(tree: Tree, item: bpy.types.Object | bpy.types.Collection) -> None:
    """Make a tree that gives the geometry of all that a result shows of ``item``."""
    tree.group.is_modifier = True
    for direction in ("INPUT", "OUTPUT"):
        tree.group.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    tree.begin()
    empty = isinstance(item, bpy.types.Object) and shown_collection(item) is not None
    instance = source_instance(tree, item, empty=empty, head=head_of(item))
    real = tree.add("GeometryNodeRealizeInstances")
    tree.link(as_it_stands(tree, instance, instance), real.inputs["Geometry"])
    tree.link(real.outputs["Geometry"], tree.add("NodeGroupOutput").inputs["Geometry"])
