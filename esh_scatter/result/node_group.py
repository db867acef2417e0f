"""The geometry node group of a result: it puts the right object on every point, shows what was asked for, and follows the target.

Its inputs stand in the modifier panel. How much is shown counts in the viewport; renders are whole unless they are told otherwise.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import bpy

from ..classes.node_tree import PART, Socket, Tree, parts_of, remove_unused
from ..classes.shown_geometry import as_it_stands, source_instance
from ..targets.subdivision import FURTHER
from ..targets.target import RESULT_TAG, head_of, shown_collection

__all__ = [
    "ALIGN",
    "CORNERS",
    "DISPLAYS",
    "EDGE",
    "FACE_NORMAL",
    "FAMILY",
    "FINER_CORNERS",
    "GROUND_POINT",
    "HEIGHT",
    "HIDE_RENDER",
    "HIDE_VIEWPORT",
    "INSTANCE_INDEX",
    "MADE_OF",
    "ROTATION",
    "ROUNDING",
    "SCALE",
    "TARGET",
    "UP",
    "WEIGHTS",
    "Finer",
    "Followed",
    "Rest",
    "build_node_group",
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

INSTANCE_INDEX = "instance_index"
# Which nodes a group has: with another number results get new ones in their next run.
LAYOUT = 4
# What a group was made of apart from its objects, as a custom property.
MADE_OF = "esh_made_of"
ROTATION = "rotation"
SCALE = "scale"
HIDE_VIEWPORT = "hide_viewport"
HIDE_RENDER = "hide_render"
# What ties a point to a target: the vertices and weights of the triangle that it stands on, and which of several targets; where that
# point of the ground was, and the triangle's first edge and normal, all in the world; and how far the object follows the slope.
CORNERS, WEIGHTS, TARGET = ("esh_vertex_0", "esh_vertex_1", "esh_vertex_2"), "esh_barycentric", "esh_target"
GROUND_POINT, EDGE, FACE_NORMAL, ALIGN = "ground_point", "ground_edge", "ground_face", "align"
# What leads to the numbers of these vertices where a target that is subdivided is so further, as in renders; results on others have no
# such attributes. With its edges cut into 1 + t times as many parts a number is vertex + t * (step + t * square).
FINER_CORNERS = (
    ("esh_finer_step_0", "esh_finer_step_1", "esh_finer_step_2"),
    ("esh_finer_square_0", "esh_finer_square_1", "esh_finer_square_2"),
)

# The part of the way from that point of the ground to an object's origin that goes along the object's own axis: it leans as the object
# does, and the rest as the ground does. What has none has no such attribute.
HEIGHT = "own_height"

# What is drawn of every object, in the order of the menu.
DISPLAYS = ("Objects", "Bounds", "Points")
# Parts that place something, by what it is.
_OBJECT, _EMPTY, _COLLECTION, FAMILY = "Place Object", "Place Empty", "Place Collection", "Place Family"
# The part that undoes a result's own transform.
WAY_BACK = "Way Back"
# Targets that one part looks at: with every node Blender looks at all nodes of a tree anew. A result on 200 leaf cards took 40 s to
# make with all of them in one.
MOST_TOGETHER = 8
# Radius of points, as a share of the objects' scale [m].
POINT_RADIUS = 0.1
UP = (0.0, 0.0, 1.0)
# Inputs of a part: how many vertices a target has at finer levels.
_FINER_COUNTS = tuple(f"finer_{more}" for more in range(1, FURTHER + 1))
# Of a ground point that has not moved, what float32 may make of it, as a share of its distance from the origin.
ROUNDING = 3e-7


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
    counts = (given[name].default_value for name in _FINER_COUNTS)
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
        points, follows = tree.part("Follow", lambda part: _follow(part, followed), own=True, points=points, **told)
        (back,) = tree.part(WAY_BACK, _way_back, follows=follows)
    rotation = tree.attribute(ROTATION, "QUATERNION")
    tree.column(2)
    in_viewport = tree.call("GeometryNodeIsViewport")
    limited = tree.either(in_viewport, inputs["In Renders"])
    hidden = _hidden(tree, in_viewport, limited, back, classes)
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
        build = partial(_instances, empty=kind == _EMPTY, head=head_of(source))
        (shown,) = tree.part(kind, build, own=kind == FAMILY, **placed, number=number, source=source)
        tree.link(shown, join.inputs["Geometry"])
    tree.column(7)
    result = tree.switch("GEOMETRY", as_points, join.outputs["Geometry"], _dots(tree, points, index, scale))
    tree.column(8)
    if followed:
        result = tree.transformed(result, back)
    tree.column(9)
    tree.link(result, tree.add("NodeGroupOutput").inputs["Geometry"])
    socket = next(one for one in group.interface.items_tree if one.name == "Display")
    socket.default_value = DISPLAYS[0]
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


def _hidden(tree: Tree, in_viewport: Socket, limited: Socket, back: Socket, classes: Sequence[str]) -> Socket:
    """Tell which points are hidden; a matrix leads from where they are ``back`` into the result's own space."""
    inputs = tree.inputs
    limits = {
        "share": inputs["Share"],
        "culling": inputs["Culling"],
        "margin": inputs["Margin"],
        "distance": inputs["Distance"],
    }
    tree.column(3)
    (hidden,) = tree.part("Hidden, by Place", _limits, in_viewport=in_viewport, limited=limited, back=back, **limits)
    tree.column(4)
    for number, class_name in enumerate(classes):
        (hidden,) = tree.part(
            "Hidden Class", _hidden_class, hidden=hidden, number=number, show=inputs[show_input(class_name)]
        )
    return hidden


