"""The result in Blender: one object, a mesh of points with attributes, and the modifier that instances objects on them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import bpy
import numpy as np

from ..classes.node_tree import remove_group
from ..targets.in_scenes import in_several_scenes
from ..targets.mesh_attributes import write_attribute
from ..targets.target import RESULT_TAG, RESULT_TARGET, is_result
from .attributes import HIDE_RENDER, HIDE_VIEWPORT, OVERLAPPING, OVERLAPPING_ON_GROUND
from .display import follow, get_inputs, our_modifier, set_inputs
from .kept_ground import CLASSES_OF_POINTS
from .local_views import join_local_views
from .node_group import build_node_group
from .node_group_contents import MADE_OF, Followed, made_of, placed_objects, put_at_rest

__all__ = [
    "CLASS_NAMES",
    "NAME",
    "find_result",
    "is_copy",
    "mark_points",
    "names_on",
    "remove_result",
    "rename_result",
    "set_node_group",
    "write_result",
]

# Custom property of a result: the name that it was made with.
NAME = "esh_scatter_name"
# And what its indices count: names of classes, and for each the names of its sizes, as JSON.
CLASS_NAMES = "esh_scatter_classes"
# What only points have of which some overlap.
_MARKS = (OVERLAPPING, OVERLAPPING_ON_GROUND)


def find_result(
    scene: bpy.types.Scene, target: bpy.types.Object | bpy.types.Collection, name: str
) -> bpy.types.Object | None:
    """Return the object of ``scene`` that an earlier run with this name made on this target, whatever it is called now.

    Of a result and its copies it is the one that was there first; one that another scene shows, too, is that scene's.
    """
    found = [item for item in _results(scene, target, name) if not is_shared(item)]
    return min(found, key=lambda item: item.session_uid, default=None)


def names_on(
    scene: bpy.types.Scene,
    target: bpy.types.Object | bpy.types.Collection | None,
    besides: Collection[bpy.types.Object | None],
) -> set[str]:
    """Return the names that results of a scene on a target were made with, besides some: a run with such a name would replace them."""
    there = [item for item in scene.objects if target is not None and item.get(RESULT_TARGET) == target]
    return {item.get(NAME, "") for item in there if is_result(item) and item not in besides}


def is_shared(item: bpy.types.Object) -> bool:
    """Tell whether several scenes show an object, or whether it belongs to a library: it is not for one of them to change."""
    return in_several_scenes(item) or not item.is_editable


def is_copy(item: bpy.types.Object, result: bpy.types.Object) -> bool:
    """Tell whether an object was copied from a result: it was made as that was, or shows what that shows by the same nodes.

    Where it was copied together with its target it stands on the copy of that: then its classes tell.
    """
    if item.get(NAME) == result.get(NAME) and (
        item.get(RESULT_TARGET) == result.get(RESULT_TARGET) or _classes_of(item) & _classes_of(result)
    ):
        return True
    own, others = our_modifier(item), our_modifier(result)
    return own is not None and others is not None and own.node_group == others.node_group


def _classes_of(item: bpy.types.Object) -> set[int]:
    return set(item.data.get(CLASSES_OF_POINTS, ()))


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
        replaced: Result of an earlier run; its name, own transform, collections and other modifiers stay. None makes a new object, and
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
    if replaced is not None:
        _take_from_parent(replaced)
    if replaced is not None and _shows(replaced, name, sources, ingredients):
        # To build the same group once more takes longer than all the rest.
        if not _move_points(replaced.data, position, attributes):
            _set_points(replaced, name, position, attributes)
        modifier = our_modifier(replaced)
        if modifier is not None:
            put_at_rest(modifier.node_group, followed)
            follow(modifier, followed)
        return replaced
    if replaced is None:
        mesh = _point_mesh(name, position, attributes)
        for earlier in _results(scene, target, name):
            if is_shared(earlier) and scene.collection.objects.get(earlier.name) == earlier:
                scene.collection.objects.unlink(earlier)
        item = bpy.data.objects.new(name, mesh)
        scene.collection.objects.link(item)
        join_local_views(scene, item, target)
    else:
        item = replaced
        _set_points(item, name, position, attributes)
    modifier = our_modifier(item)
    if modifier is None:
        modifier = item.modifiers.new("ESH Scatter", "NODES")
    set_node_group(modifier, name, sources, classes, followed)
    item[RESULT_TAG] = True
    if target is not None:
        item[RESULT_TARGET] = target
    item[NAME] = name
    return item


def _take_from_parent(item: bpy.types.Object) -> None:
    """Have a result's parent move it from where that stands now on: its points are given in the world, and its own transform stays."""
    own, world = item.matrix_basis, item.matrix_world
    if item.parent is None or item.constraints or not world.determinant() or np.allclose(own, world, atol=1e-6):
        return
    item.matrix_parent_inverse = item.matrix_parent_inverse @ own @ world.inverted()


def _shows(item: bpy.types.Object, name: str, sources: Sequence[bpy.types.Object], ingredients: str) -> bool:
    """Tell whether a result was made with a name, and its node group already shows these objects, in this order."""
    groups = [m.node_group for m in item.modifiers if m.type == "NODES" and _is_ours(m.node_group)]
    if item.get(NAME) != name or len(groups) != 1 or groups[0].get(MADE_OF) != ingredients:
        return False
    return placed_objects(groups[0]) == list(sources)


def _move_points(mesh: bpy.types.Mesh, position: np.ndarray, attributes: Mapping[str, tuple[str, np.ndarray]]) -> bool:
    """Give a mesh of as many points other places and values; tell whether it has just these attributes, but for marks."""
    rare = dict.fromkeys((HIDE_VIEWPORT, HIDE_RENDER, *_MARKS), "BOOLEAN")
    kept = {"position": "FLOAT_VECTOR", **rare}
    there = {a.name: a.data_type for a in mesh.attributes if not a.name.startswith(".")}
    wanted = {name: kind for name, (kind, _) in attributes.items()}
    if len(mesh.vertices) != len(position) or mesh.users != 1 or {**kept, **wanted} != {**kept, **there}:
        return False
    if HIDE_VIEWPORT in there or HIDE_RENDER in there:
        # Points have other classes now.
        return False
    mark_points(mesh, attributes)
    _write_points(mesh, position, attributes)
    mesh.update()
    return True


def mark_points(mesh: bpy.types.Mesh, attributes: Mapping[str, tuple[str, np.ndarray]]) -> None:
    """Give points the marks of what overlaps that are among some attributes, and no others."""
    for name in _MARKS:
        if name not in attributes and name in mesh.attributes:
            mesh.attributes.remove(mesh.attributes[name])
        elif name in attributes:
            if name not in mesh.attributes:
                mesh.attributes.new(name, "BOOLEAN", "POINT")
            write_attribute(mesh, name, attributes[name][1])


def _is_ours(group: bpy.types.NodeTree | None) -> bool:
    return group is not None and bool(group.get(RESULT_TAG))


def set_node_group(
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
    follow(modifier, followed)


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
    write_attribute(mesh, "position", position)
    for attribute_name, (_, values) in attributes.items():
        write_attribute(mesh, attribute_name, values)


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
