"""Kernels that bring bodies on a surface back into meters and into the triangles of its meshes, in double precision."""

from __future__ import annotations

import math

import warp as wp

wp.set_module_options({"enable_backward": False})

ZERO, ONE = wp.constant(wp.float64(0.0)), wp.constant(wp.float64(1.0))
# A surface that looks along x by more than this has its first direction nearest to y.
ALONG_X = wp.constant(wp.float64(0.9))
HALF_TURN, WHOLE_TURN = wp.constant(wp.float64(math.pi)), wp.constant(wp.float64(2.0 * math.pi))


@wp.struct
class Triangles:
    """The triangles of a surface: vertices [m], the numbers of the vertices of each, three of each, and normals."""

    vertex: wp.array(dtype=wp.vec3d)
    corner: wp.array(dtype=wp.int32)
    normal: wp.array(dtype=wp.vec3d)


@wp.func
def frame_axis(normal: wp.vec3d):
    """Direction along the surface that is nearest to x (to y where it looks along x)."""
    wanted = wp.vec3d(ONE, ZERO, ZERO)
    if wp.abs(normal[0]) > ALONG_X:
        wanted = wp.vec3d(ZERO, ONE, ZERO)
    return wp.normalize(wanted - wp.dot(wanted, normal) * normal)


@wp.func
def angle_within(angle: wp.float64, period: wp.float64):
    """An angle [rad] between minus and plus half of a period."""
    half = wp.float64(0.5) * period
    within = wp.mod(angle + half, period)
    if within < ZERO:
        within += period
    return within - half


@wp.kernel
def find_in_triangles(
    first: int,
    facet: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.vec2),
    triangle_of: wp.array(dtype=wp.int32),
    weights_of: wp.array(dtype=wp.vec3d),
    # outputs
    triangle: wp.array(dtype=wp.int32),
    barycentric: wp.array(dtype=wp.vec3d),
):
    """Triangles of bodies on facets, and weights of their corners; of a facet's corners, ``weights_of`` has three such weights."""
    i = first + wp.tid()
    own = facet[i]
    second = wp.float64(weight[i][0])
    third = wp.float64(weight[i][1])
    # Rounding may have left a side.
    of_corner = wp.max(wp.vec3d(ONE - (second + third), second, third), wp.vec3d(ZERO, ZERO, ZERO))
    of_corner = of_corner / (of_corner[0] + of_corner[1] + of_corner[2])
    triangle[i] = triangle_of[own]
    barycentric[i] = (
        of_corner[0] * weights_of[3 * own]
        + of_corner[1] * weights_of[3 * own + 1]
        + of_corner[2] * weights_of[3 * own + 2]
    )


@wp.kernel
def lay_down(
    first: int,
    triangle: wp.array(dtype=wp.int32),
    barycentric: wp.array(dtype=wp.vec3d),
    triangles: Triangles,
    axis: wp.array(dtype=wp.vec3),
    heading: wp.array(dtype=float),
    is_outline: wp.array(dtype=wp.uint8),
    # outputs
    position: wp.array(dtype=wp.vec3d),
    normal: wp.array(dtype=wp.vec3d),
    tangent: wp.array(dtype=wp.vec3d),
    angle: wp.array(dtype=wp.float64),
):
    """Where bodies are [m], how the surface lies there, the x axes of bodies along it, and their angles from its own [rad]."""
    i = first + wp.tid()
    own = triangle[i]
    weight = barycentric[i]
    corner = triangles.corner
    vertex = triangles.vertex
    position[i] = (
        weight[0] * vertex[corner[3 * own]]
        + weight[1] * vertex[corner[3 * own + 1]]
        + weight[2] * vertex[corner[3 * own + 2]]
    )
    up = triangles.normal[own]
    normal[i] = up
    x = frame_axis(up)
    y = wp.cross(up, x)
    along = x
    turn = ZERO
    if wp.length_sq(axis[i]) > 0.0:
        along = wp.normalize(wp.vec3d(axis[i]))
        along = wp.normalize(along - wp.dot(along, up) * up)
        turn = wp.atan2(wp.dot(along, y), wp.dot(along, x))
    if is_outline[i] != wp.uint8(0):
        turn = angle_within(turn + wp.float64(heading[i]), WHOLE_TURN)
        along = wp.cos(turn) * x + wp.sin(turn) * y
    else:
        # A line has no front, unless its outline has one.
        turn = angle_within(turn, HALF_TURN)
    tangent[i] = along
    angle[i] = turn
