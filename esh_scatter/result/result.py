"""The result in Blender: one object, a mesh of points with attributes, and the modifier that instances objects on them."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ..classes.node_tree import remove_group
from ..targets.references import Reference
from ..targets.target import RESULT_TAG, RESULT_TARGET, is_result
from .display import get_inputs, our_modifier, set_inputs
from .node_group import (
    HIDE_RENDER,
    HIDE_VIEWPORT,
    MADE_OF,
    Followed,
    build_node_group,
    followed_targets,
    made_of,
    placed_objects,
)

__all__ = [
    "CLASS_NAMES",
    "OVERLAPPING",
    "EmptiedGroup",
    "empty_group",
    "fill_group",
    "find_result",
    "remove_result",
    "rename_result",
    "write_result",
]

# Custom property of a result: the name that it was made with.
NAME = "esh_scatter_name"
# And what its indices count: names of classes, and for each the names of its sizes, as JSON.
CLASS_NAMES = "esh_scatter_classes"
# Attribute of points: whether the object there overlaps another; absent where no two do.
OVERLAPPING = "overlapping"

_WRITTEN = {
    "FLOAT": "value",
    "INT": "value",
    "FLOAT_VECTOR": "vector",
    "QUATERNION": "value",
    "FLOAT_COLOR": "color",
    "BOOLEAN": "value",
}


def find_result(
    scene: bpy.types.Scene, target: bpy.types.Object | bpy.types.Collection, name: str
) -> bpy.types.Object | None:
    """Return the object of ``scene`` that an earlier run with this name made on this target, whatever it is called now.

    Of a result and its copies it is the one that was there first; one that another scene shows, too, is that scene's.
    """
    found = [item for item in _results(scene, target, name) if not is_shared(item)]
    return min(found, key=lambda item: item.session_uid, default=None)


def is_shared(item: bpy.types.Object) -> bool:
    """Tell whether several scenes show an object, or whether it belongs to a library: it is not for one of them to change."""
    return len(item.users_scene) > 1 or not item.is_editable


def _results(scene: bpy.types.Scene, target: bpy.types.Object, name: str) -> list[bpy.types.Object]:
    return [
        item
        for item in scene.objects
        if item.get(RESULT_TARGET) == target and item.get(NAME) == name and is_result(item)
    ]


def write_result(
    scene: bpy.types.Scene,
    replaced: bpy.types.Object | None,
    target: bpy.types.Object | bpy.types.Collection | None,
    name: str,
    sources: Sequence[bpy.types.Object | bpy.types.Collection],
    position: np.ndarray,
    attributes: Mapping[str, tuple[str, np.ndarray]],
    classes: Sequence[str] = (),
    followed: Sequence[Followed] = (),
) -> bpy.types.Object:
    """Make the result object, or give ``replaced`` new points, and its node group other nodes where it is to show other things.

    Its mesh and its group stay, where they are its own: undo may keep the object as it is, and then knows nothing of others that it
    uses since the last step.

    Args:
        scene: Where a new object is linked.
        replaced: Result of an earlier run; its name, transform, collections and other modifiers stay. None makes a new object, and
            takes what is left of earlier ones, which other scenes show, too, out of this scene's own collection.
        target: Remembered on the object, to find it again; None where there is none.
        name: Of a new object; also remembered.
        sources: What ``instance_index`` counts.
        position: Points in the world [m], shape ``[n, 3]``.
        attributes: Name -> (Blender's type, values of shape ``[n]`` or ``[n, k]``), one value for each point.
        classes: Names of what ``class_index`` counts.
        followed: What the points follow.
    """
    ingredients = made_of(classes, followed)
    if replaced is not None and _shows(replaced, name, sources, ingredients):
        # To build the same group once more takes longer than all the rest.
        if not _move_points(replaced.data, position, attributes):
            _set_points(replaced, name, position, attributes)
        return replaced
    if replaced is None:
        mesh = _point_mesh(name, position, attributes)
        for earlier in _results(scene, target, name):
            if is_shared(earlier) and scene.collection.objects.get(earlier.name) == earlier:
                scene.collection.objects.unlink(earlier)
        item = bpy.data.objects.new(name, mesh)
        scene.collection.objects.link(item)
    else:
        item = replaced
        _set_points(item, name, position, attributes)
    modifier = our_modifier(item)
    if modifier is None:
        modifier = item.modifiers.new("ESH Scatter", "NODES")
    _build_anew(modifier, name, sources, classes, followed)
    item[RESULT_TAG] = True
    if target is not None:
        item[RESULT_TARGET] = target
    item[NAME] = name
    return item


def _shows(item: bpy.types.Object, name: str, sources: Sequence[bpy.types.Object], ingredients: str) -> bool:
    """Tell whether a result was made with a name, and its node group already shows these objects, in this order."""
    groups = [m.node_group for m in item.modifiers if m.type == "NODES" and _is_ours(m.node_group)]
    if item.get(NAME) != name or len(groups) != 1 or groups[0].get(MADE_OF) != ingredients:
        return False
    return placed_objects(groups[0]) == list(sources)


def _move_points(mesh: bpy.types.Mesh, position: np.ndarray, attributes: Mapping[str, tuple[str, np.ndarray]]) -> bool:
    """Give a mesh of as many points other places and values; tell whether it has just these attributes."""
    kept = {"position": "FLOAT_VECTOR", HIDE_VIEWPORT: "BOOLEAN", HIDE_RENDER: "BOOLEAN"}
    there = {a.name: a.data_type for a in mesh.attributes if not a.name.startswith(".")}
    wanted = {name: kind for name, (kind, _) in attributes.items()}
    if len(mesh.vertices) != len(position) or mesh.users != 1 or {**kept, **wanted} != {**kept, **there}:
        return False
    if HIDE_VIEWPORT in there or HIDE_RENDER in there:
        # Points have other classes now.
        return False
    _write_points(mesh, position, attributes)
    mesh.update()
    return True


def _is_ours(group: bpy.types.NodeTree | None) -> bool:
    return group is not None and bool(group.get(RESULT_TAG))


def _build_anew(
    modifier: bpy.types.Modifier,
    name: str,
    sources: Sequence[bpy.types.Object | bpy.types.Collection],
    classes: Sequence[str],
    followed: Sequence[Followed],
) -> None:
    """Give a modifier a group that shows these objects; its own becomes that one."""
    old = modifier.node_group
    shown = get_inputs(modifier) if old is not None else {}
    # With every node that is added Blender would tell those that use it.
    modifier.node_group = None
    own = old is not None and old.is_editable and _is_ours(old) and old.users == 0
    modifier.node_group = build_node_group(name, sources, classes, followed, old if own else None)
    set_inputs(modifier, shown)


def _set_points(
    item: bpy.types.Object, name: str, position: np.ndarray, attributes: Mapping[str, tuple[str, np.ndarray]]
) -> None:
    """Give a result other points."""
    mesh = item.data
    if mesh.users == 1 and mesh.is_editable and mesh.get(RESULT_TAG):
        mesh.clear_geometry()
        for key in [key for key in mesh.keys() if key != RESULT_TAG]:  # noqa: SIM118 - data is not iterable
            del mesh[key]
        _fill(mesh, position, attributes)
        return
    new = _point_mesh(name, position, attributes)
    for material in mesh.materials:
        new.materials.append(material)
    item.data = new


def _point_mesh(name: str, position: np.ndarray, attributes: Mapping[str, tuple[str, np.ndarray]]) -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new(name)
    mesh[RESULT_TAG] = True
    _fill(mesh, position, attributes)
    return mesh


def _fill(mesh: bpy.types.Mesh, position: np.ndarray, attributes: Mapping[str, tuple[str, np.ndarray]]) -> None:
    """Give a mesh that has no points these."""
    mesh.vertices.add(len(position))
    # Blender adds them selected, and what is done with selected instances would be done with all.
    mesh.vertices.foreach_set("select", np.zeros(len(position), bool))
    for attribute_name, (kind, _) in attributes.items():
        mesh.attributes.new(attribute_name, kind, "POINT")
    _write_points(mesh, position, attributes)
    mesh.update()


def _write_points(mesh: bpy.types.Mesh, position: np.ndarray, attributes: Mapping[str, tuple[str, np.ndarray]]) -> None:
    # As an attribute, which is copied as a whole; vertices are set one after the other.
    mesh.attributes["position"].data.foreach_set("vector", np.ascontiguousarray(position, np.float32).ravel())
    for attribute_name, (kind, values) in attributes.items():
        dtype = {"INT": np.int32, "BOOLEAN": bool}.get(kind, np.float32)
        mesh.attributes[attribute_name].data.foreach_set(_WRITTEN[kind], np.ascontiguousarray(values, dtype).ravel())


@dataclass(frozen=True)
class EmptiedGroup:
    """What the node group of a result was made of before its parts were taken out; see :func:`empty_group`."""

    item: Reference
    name: str
    sources: tuple[Reference, ...]
    classes: tuple[str, ...]
    followed: tuple[tuple[Reference, int], ...]


def empty_group(item: bpy.types.Object) -> EmptiedGroup | None:
    """Take all parts out of a result's node group, and return what it was made of; None where it has no group that can be made anew.

    Undo keeps a group as it is where the steps before and after it say the same of it. Parts that were made for it since are in
    neither, and are freed: it must not lead to them then.
    """
    modifier = our_modifier(item)
    group = modifier.node_group if modifier is not None else None
    if group is None or not group.is_editable or not group.get(MADE_OF):
        return None
    sources, followed = placed_objects(group), followed_targets(group)
    if any(source is None for source in sources) or any(one.target is None for one in followed):
        return None
    classes = ast.literal_eval(group[MADE_OF])[0]
    kept = EmptiedGroup(
        Reference(item, "result"),
        item.get(NAME, group.name),
        tuple(Reference(source, "source") for source in sources if source is not None),
        tuple(classes),
        tuple((Reference(one.target, "target"), one.vertices) for one in followed),
    )
    for node in _part_nodes(group):
        node.node_tree = None
    return kept


def _part_nodes(group: bpy.types.NodeTree) -> list[bpy.types.Node]:
    return [node for node in group.nodes if node.bl_idname == "GeometryNodeGroup"]


def fill_group(kept: EmptiedGroup) -> None:
    """Make the group of a result what it was before it was emptied, where that is still needed and there."""
    item = kept.item.find()
    modifier = our_modifier(item) if isinstance(item, bpy.types.Object) else None
    if modifier is None or all(node.node_tree is not None for node in _part_nodes(modifier.node_group)):
        return
    sources = [source.find() for source in kept.sources]
    followed = [Followed(target.find(), vertices) for target, vertices in kept.followed]
    if any(source is None for source in sources) or any(one.target is None for one in followed):
        # The next run makes it anew.
        modifier.node_group[MADE_OF] = ""
        return
    _build_anew(modifier, kept.name, sources, kept.classes, followed)


def rename_result(item: bpy.types.Object, name: str) -> None:
    """Give a result the name of what made it."""
    item.name = name
    item[NAME] = name


def remove_result(item: bpy.types.Object) -> None:
    """Remove a result from the file, with its points and its node group where nothing else uses them."""
    mesh = item.data
    groups = [modifier.node_group for modifier in item.modifiers if modifier.type == "NODES"]
    bpy.data.objects.remove(item)
    if mesh is not None and not mesh.users and mesh.get(RESULT_TAG):
        bpy.data.meshes.remove(mesh)
    for group in groups:
        if _is_ours(group) and not group.users:
            remove_group(group)