def _limits(tree: Tree) -> list[Socket]:
    """Tell which points are hidden whatever their class."""
    inputs = tree.inputs
    limited, share = inputs["limited"], inputs["share"]
    by_hand = tree.switch(
        "BOOLEAN",
        inputs["in_viewport"],
        tree.attribute(HIDE_RENDER, "BOOLEAN"),
        tree.attribute(HIDE_VIEWPORT, "BOOLEAN"),
    )
    random = tree.add("FunctionNodeRandomValue", data_type="FLOAT")
    # By the points' own numbers: what shows stays the same from run to run.
    tree.link(tree.attribute("id", "INT"), next(s for s in random.inputs if s.enabled and s.name == "ID"))
    value = next(socket for socket in random.outputs if socket.enabled)
    tree.column(2)
    too_many = tree.both(limited, tree.compare("GREATER_EQUAL", value, share))
    # All of them, whatever the rounding.
    too_many = tree.both(too_many, tree.compare("LESS_THAN", share, 1.0))
    where = {"margin": inputs["margin"], "distance": inputs["distance"], "back": inputs["back"]}
    (seen,) = tree.part("Seen, by Place", _seen, **where)
    tree.column(3)
    unseen = tree.both(limited, inputs["culling"], tree.no(seen))
    return [tree.either(by_hand, too_many, unseen)]


def _hidden_class(tree: Tree) -> list[Socket]:
    """Hide the points of a class that is not to show, beside those that are hidden already."""
    inputs = tree.inputs
    own = tree.compare("EQUAL", tree.attribute("class_index", "INT"), inputs["number"], "INT")
    return [tree.either(inputs["hidden"], tree.both(own, tree.no(inputs["show"])))]


def _seen(tree: Tree) -> list[Socket]:
    """Tell which points the active camera sees."""
    inputs = tree.inputs
    camera = tree.call("GeometryNodeInputActiveCamera")
    info = tree.add("GeometryNodeObjectInfo", transform_space="RELATIVE")
    tree.link(camera, info.inputs["Object"])
    lens = tree.add("GeometryNodeCameraInfo")
    tree.link(camera, lens.inputs[0])
    to_camera = tree.call("FunctionNodeInvertMatrix", info.outputs["Transform"])
    place = tree.call("FunctionNodeTransformPoint", tree.call("GeometryNodeInputPosition"), inputs["back"])
    local = tree.call("FunctionNodeTransformPoint", place, to_camera)
    tree.column(2)
    on_picture = tree.call("FunctionNodeProjectPoint", local, lens.outputs["Projection Matrix"])
    x, y, _ = tree.parts(tree.vector("ABSOLUTE", on_picture))
    # The picture is from -1 to 1: a share of it is twice as much.
    limit = tree.math("ADD", 1.0, tree.math("MULTIPLY", inputs["margin"], 2.0))
    inside = tree.both(tree.compare("LESS_EQUAL", x, limit), tree.compare("LESS_EQUAL", y, limit))
    in_front = tree.compare("LESS_THAN", tree.parts(local)[2], 0.0)
    near = tree.compare("LESS_EQUAL", tree.vector("LENGTH", local), inputs["distance"])
    unlimited = tree.compare("LESS_EQUAL", inputs["distance"], 0.0)
    return [tree.both(inside, in_front, tree.either(near, unlimited))]


