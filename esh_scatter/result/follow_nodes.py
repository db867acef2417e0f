"""Nodes that move the points of a result with its target, and turn what stands on them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from ..classes.node_tree import Socket, Tree
from ..targets.subdivision import FURTHER
from .attributes import (
    ALIGN,
    CORNERS,
    EDGE,
    FACE_NORMAL,
    FINER_CORNERS,
    GROUND_POINT,
    HEIGHT,
    ROTATION,
    TARGET,
    WEIGHTS,
)
from .node_group_contents import FINER_COUNTS, Followed, Rest, target_inputs

__all__ = ["ROUNDING", "UP", "follow_targets", "way_back"]

# Targets that one part looks at: with every node Blender looks at all nodes of a tree anew. A result on 200 leaf cards took 40 s to
# make with all of them in one.
MOST_TOGETHER = 8
UP = (0.0, 0.0, 1.0)
# Of a ground point that has not moved, what float32 may make of it, as a share of its distance from the origin.
ROUNDING = 3e-7


def way_back(tree: Tree) -> list[Socket]:
    """Return what leads from the world into the result's own space where points follow a target; nothing elsewhere.

    What follows is in the world already: a result that hangs on its target, or on what moves both, would be moved twice.
    """
    info = tree.add("GeometryNodeObjectInfo", transform_space="ORIGINAL")
    tree.link(tree.call("GeometryNodeSelfObject"), info.inputs["Object"])
    back = tree.call("FunctionNodeInvertMatrix", info.outputs["Transform"])
    return [tree.switch("MATRIX", tree.inputs["follows"], None, back)]


def follow_targets(tree: Tree, followed: Sequence[Followed]) -> list[Socket]:
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
            more = {"level": told.finer.level, **dict(zip(FINER_COUNTS, counts, strict=False))}
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
        counts = {name: inputs[name] for name in FINER_COUNTS}
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
    for more, name in enumerate(FINER_COUNTS, start=1):
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


def _turn(tree: Tree, before: tuple[Any, Any], now: tuple[Any, Any]) -> Socket:
    """Return the rotation from two axes, the first of which is kept, to two others."""
    frames = [
        tree.call("FunctionNodeAxesToRotation", *axes, primary_axis="Z", secondary_axis="X") for axes in (before, now)
    ]
    back = tree.call("FunctionNodeInvertRotation", frames[0])
    return tree.call("FunctionNodeRotateRotation", back, frames[1], rotation_space="GLOBAL")
