"""The attributes of a result's points: what they are called, and what is read of them in several places."""

from __future__ import annotations

import bpy
import numpy as np

# What targets know of results, too, is named there.
from ..targets.mesh_attributes import read_attribute
from ..targets.target import CORNERS, INSTANCE_INDEX, ROTATION, SCALE, TARGET, WEIGHTS

__all__ = [
    "ALIGN",
    "BODY_ANGLE",
    "BODY_LENGTH",
    "CORNERS",
    "EDGE",
    "FACE_NORMAL",
    "FINER_CORNERS",
    "FIT",
    "GROUND_POINT",
    "HEADING",
    "HEIGHT",
    "HIDE_RENDER",
    "HIDE_VIEWPORT",
    "INSTANCE_INDEX",
    "LAID",
    "LONG",
    "LOOKS",
    "MIDDLE",
    "NORMAL",
    "OVERLAPPING",
    "OVERLAPPING_ON_GROUND",
    "PINNED",
    "PLACED_AT",
    "ROTATION",
    "SCALE",
    "TARGET",
    "TO_ORIGIN",
    "WEIGHTS",
    "any_twice",
    "numbers_of",
    "read_flags",
]

# Whether the object there is hidden.
HIDE_VIEWPORT, HIDE_RENDER = "hide_viewport", "hide_render"
# What ties a point to a target, beside its triangle: where the point of the ground was, and the triangle's first edge and normal, all
# in the world; and how far the object follows the slope.
GROUND_POINT, EDGE, FACE_NORMAL, ALIGN = "ground_point", "ground_edge", "ground_face", "align"
# What leads to the numbers in ``CORNERS`` where a target that is subdivided is so further, as in renders; results on others have no
# such attributes. With its edges cut into 1 + t times as many parts a number is vertex + t * (step + t * square).
FINER_CORNERS = (
    ("esh_finer_step_0", "esh_finer_step_1", "esh_finer_step_2"),
    ("esh_finer_square_0", "esh_finer_square_1", "esh_finer_square_2"),
)
# The part of the way from that point of the ground to an object's origin that goes along the object's own axis: it leans as the object
# does, and the rest as the ground does. What has none has no such attribute.
HEIGHT = "own_height"
# The way from point to origin [m], under the name that saved files know.
TO_ORIGIN = "lift"
# How the placement has a body lie, and how long its axis is, where that is known: from here a run can go on.
BODY_ANGLE, BODY_LENGTH = "body_angle", "body_length"
# Who stays in the next run; and where the last run has put every point [m]: one that is elsewhere was moved by hand.
PINNED, PLACED_AT = "pinned", "placed_at"
# Whether the object there overlaps another or leans into it; absent where no two do.
OVERLAPPING = "overlapping"
# Whether it overlaps another on the ground; absent where none does, or none leans.
OVERLAPPING_ON_GROUND = "overlapping_on_ground"
# What is known of the ground that an object stands on, and of the object: see :class:`.classes.standing.Ground`.
NORMAL, HEADING, LONG, MIDDLE, LAID, LOOKS, FIT = "ground_normal", "heading", "long", "middle", "laid", "looks", "fit"


def read_flags(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    """Return which points are selected (``select``) or hidden (``hide``), shape ``[n]``, outside Edit Mode."""
    flags = np.zeros(len(mesh.vertices), bool)
    mesh.vertices.foreach_get(name, flags)
    return flags


def numbers_of(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the numbers of a result's points, shape ``[n]``: of copies made by hand, which say the same, numbers of their own."""
    number = read_attribute(mesh, "id")
    if not any_twice(number):
        return number
    _, first, which = np.unique(number, return_index=True, return_inverse=True)
    copies = np.flatnonzero(first[which] != np.arange(len(number)))
    number[copies] = np.setdiff1d(np.arange(len(number)), number)[: len(copies)]
    return number


def any_twice(number: np.ndarray) -> bool:
    """Tell whether any of some whole numbers, shape ``[n]``, is there twice; at once where they are small, as those of points are."""
    if len(number) and number.min() >= 0 and number.max() < 4 * len(number):
        return bool(np.bincount(number).max() > 1)
    return len(np.unique(number)) < len(number)
