"""Geometry node trees written as arithmetic: every function adds a node and returns its output."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import bpy

from ...engine.version import __version__

__all__ = ["PART", "Tree", "parts_of", "remove_group", "remove_unused"]

Socket: TypeAlias = bpy.types.NodeSocket

# Custom property of a part: what it is, and of which version.
PART = "esh_part"
# What sockets that lead into a part and out of it are, by the types of sockets.
_SOCKETS = {
    "VALUE": "NodeSocketFloat",
    "INT": "NodeSocketInt",
    "BOOLEAN": "NodeSocketBool",
    "VECTOR": "NodeSocketVector",
    "ROTATION": "NodeSocketRotation",
    "MATRIX": "NodeSocketMatrix",
    "GEOMETRY": "NodeSocketGeometry",
    "OBJECT": "NodeSocketObject",
}
# And those that take a value of Python; truth values are whole numbers there, too.
_VALUES = ((bool, "NodeSocketBool"), (int, "NodeSocketInt"), (float, "NodeSocketFloat"), (tuple, "NodeSocketVector"))


class Tree:
    """A geometry node group that is being built; nodes stand in columns, in the order in which they are added.

    Args:
        name: Of a new group.
        group: One that is built anew instead, from nothing.
        same_inputs: Whether that one keeps its inputs and outputs: the values that modifiers have for them go by these.

    Attributes:
        group: The node group.
        inputs: Its inputs by name, to be linked.
    """

    def __init__(self, name: str, group: bpy.types.NodeTree | None = None, same_inputs: bool = False) -> None:
        if group is not None:
            group.nodes.clear()
            if not same_inputs:
                group.interface.clear()
        self.group = group or bpy.data.node_groups.new(name, "GeometryNodeTree")
        self.inputs: dict[str, Socket] = {}
        self._rows: dict[int, int] = {}
        self._column = 0

    def column(self, number: int) -> None:
        """Put the nodes that follow into a column."""
        self._column = number

    def add(self, kind: str, **values: Any) -> bpy.types.Node:
        """Add a node and set its properties."""
        node = self.group.nodes.new(kind)
        row = self._rows.get(self._column, 0)
        self._rows[self._column] = row + 1
        node.location = (240.0 * self._column, -240.0 * row)
        for name, value in values.items():
            setattr(node, name, value)
        return node

    def link(self, value: Any, socket: Socket) -> None:
        """Link an output to an input, or give the input a value."""
        if isinstance(value, bpy.types.NodeSocket):
            self.group.links.new(value, socket)
        else:
            socket.default_value = value

    def take(self, name: str, kind: str, default: Any = None, **more: Any) -> None:
        """Add an input to the group; all of them before :meth:`begin`."""
        told = self.group.interface.new_socket(
            name, in_out="INPUT", socket_type=kind, parent=more.pop("parent", None), description=more.pop("help", "")
        )
        for key, value in more.items():
            setattr(told, key, value)
        if default is not None:
            told.default_value = default

    def begin(self) -> None:
        """Make the inputs known to the nodes."""
        node = self.add("NodeGroupInput")
        # The node cuts long names; the group has them whole.
        names = {one.identifier: one.name for one in self.group.interface.items_tree if one.item_type == "SOCKET"}
        self.inputs = {names[one.identifier]: one for one in node.outputs if one.identifier in names}

    def part(
        self, name: str, build: Callable[[Tree], Sequence[Socket]], *, own: bool = False, **values: Any
    ) -> list[Socket]:
        """Add a part: a node group of its own, which all trees share that have it.

        With every node and link Blender looks at all nodes of a tree anew, so that large trees take the square of their size to make.

        Args:
            name: What it is; parts of the same name are the same.
            build: Makes it, with these inputs, and returns what comes out of it.
            own: Whether it is this tree's alone.
            values: What is linked to its inputs, by their names.
        """
        known = None if own else _part_of(name)
        node = self.add("GeometryNodeGroup", node_tree=known or _build_part(name, build, values))
        for key, value in values.items():
            self.link(value, node.inputs[key])
        return list(node.outputs)

    def attribute(self, name: str, kind: str) -> Socket:
        """Read an attribute of the points."""
        node = self.add("GeometryNodeInputNamedAttribute", data_type=kind)
        node.inputs["Name"].default_value = name
        return _shown(node.outputs, "Attribute")

    def switch(self, kind: str, condition: Any, false: Any, true: Any) -> Socket:
        """Choose one of two values."""
        node = self.add("GeometryNodeSwitch", input_type=kind)
        for value, name in ((condition, "Switch"), (false, "False"), (true, "True")):
            if value is not None:
                self.link(value, _shown(node.inputs, name))
        return _shown(node.outputs, "Output")

    def both(self, *values: Any) -> Socket:
        """Tell whether all of some truth values are true."""
        return self._combined("AND", values)

    def either(self, *values: Any) -> Socket:
        """Tell whether any of some truth values is true."""
        return self._combined("OR", values)

    def no(self, value: Any) -> Socket:
        """Turn a truth value round."""
        return self._combined("NOT", (value,))

    def _combined(self, operation: str, values: tuple[Any, ...]) -> Socket:
        result = values[0]
        for value in values[1:] or ((None,) if operation == "NOT" else ()):
            node = self.add("FunctionNodeBooleanMath", operation=operation)
            self.link(result, node.inputs[0])
            if value is not None:
                self.link(value, node.inputs[1])
            result = node.outputs[0]
        return result

    def compare(self, operation: str, first: Any, second: Any, kind: str = "FLOAT") -> Socket:
        """Compare two numbers."""
        node = self.add("FunctionNodeCompare", data_type=kind, operation=operation)
        one, two = [socket for socket in node.inputs if socket.enabled][:2]
        self.link(first, one)
        self.link(second, two)
        return node.outputs[0]

    def math(self, operation: str, *values: Any) -> Socket:
        """Reckon with numbers."""
        return self._math("ShaderNodeMath", operation, values)

    def vector(self, operation: str, *values: Any) -> Socket:
        """Reckon with vectors."""
        return self._math("ShaderNodeVectorMath", operation, values)

    def scaled(self, vector: Any, factor: Any) -> Socket:
        """Multiply a vector with a number."""
        node = self.add("ShaderNodeVectorMath", operation="SCALE")
        self.link(vector, node.inputs[0])
        self.link(factor, node.inputs["Scale"])
        return node.outputs["Vector"]

    def _math(self, kind: str, operation: str, values: tuple[Any, ...]) -> Socket:
        node = self.add(kind, operation=operation)
        for value, socket in zip(values, node.inputs, strict=False):
            self.link(value, socket)
        return next(socket for socket in node.outputs if socket.enabled)

    def parts(self, vector: Any) -> list[Socket]:
        """Take a vector apart."""
        node = self.add("ShaderNodeSeparateXYZ")
        self.link(vector, node.inputs[0])
        return list(node.outputs)

    def transformed(self, geometry: Any, matrix: Any) -> Socket:
        """Transform a geometry, with the instances in it, by a matrix."""
        node = self.add("GeometryNodeTransform")
        if hasattr(node, "mode"):
            node.mode = "MATRIX"
        else:  # from Blender 5.0 on
            node.inputs["Mode"].default_value = "Matrix"
        self.link(geometry, node.inputs["Geometry"])
        self.link(matrix, node.inputs["Transform"])
        return node.outputs[0]

    def call(self, kind: str, *values: Any, output: int | str = 0, **settings: Any) -> Socket:
        """Add a node with these values for its inputs, in their order; None leaves an input as it is."""
        node = self.add(kind, **settings)
        inputs = [socket for socket in node.inputs if socket.enabled]
        for value, socket in zip(values, inputs, strict=False):
            if value is not None:
                self.link(value, socket)
        return node.outputs[output] if isinstance(output, int) else _shown(node.outputs, output)


def parts_of(group: bpy.types.NodeTree) -> list[bpy.types.NodeTree]:
    """Return the parts that a group has, each once."""
    inner = [node.node_tree for node in group.nodes if node.bl_idname == "GeometryNodeGroup"]
    return [part for part in dict.fromkeys(inner) if part is not None and part.get(PART)]


def remove_group(group: bpy.types.NodeTree) -> None:
    """Remove a group from the file, with those of its parts that nothing else uses."""
    parts = parts_of(group)
    bpy.data.node_groups.remove(group)
    remove_unused(parts)


def remove_unused(parts: Sequence[bpy.types.NodeTree]) -> None:
    """Remove parts that nothing uses any more."""
    for part in parts:
        if not part.users:
            remove_group(part)


def _part_of(name: str) -> bpy.types.NodeTree | None:
    """Return the part of a name that this version has made in this file, or None."""
    key = f"{name} {__version__}"
    return next((group for group in bpy.data.node_groups if group.get(PART) == key and group.is_editable), None)


def _build_part(name: str, build: Callable[[Tree], Sequence[Socket]], values: dict[str, Any]) -> bpy.types.NodeTree:
    # Menus pass over what begins with a period.
    tree = Tree(f".ESH Scatter {name}")
    tree.group[PART] = f"{name} {__version__}"
    for key, value in values.items():
        tree.take(key, _socket_for(value))
    tree.begin()
    found = build(tree)
    end = [
        tree.group.interface.new_socket(f"Output {number}", in_out="OUTPUT", socket_type=_SOCKETS[socket.type])
        for number, socket in enumerate(found)
    ]
    node = tree.add("NodeGroupOutput")
    for socket, told in zip(found, end, strict=True):
        tree.link(socket, node.inputs[told.name])
    return tree.group


def _socket_for(value: Any) -> str:
    """Return what an input is that takes a value."""
    if isinstance(value, bpy.types.NodeSocket):
        return _SOCKETS[value.type]
    if isinstance(value, bpy.types.Collection):
        return "NodeSocketCollection"
    return next((socket for kind, socket in _VALUES if isinstance(value, kind)), "NodeSocketObject")


def _shown(sockets: Any, name: str) -> Socket:
    """Return the socket of this name that is there for the chosen type."""
    return next(socket for socket in sockets if socket.enabled and socket.name == name)
