"""What the node group of a result says: what it places, what its points follow, and what it was made of."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import bpy

from ..classes.node_tree import PART, parts_of
from ..targets.subdivision import FURTHER
from ..targets.target import RESULT_TAG, head_of, shown_collection

__all__ = [
    "FINER_COUNTS",
    "MADE_OF",
    "PLACE_EMPTY",
    "PLACE_FAMILY",
    "WAY_BACK",
    "Finer",
    "Followed",
    "Rest",
    "classes_of",
    "followed_in",
    "have_built_anew",
    "kind_of",
    "made_of",
    "placed_objects",
    "placing_inputs",
    "put_at_rest",
    "show_input",
    "target_inputs",
    "undoes_own_transform",
]

# Which nodes a group has: with another number results get new ones in their next run.
LAYOUT = 4
# What a group was made of apart from its objects, as a custom property.
MADE_OF = "esh_made_of"
# Parts that place something, by what it is.
PLACE_OBJECT, PLACE_EMPTY, PLACE_COLLECTION, PLACE_FAMILY = (
    "Place Object",
    "Place Empty",
    "Place Collection",
    "Place Family",
)
# The part that undoes a result's own transform.
WAY_BACK = "Way Back"
# Inputs of a part: how many vertices a target has at finer levels.
FINER_COUNTS = tuple(f"finer_{more}" for more in range(1, FURTHER + 1))


class Rest(NamedTuple):
    """How a target stood when points were placed on it: where its origin was, and the rows of what turns directions into its own."""

    place: tuple[float, ...]
    x: tuple[float, ...]
    y: tuple[float, ...]
    z: tuple[float, ...]


class Finer(NamedTuple):
    """How far a target was subdivided when points were placed on it, and how many vertices it has at each finer level."""

    level: int
    vertices: tuple[int, ...]


class Followed(NamedTuple):
    """What points follow: a target, how many vertices it had, whether it was mirrored, which turns triangles over, and how it stood.

    Groups of earlier versions do not look whether it is mirrored, or how it stands: there these are None. The last one is None of what
    is not subdivided, and where that says nothing of its vertices.
    """

    target: bpy.types.Object
    vertices: int
    mirrored: bool | None = False
    rest: Rest | None = None
    finer: Finer | None = None


def show_input(class_name: str) -> str:
    """Return what the input is called that shows or hides a class."""
    return f"Show {class_name}"


def target_inputs(count: int) -> list[str]:
    """Return what the inputs are called that name so many targets, in the order of ``esh_target``.

    Blender has a copy of a result follow the copy of its target where both are copied together, as of all that modifiers name.
    """
    return ["Target"] if count == 1 else [f"Target {number}" for number in range(1, count + 1)]


def placed_objects(group: bpy.types.NodeTree) -> list[bpy.types.Object | bpy.types.Collection | None]:
    """Return the objects that a group places, and collections as one, in the order that ``instance_index`` counts."""
    return [socket.default_value for socket in _placing(group)]


def placing_inputs(result: bpy.types.Object) -> list[bpy.types.NodeSocket]:
    """Return the inputs that name what a result places, in that order; none where its group is not its own alone."""
    groups = [m.node_group for m in result.modifiers if m.type == "NODES" and m.node_group is not None]
    groups = [group for group in groups if group.get(RESULT_TAG)]
    return _placing(groups[0]) if len(groups) == 1 and groups[0].users == 1 else []


def _placing(group: bpy.types.NodeTree) -> list[bpy.types.NodeSocket]:
    found = []
    for node in group.nodes:
        if node.bl_idname == "GeometryNodeGroup":
            # An object or a collection that it takes is what it places; those that points follow come from the group's inputs.
            taken = [socket for socket in node.inputs if socket.type in ("OBJECT", "COLLECTION")]
            found += [socket for socket in taken if not socket.is_linked]
        # In files of the first version all nodes are in one group.
        elif node.bl_idname == "GeometryNodeCollectionInfo":
            found.append(node.inputs["Collection"])
        elif node.bl_idname == "GeometryNodeObjectInfo" and node.inputs["As Instance"].default_value:
            found.append(node.inputs["Object"])
    return found


def followed_in(group: bpy.types.NodeTree) -> list[Followed]:
    """Return what the points of a group follow, in the order of ``esh_target``, as its nodes say; targets may be gone.

    The group takes its targets as inputs, which only a modifier knows: they are None here. Those of earlier versions hold them.
    """
    found = []
    for info in _object_infos(group):
        item, told = info.inputs["Object"].default_value, _triangle_node(info)
        if told is not None:
            given = told.inputs
            mirrored = given["side"].default_value < 0.0
            found.append(Followed(item, given["vertices"].default_value, mirrored, _rest_of(told), _finer_of(told)))
            continue
        # In files of earlier versions.
        sizes = [link.to_node for link in info.outputs["Geometry"].links]
        sizes = [node for node in sizes if node.bl_idname == "GeometryNodeAttributeDomainSize"]
        for compare in (link.to_node for size in sizes for link in size.outputs["Point Count"].links):
            numbers = [socket for socket in compare.inputs if socket.enabled and not socket.is_linked]
            vertices = int(numbers[0].default_value)
            found.append(Followed(item, vertices, _mirrored_before(info)))
    return found


def _object_infos(group: bpy.types.NodeTree) -> Iterator[bpy.types.Node]:
    """Go through the nodes that read an object in a group's parts, and in parts of these, in the order of targets."""
    for part in parts_of(group):
        yield from (node for node in part.nodes if node.bl_idname == "GeometryNodeObjectInfo")
        yield from _object_infos(part)


