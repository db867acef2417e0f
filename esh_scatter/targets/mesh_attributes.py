"""Attributes of meshes: all values at once, whatever their kind."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

__all__ = ["add_attribute", "can_be_read", "read_attribute", "write_attribute"]

# By the kind of an attribute: the field of its data, and how many numbers of which type it holds for each element.
_FIELDS: dict[str, tuple[str, int, Any]] = {
    "FLOAT": ("value", 1, np.float32),
    "INT": ("value", 1, np.int32),
    "INT8": ("value", 1, np.int32),
    "INT32_2D": ("value", 2, np.int32),
    "BOOLEAN": ("value", 1, bool),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT2": ("vector", 2, np.float32),
    "FLOAT_COLOR": ("color", 4, np.float32),
    "BYTE_COLOR": ("color", 4, np.float32),
    "QUATERNION": ("value", 4, np.float32),
}


def can_be_read(attribute: bpy.types.Attribute | None) -> bool:
    """Tell whether an attribute is there, and of a kind that holds numbers."""
    return attribute is not None and attribute.data_type in _FIELDS


def read_attribute(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    """Return the values of an attribute, shape ``[n]`` or ``[n, k]``."""
    attribute = mesh.attributes[name]
    field, width, dtype = _FIELDS[attribute.data_type]
    values = np.empty(width * len(attribute.data), dtype)
    attribute.data.foreach_get(field, values)
    return values.reshape(-1, width) if width > 1 else values


def write_attribute(mesh: bpy.types.Mesh, name: str, values: np.ndarray) -> None:
    """Set the values of an attribute, shape ``[n]`` or ``[n, k]``."""
    attribute = mesh.attributes[name]
    field, _, dtype = _FIELDS[attribute.data_type]
    attribute.data.foreach_set(field, np.ascontiguousarray(values, dtype).ravel())


def add_attribute(mesh: bpy.types.Mesh, name: str, value: float) -> np.ndarray:
    """Return the values of a number of points, shape ``[n]``; where the mesh has no such attribute, it gets one of this value."""
    if name not in mesh.attributes:
        mesh.attributes.new(name, "FLOAT", "POINT")
        write_attribute(mesh, name, np.full(len(mesh.vertices), value, np.float32))
    return read_attribute(mesh, name)