def undoes_own_transform(group: bpy.types.NodeTree) -> bool:
    """Tell whether what follows a target in a group does so wherever the result itself stands; it did not in earlier versions."""
    return any(str(part.get(PART, "")).startswith(WAY_BACK) for part in parts_of(group))


def _way_back(tree: Tree) -> list[Socket]:
    """Return what leads from the world into the result's own space where points follow a target; nothing elsewhere.

    What follows is in the world already: a result that hangs on its target, or on what moves both, would be moved twice.
    """
    info = tree.add("GeometryNodeObjectInfo", transform_space="ORIGINAL")
    tree.link(tree.call("GeometryNodeSelfObject"), info.inputs["Object"])
    back = tree.call("FunctionNodeInvertMatrix", info.outputs["Transform"])
    return [tree.switch("MATRIX", tree.inputs["follows"], None, back)]


def _follow(tree: Tree, followed: Sequence[Followed]) -> list[Socket]:
    """Move points with the target, and turn what stands on them; what was moved by hand keeps its distance to the ground.

    Return them, and whether there is a target that any could follow.
    """
    tree.column(1)
    # Points that are not tied to the ground have no weights.
    tied = tree.compare("GREATER_THAN", tree.vector("LENGTH", tree.attribute(WEIGHTS, "FLOAT_VECTOR")), 0.0)
    corner, edge, side, weights, mirror, there, any_there = _triangle(tree, followed)
    follows = tree.both(tree.inputs["Follow"], tied, there)
    tree.column(3)
    (ground,) = tree.part("Ground Point", _ground_now, corner=corner, edge=edge, side=side, weights=weights)
    tree.column(4)
    standing = {"ground": ground, "edge": edge, "side": side, "mirror": mirror}
    place, new_rotation = tree.part("Standing, by Height", _standing_now, **standing)
    tree.column(5)
    # Kept before the points are moved, with which all that is asked of the ground would change.
    turn = tree.add("GeometryNodeStoreNamedAttribute", data_type="QUATERNION", domain="POINT")
    named = {socket.name: socket for socket in turn.inputs if socket.enabled}
    named["Name"].default_value = ROTATION
    for value, name in ((tree.inputs["points"], "Geometry"), (follows, "Selection"), (new_rotation, "Value")):
        tree.link(value, named[name])
    move = tree.add("GeometryNodeSetPosition")
    tree.link(turn.outputs[0], move.inputs["Geometry"])
    tree.link(follows, move.inputs["Selection"])
    tree.link(place, move.inputs["Position"])
    return [move.outputs[0], tree.both(tree.inputs["Follow"], any_there)]


def _triangle(tree: Tree, followed: Sequence[Followed]) -> list[Socket]:
    """Return of every point what :func:`_triangle_now` does, of the target that it stands on, and whether there is any target."""
    names = target_inputs(len(followed))
    if len(followed) <= MOST_TOGETHER:
        return _triangle_of_some(tree, followed, names, 0)
    found: list[Socket] = []
    there: list[Socket] = []
    for first in range(0, len(followed), MOST_TOGETHER):
        some, own_names = followed[first : first + MOST_TOGETHER], names[first : first + MOST_TOGETHER]
        tree.column(1)
        *own, any_there = tree.part(
            "Triangles of Targets",
            partial(_triangle_of_some, followed=some, names=own_names, first=first),
            own=True,
            **{name: tree.inputs[name] for name in own_names},
        )
        tree.column(2)
        there.append(any_there)
        found = own if not found else _of_its_own(tree, "GREATER_EQUAL", first, found, own)
    return [*found, tree.either(*there)]