def put_at_rest(group: bpy.types.NodeTree, followed: Sequence[Followed]) -> None:
    """Tell a group that was made for these targets how they stand now; to build it anew would take longer than all the rest."""
    nodes = [node for info in _object_infos(group) if (node := _triangle_node(info)) is not None]
    for node, told in zip(nodes, followed, strict=False):
        if told.rest is not None and _rest_of(node) != told.rest:
            node.inputs["known"].default_value = True
            for name, value in told.rest._asdict().items():
                node.inputs[name].default_value = value


def _triangle_node(info: bpy.types.Node) -> bpy.types.Node | None:
    """Return the part that finds the triangles of a target, or None in groups of earlier versions."""
    nodes = [link.to_node for link in info.outputs["Transform"].links]
    return next((node for node in nodes if node.bl_idname == "GeometryNodeGroup" and "vertices" in node.inputs), None)


def _rest_of(node: bpy.types.Node) -> Rest | None:
    """Return how a target stood, as the part says that finds its triangles."""
    known = node.inputs["known"].default_value
    return Rest(*(tuple(node.inputs[name].default_value) for name in Rest._fields)) if known else None


def _finer_of(node: bpy.types.Node) -> Finer | None:
    """Return how far a target was subdivided, as the part says that finds its triangles; None where it does not say so."""
    given = node.inputs
    if "level" not in given:
        return None
    counts = (given[name].default_value for name in FINER_COUNTS)
    return Finer(given["level"].default_value, tuple(count for count in counts if count > 0))


def _mirrored_before(info: bpy.types.Node) -> bool | None:
    """Return whether a target was mirrored when points were placed on it, as its nodes say; None where they do not."""
    transformed = [link.to_node for link in info.outputs["Transform"].links]
    whole = [node for node in transformed if node.bl_idname == "FunctionNodeMatrixDeterminant"]
    over = [link.to_node.operation for node in whole for link in node.outputs[0].links]
    return over[0] == "GREATER_THAN" if over else None


def made_of(classes: Sequence[str], followed: Sequence[Followed]) -> str:
    """Return what a group is made of apart from its objects: equal for equal groups, within one session of Blender.

    How targets stand is not part of it: see :func:`put_at_rest`.
    """
    told = [(one.target and one.target.session_uid, one.vertices, one.mirrored, *(one.finer or ())) for one in followed]
    return repr([list(classes), told, LAYOUT])


def classes_of(group: bpy.types.NodeTree) -> list[str]:
    """Return the names of the classes that a group was made for."""
    told = ast.literal_eval(group.get(MADE_OF) or "[[]]")
    return list(told[0])


def have_built_anew(group: bpy.types.NodeTree) -> None:
    """Have the next run make a group anew, whatever it is made of."""
    group[MADE_OF] = repr([classes_of(group), None, None])


def undoes_own_transform(group: bpy.types.NodeTree) -> bool:
    """Tell whether what follows a target in a group does so wherever the result itself stands; it did not in earlier versions."""
    return any(str(part.get(PART, "")).startswith(WAY_BACK) for part in parts_of(group))


def kind_of(source: bpy.types.Object | bpy.types.Collection | None) -> str:
    """Return what the part of a group is called that places something; all of a kind are placed alike, but for families."""
    if isinstance(source, bpy.types.Collection):
        return PLACE_COLLECTION if head_of(source) is None else PLACE_FAMILY
    return PLACE_OBJECT if source is None or shown_collection(source) is None else PLACE_EMPTY
