"""The geometry node group of a result: it puts the right object on every point, shows what was asked for, and follows the target.

Its inputs stand in the modifier panel. How much is shown counts in the viewport; renders are whole unless they are told otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import bpy

from ..classes.node_tree import Socket, Tree, parts_of, remove_unused
from ..classes.shown_geometry import as_it_stands, source_instance
from ..targets.target import RESULT_TAG, head_of
from .attributes import INSTANCE_INDEX, ROTATION, SCALE
from .follow_nodes import follow_targets, way_back
from .hiding_nodes import hidden_points
from .node_group_contents import (
    MADE_OF,
    PLACE_EMPTY,
    PLACE_FAMILY,
    WAY_BACK,
    Followed,
    kind_of,
    made_of,
    show_input,
    target_inputs,
)

__all__ = ["DISPLAYS", "build_node_group"]

# What is drawn of every object, in the order of the menu.
DISPLAYS = ("Objects", "Bounds", "Points")
# Radius of points, as a share of the objects' scale [m].
POINT_RADIUS = 0.1


def build_node_group(
    name: str,
    sources: Sequence[bpy.types.Object | bpy.types.Collection | None],
    classes: Sequence[str] = (),
    followed: Sequence[Followed] = (),
    group: bpy.types.NodeTree | None = None,
    same_inputs: bool = False,
) -> bpy.types.NodeTree:
    """Make a node group that instances ``sources[instance_index]`` on each point, turned and scaled by attributes.

    The sources' own rotation and scale count and stay live, their location does not. They are picked by comparing the
    index, one branch each, so that nothing depends on the order in which a list of instances is joined. Points may be hidden by
    attributes; a point without these shows.

    Args:
        name: Of the group.
        sources: What ``instance_index`` counts; None for what is gone.
        classes: Names of what ``class_index`` counts; each can be hidden by an input.
        followed: What the points follow, in the order of ``esh_target``; nothing leaves them where they are.
        group: An earlier one that becomes this one; None for a new one.
        same_inputs: Whether that one has the inputs of this one, and keeps them.
    """
    old_parts = parts_of(group) if group is not None else []
    tree = Tree(name, group, same_inputs)
    group = tree.group
    group[RESULT_TAG] = True
    group[MADE_OF] = made_of(classes, followed)
    # It is of use to its own points alone: no entry of Add Modifier.
    group.is_modifier = False
    if not same_inputs:
        _take_inputs(tree, classes, len(followed))
    tree.begin()
    inputs = tree.inputs
    points = inputs["Geometry"]
    tree.column(1)
    back = tree.add("FunctionNodeCombineMatrix").outputs[0]
    if followed:
        told = {name: inputs[name] for name in ("Follow", *target_inputs(len(followed)))}
        follow = partial(follow_targets, followed=followed)
        points, follows = tree.part("Follow", follow, own=True, points=points, **told)
        (back,) = tree.part(WAY_BACK, way_back, follows=follows)
    rotation = tree.attribute(ROTATION, "QUATERNION")
    tree.column(2)
    in_viewport = tree.call("GeometryNodeIsViewport")
    limited = tree.either(in_viewport, inputs["In Renders"])
    hidden = hidden_points(tree, in_viewport, limited, back, classes)
    tree.column(5)
    index = tree.switch("INT", hidden, tree.attribute(INSTANCE_INDEX, "INT"), -1)
    scale = tree.scaled(tree.attribute(SCALE, "FLOAT_VECTOR"), inputs["Scale"])
    display = _display(tree, limited)
    as_points = tree.compare("EQUAL", display, 2, "INT")
    as_bounds = tree.compare("EQUAL", display, 1, "INT")
    join = tree.add("GeometryNodeJoinGeometry")
    tree.column(6)
    placed = {"points": points, "index": index, "rotation": rotation, "scale": scale, "as_bounds": as_bounds}
    for number, source in enumerate(sources):
        kind = kind_of(source)
        build = partial(_instances, empty=kind == PLACE_EMPTY, head=head_of(source))
        (shown,) = tree.part(kind, build, own=kind == PLACE_FAMILY, **placed, number=number, source=source)
        tree.link(shown, join.inputs["Geometry"])
    tree.column(7)
    result = tree.switch("GEOMETRY", as_points, join.outputs["Geometry"], _dots(tree, points, index, scale))
    tree.column(8)
    if followed:
        result = tree.transformed(result, back)
    tree.column(9)
    tree.link(result, tree.add("NodeGroupOutput").inputs["Geometry"])
    next(one for one in group.interface.items_tree if one.name == "Display").default_value = DISPLAYS[0]
    remove_unused(old_parts)
    return group


def _dots(tree: Tree, points: Socket, index: Socket, scale: Socket) -> Socket:
    """Return points to be drawn in place of objects, as large as these are scaled."""
    dots = tree.add("GeometryNodeMeshToPoints")
    tree.link(points, dots.inputs["Mesh"])
    tree.link(tree.compare("GREATER_EQUAL", index, 0, "INT"), dots.inputs["Selection"])
    tree.link(tree.math("MULTIPLY", tree.parts(scale)[0], POINT_RADIUS), dots.inputs["Radius"])
    return dots.outputs[0]


def _take_inputs(tree: Tree, classes: Sequence[str], targets: int) -> None:
    tree.group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    share = {"min_value": 0.0, "max_value": 1.0, "subtype": "FACTOR"}
    length = {"min_value": 0.0, "subtype": "DISTANCE"}
    tree.take("Geometry", "NodeSocketGeometry")
    tree.take("Share", "NodeSocketFloat", 1.0, help="Share of the objects that the viewport shows", **share)
    tree.take("Display", "NodeSocketMenu", help="What the viewport shows of every object")
    tree.take("Scale", "NodeSocketFloat", 1.0, help="Factor on the size of every object", min_value=0.0)
    if targets:
        tree.take("Follow", "NodeSocketBool", True, help="Move with the target, and bend with it")
        _take_targets(tree, targets)
    panel = tree.group.interface.new_panel("Camera", default_closed=True)
    told = "Leave out what the active camera does not see"
    tree.take("Culling", "NodeSocketBool", False, help=told, parent=panel)
    told = "How far outside the view objects are still shown, as a share of the picture"
    tree.take("Margin", "NodeSocketFloat", 0.1, help=told, parent=panel, min_value=0.0)
    told = "How far from the camera objects are shown. 0 means no limit"
    tree.take("Distance", "NodeSocketFloat", 0.0, help=told, parent=panel, **length)
    told = "Apply share, display and camera culling to renders, too"
    tree.take("In Renders", "NodeSocketBool", False, help=told, parent=panel)
    if classes:
        panel = tree.group.interface.new_panel("Classes", default_closed=True)
        for class_name in classes:
            tree.take(show_input(class_name), "NodeSocketBool", True, help=f"Show {class_name}", parent=panel)


def _take_targets(tree: Tree, count: int) -> None:
    several = count > 1
    panel = tree.group.interface.new_panel("Targets", default_closed=True) if several else None
    told = "What the objects follow: the mesh that they were placed on, or a copy of it"
    for name in target_inputs(count):
        tree.take(name, "NodeSocketObject", help=told, **({"parent": panel} if several else {}))


def _display(tree: Tree, limited: Socket) -> Socket:
    """Return the number of what is drawn of every object, which is the object itself where nothing is ``limited``."""
    # Two menus cannot hang on one input: one menu gives a number, and numbers choose.
    menu = tree.add("GeometryNodeMenuSwitch", data_type="INT")
    for item, label in zip(menu.enum_items, DISPLAYS, strict=False):
        item.name = label
    menu.enum_items.new(DISPLAYS[2])
    tree.link(tree.inputs["Display"], menu.inputs["Menu"])
    for number, label in enumerate(DISPLAYS):
        menu.inputs[label].default_value = number
    return tree.switch("INT", limited, 0, menu.outputs[0])


def _instances(tree: Tree, *, empty: bool, head: bpy.types.Object | None) -> list[Socket]:
    """Return the instances of one object, or of a collection as one, or of their bounds, on those points that are its own."""
    inputs = tree.inputs
    geometry = source_instance(tree, inputs["source"], empty=empty, head=head)
    tree.column(2)
    bounds = tree.call("GeometryNodeBoundBox", geometry)
    boxed = tree.call("GeometryNodeGeometryToInstance", bounds)
    tree.column(3)
    shown = tree.switch("GEOMETRY", inputs["as_bounds"], geometry, boxed)
    standing = as_it_stands(tree, geometry, shown)
    tree.column(4)
    instance = tree.add("GeometryNodeInstanceOnPoints")
    # Picking the one instance, rather than wrapping it, keeps the instances flat: one level, one object each.
    instance.inputs["Pick Instance"].default_value = True
    chosen = tree.compare("EQUAL", inputs["index"], inputs["number"], "INT")
    for name, value in (
        *(("Points", inputs["points"]), ("Selection", chosen), ("Instance", standing)),
        *(("Rotation", inputs["rotation"]), ("Scale", inputs["scale"])),
    ):
        tree.link(value, instance.inputs[name])
    return [instance.outputs["Instances"]]