def _of_its_own(tree: Tree, operation: str, number: int, others: list[Socket], own: list[Socket]) -> list[Socket]:
    """Choose for every point between what others have found and ``own``, by how the number of its target compares with one."""
    its = tree.compare(operation, tree.attribute(TARGET, "INT"), number, "INT")
    pairs = list(zip(others, own, strict=True))
    return [tree.switch("VECTOR", its, *pair) for pair in pairs[:-1]] + [tree.switch("BOOLEAN", its, *pairs[-1])]


def _triangle_of_some(tree: Tree, followed: Sequence[Followed], names: Sequence[str], first: int) -> list[Socket]:
    """Return the same of some targets, of which ``first`` is the number of the first one; ``names`` are those of their inputs."""
    found: list[Socket] = []
    there: list[Socket] = []
    for number, (told, target) in enumerate(zip(followed, names, strict=True), start=first):
        tree.column(1)
        info = tree.add("GeometryNodeObjectInfo", transform_space="ORIGINAL")
        tree.link(tree.inputs[target], info.inputs["Object"])
        tree.column(2)
        rest = told.rest or Rest((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        more: dict[str, Any] = {}
        if told.finer is not None:
            counts = (*told.finer.vertices, *[-1] * FURTHER)
            more = {"level": told.finer.level, **dict(zip(_FINER_COUNTS, counts, strict=False))}
        own = tree.part(
            "Triangle of Divided Target" if more else "Triangle of Target",
            _triangle_of_any_level if more else _triangle_now,
            geometry=info.outputs["Geometry"],
            transform=info.outputs["Transform"],
            vertices=told.vertices,
            side=-1.0 if told.mirrored else 1.0,
            known=told.rest is not None,
            **rest._asdict(),
            **more,
        )
        there.append(own[-1])
        found = own if not found else _of_its_own(tree, "EQUAL", number, found, own)
    return [*found, tree.either(*there)]


def _triangle_of_any_level(tree: Tree) -> list[Socket]:
    """Return what :func:`_triangle_now` does, also where the target is subdivided further than it was."""
    return _triangle_now(tree, divided=True)


def _triangle_now(tree: Tree, divided: bool = False) -> list[Socket]:
    """Return of every point's triangle where its first corner is now, the two edges from there, in the world.

    Then what weights its corners have; what mirrors where it was, if the target was mirrored since: factors of x, y and z; and whether
    there is such a triangle. A mesh with other vertices than the points were placed on moves them with the whole target: their
    triangles are those that were there; where it is ``divided`` it may be so further.
    """
    inputs = tree.inputs
    transform = inputs["transform"]
    size = tree.add("GeometryNodeAttributeDomainSize", component="MESH")
    tree.link(inputs["geometry"], size.inputs[0])
    count = size.outputs["Point Count"]
    same = tree.compare("EQUAL", count, inputs["vertices"], "INT")
    stands = tree.both(inputs["known"], tree.compare("GREATER_THAN", count, 0, "INT"))
    position = tree.call("GeometryNodeInputPosition")
    tree.column(2)
    if divided:
        counts = {name: inputs[name] for name in _FINER_COUNTS}
        *number, further = tree.part("Vertices of Finer Levels", _numbers_now, count=count, **counts)
        same = tree.either(same, further)
    else:
        number = [tree.attribute(name, "INT") for name in CORNERS]
    a, b, c = (_sampled(tree, inputs["geometry"], position, one) for one in number)
    rest = tree.part("Triangle at Rest", _triangle_at_rest, **{name: inputs[name] for name in Rest._fields})
    tree.column(3)
    # Edges between places in the world would have the rounding of their coordinates, which far from its origin is as long as
    # they are: what stands there would be turned by it.
    sampled = [a, tree.vector("SUBTRACT", b, a), tree.vector("SUBTRACT", c, a)]
    corner, edge, side = (tree.switch("VECTOR", same, *pair) for pair in zip(rest, sampled, strict=True))
    weights = tree.switch("VECTOR", same, (0.0, 0.0, 0.0), tree.attribute(WEIGHTS, "FLOAT_VECTOR"))
    tree.column(4)
    found = [tree.call("FunctionNodeTransformPoint", corner, transform)]
    found += [tree.call("FunctionNodeTransformDirection", one, transform) for one in (edge, side)]
    determinant = tree.call("FunctionNodeMatrixDeterminant", transform)
    over = tree.compare("LESS_THAN", tree.math("MULTIPLY", determinant, inputs["side"]), 0.0)
    mirror = tree.switch("VECTOR", over, (1.0, 1.0, 1.0), (1.0, -1.0, 1.0))
    return [*found, weights, mirror, tree.either(same, stands)]


def _numbers_now(tree: Tree) -> list[Socket]:
    """Return the numbers of the vertices of every point's triangle, and whether there are as many vertices as at a finer level."""
    times: Any = 0
    for more, name in enumerate(_FINER_COUNTS, start=1):
        there = tree.compare("EQUAL", tree.inputs["count"], tree.inputs[name], "INT")
        times = tree.switch("INT", there, times, 2**more - 1)
    tree.column(2)
    found = []
    for names in zip(CORNERS, *FINER_CORNERS, strict=True):
        vertex, step, square = (tree.attribute(name, "INT") for name in names)
        (number,) = tree.part("Vertex of Finer Level", _number, vertex=vertex, step=step, square=square, times=times)
        found.append(number)
    return [*found, tree.compare("GREATER_THAN", times, 0, "INT")]


def _number(tree: Tree) -> list[Socket]:
    """Return the number of a vertex where edges have so many times more parts; see :data:`FINER_CORNERS`."""
    whole, inputs = "FunctionNodeIntegerMath", tree.inputs
    slope = tree.call(whole, inputs["square"], inputs["times"], operation="MULTIPLY")
    slope = tree.call(whole, slope, inputs["step"], operation="ADD")
    further = tree.call(whole, slope, inputs["times"], operation="MULTIPLY")
    return [tree.call(whole, further, inputs["vertex"], operation="ADD")]


def _triangle_at_rest(tree: Tree) -> list[Socket]:
    """Return a triangle that lies as a point's did when it was placed: its corner is that point; as the target saw it."""
    matrix = tree.add("FunctionNodeCombineMatrix")
    for row, name in enumerate(("x", "y", "z"), start=1):
        for column, value in enumerate(tree.parts(tree.inputs[name]), start=1):
            tree.link(value, matrix.inputs[f"Column {column} Row {row}"])
    tree.column(2)
    edge = tree.attribute(EDGE, "FLOAT_VECTOR")
    side = tree.vector("CROSS_PRODUCT", tree.attribute(FACE_NORMAL, "FLOAT_VECTOR"), edge)
    # From the target's origin: far from the world's, sums of whole coordinates would lose what differences keep.
    away = tree.vector("SUBTRACT", tree.attribute(GROUND_POINT, "FLOAT_VECTOR"), tree.inputs["place"])
    tree.column(3)
    return [tree.call("FunctionNodeTransformDirection", one, matrix.outputs[0]) for one in (away, edge, side)]


def _sampled(tree: Tree, geometry: Socket, position: Socket, number: Socket) -> Socket:
    """Return where the vertex of a number is, as the target itself sees it."""
    sampled = tree.add("GeometryNodeSampleIndex", data_type="FLOAT_VECTOR", domain="POINT")
    sockets = {socket.name: socket for socket in sampled.inputs if socket.enabled}
    tree.link(geometry, sockets["Geometry"])
    tree.link(position, sockets["Value"])
    tree.link(number, sockets["Index"])
    return next(socket for socket in sampled.outputs if socket.enabled)


def _ground_now(tree: Tree) -> list[Socket]:
    """Return the points of triangles where objects stand now."""
    # From one corner: far from the origin sums of whole coordinates would lose what differences keep.
    ground: Any = tree.inputs["corner"]
    for name, weight in zip(("edge", "side"), tree.parts(tree.inputs["weights"])[1:], strict=True):
        ground = tree.vector("ADD", ground, tree.scaled(tree.inputs[name], weight))
    before = tree.attribute(GROUND_POINT, "FLOAT_VECTOR")
    moved = tree.vector("LENGTH", tree.vector("SUBTRACT", ground, before))
    rounding = tree.math("MULTIPLY", tree.vector("LENGTH", before), ROUNDING)
    return [tree.switch("VECTOR", tree.compare("GREATER_THAN", moved, rounding), before, ground)]


def _standing_now(tree: Tree) -> list[Socket]:
    """Return where objects stand now, and how they are turned there.

    Where the target was mirrored since, its triangles go round the other way, and look to the side that they looked to. All that was
    is mirrored along y first: what is left of the way to where it is now is a turn.
    """
    edge, mirror = tree.inputs["edge"], tree.inputs["mirror"]
    _, over, _ = tree.parts(mirror)
    normal = tree.vector("CROSS_PRODUCT", edge, tree.scaled(tree.inputs["side"], over))
    edge_before, normal_before = (
        tree.vector("MULTIPLY", tree.attribute(name, "FLOAT_VECTOR"), mirror) for name in (EDGE, FACE_NORMAL)
    )
    turned = _turn(tree, (normal_before, edge_before), (normal, edge))
    tree.column(2)
    # What stands upright turns with the ground, but does not lean with it.
    upright = _turn(tree, (UP, edge_before), (UP, edge))
    tree.column(3)
    mix = tree.add("ShaderNodeMix", data_type="ROTATION")
    mixing = [socket for socket in mix.inputs if socket.enabled]
    for value, socket in zip((tree.attribute(ALIGN, "FLOAT"), upright, turned), mixing, strict=True):
        tree.link(value, socket)
    mixed = next(socket for socket in mix.outputs if socket.enabled)
    (rotation,) = tree.part("Mirrored Rotation", _mirrored_rotation, over=over)
    new_rotation = tree.call("FunctionNodeRotateRotation", rotation, mixed, rotation_space="GLOBAL")
    ways = {"ground": tree.inputs["ground"], "mirror": mirror, "turned": turned, "mixed": mixed}
    (place,) = tree.part("Origin", _origin_now, **ways)
    return [place, new_rotation]


def _origin_now(tree: Tree) -> list[Socket]:
    """Return where origins are: the ways there from the ground turn with it, but for what leans as the objects themselves do."""
    position = tree.call("GeometryNodeInputPosition")
    height = tree.attribute(HEIGHT, "FLOAT_VECTOR")
    away = tree.vector("SUBTRACT", position, tree.attribute(GROUND_POINT, "FLOAT_VECTOR"))
    tree.column(2)
    place: Any = tree.inputs["ground"]
    for way, how in ((tree.vector("SUBTRACT", away, height), "turned"), (height, "mixed")):
        mirrored = tree.vector("MULTIPLY", way, tree.inputs["mirror"])
        place = tree.vector("ADD", place, tree.call("FunctionNodeRotateVector", mirrored, tree.inputs[how]))
    return [place]


def _mirrored_rotation(tree: Tree) -> list[Socket]:
    """Return how objects were turned, along y mirrored if the factor is -1.

    No turn can mirror an object: it is mirrored within itself once more, and its top and its front are where their images are.
    """
    quaternion = tree.add("FunctionNodeRotationToQuaternion")
    tree.link(tree.attribute(ROTATION, "QUATERNION"), quaternion.inputs[0])
    w, x, y, z = quaternion.outputs
    x, z = (tree.math("MULTIPLY", part, tree.inputs["over"]) for part in (x, z))
    return [tree.call("FunctionNodeQuaternionToRotation", w, x, y, z)]


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


def kind_of(source: bpy.types.Object | bpy.types.Collection | None) -> str:
    """Return what the part of a group is called that places something; all of a kind are placed alike, but for families."""
    if isinstance(source, bpy.types.Collection):
        return _COLLECTION if head_of(source) is None else FAMILY
    return _OBJECT if source is None or shown_collection(source) is None else _EMPTY


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


def _turn(tree: Tree, before: tuple[Any, Any], now: tuple[Any, Any]) -> Socket:
    """Return the rotation from two axes, the first of which is kept, to two others."""
    frames = [
        tree.call("FunctionNodeAxesToRotation", *axes, primary_axis="Z", secondary_axis="X") for axes in (before, now)
    ]
    back = tree.call("FunctionNodeInvertRotation", frames[0])
    return tree.call("FunctionNodeRotateRotation", back, frames[1], rotation_space="GLOBAL")
