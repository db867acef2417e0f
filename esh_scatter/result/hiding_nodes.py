"""Nodes that hide points of a result: by hand, by a share, by what the camera sees, by class."""

from __future__ import annotations

from collections.abc import Sequence

from ..classes.node_tree import Socket, Tree
from .attributes import HIDE_RENDER, HIDE_VIEWPORT
from .node_group_contents import show_input

__all__ = ["hidden_points"]


def hidden_points(tree: Tree, in_viewport: Socket, limited: Socket, back: Socket, classes: Sequence[str]) -> Socket:
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
