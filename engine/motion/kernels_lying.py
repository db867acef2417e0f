"""What kernels know of all that lies along a surface: how it is found again, and how one of it sees another."""

from __future__ import annotations

import warp as wp

from ..cascade.kernels_points import slot_of
from ..problem import one_sheet
from ..surface.kernels_facets import carried, tangential

wp.set_module_options({"enable_backward": False})

STEEPER, LEAST_COSINE = wp.constant(one_sheet.STEEPER), wp.constant(one_sheet.LEAST_COSINE)
CREASED_COSINE, SHARPEST_COSINE = wp.constant(one_sheet.CREASED_COSINE), wp.constant(one_sheet.SHARPEST_COSINE)


@wp.struct
class Slots:
    """Bodies in the order of the slots of their cells: their numbers, where each slot begins, and where they were when sorted."""

    order: wp.array(dtype=wp.int32)
    start: wp.array(dtype=wp.int32)
    sorted_at: wp.array(dtype=wp.vec3)
    mask: wp.int32


@wp.func
def slot_of_level(cell: wp.vec3i, level: int, mask: int):
    return slot_of(wp.vec3i(cell[0] + 7919 * level, cell[1], cell[2]), mask)


@wp.func
def cell_of_block(number: int, counts: wp.vec3i):
    """Where in a block of so many cells along x, y and z one of them lies, counted along z first."""
    return wp.vec3i(number / (counts[1] * counts[2]), number / counts[2] % counts[1], number % counts[2])


@wp.func
def in_plane(vector: wp.vec3, along: wp.vec3, beside: wp.vec3):
    return wp.vec2(wp.dot(vector, along), wp.dot(vector, beside))


@wp.func
def on_one_sheet(way: wp.vec3, distance: float, normal: wp.vec3, other: wp.vec3):
    """Whether what lies at a way from here lies on the sheet of the surface that is here; normals here and there."""
    cosine = wp.dot(normal, other)
    if cosine < LEAST_COSINE:
        return False
    if distance == 0.0:
        return True
    leaves = wp.asin(wp.min(wp.abs(wp.dot(way, normal)) / distance, 1.0))
    leaves += wp.asin(wp.min(wp.abs(wp.dot(way, other)) / distance, 1.0))
    return leaves <= wp.acos(wp.min(cosine, 1.0)) + STEEPER


@wp.func
def flat_way(way: wp.vec3, distance: float, normal: wp.vec3, other: wp.vec3):
    """The way to somewhere else in the plane here: laid into the plane between the two, as far off as they are, and turned here."""
    between = wp.normalize(normal + other)
    flat = tangential(way, between)
    flat = flat * (distance / wp.max(wp.length(flat), 1.0e-12))
    return carried(flat, between, normal)


@wp.func
def over_crease(way: wp.vec3, normal: wp.vec3, other: wp.vec3):
    """The way to somewhere beyond a sharp crease, in the plane here, as it is once both planes lie in one; 0 where none is between.

    The two planes meet in a line. Here is so far before it, and there so far behind it, as the way rises out of the other plane, over
    the sine of their angle.
    """
    axis = wp.cross(normal, other)
    sine = wp.length(axis)
    axis = axis / sine
    before = wp.dot(way, other) / sine
    behind = -wp.dot(way, normal) / sine
    if before * behind <= 0.0:
        return wp.vec3(0.0)
    return wp.cross(axis, normal) * (before + behind) + axis * wp.dot(way, axis)
