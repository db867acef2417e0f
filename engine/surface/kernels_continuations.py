"""Kernels that find where one part of a surface continues on another: at edges that lie on edges."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

# Edges are one where they run along each other to within 0.8 degrees: those of parts that run into each other cross.
ALONG_COSINE = wp.constant(0.9999)
# The faces beside them look to about the same side, and lie on opposite ones of the edge: within 60 degrees.
SMOOTH_COSINE = wp.constant(0.5)
# These faces go on for so far from the edge at least, to within the second, in units: by the narrow side of a thin plate the bodies on
# it would see those on the floor below.
LEAST_WIDTH = wp.constant(1.0)
AS_WIDE = wp.constant(0.25)


@wp.struct
class EdgeSides:
    """Sides of triangles at which a crease or the surface's end lies.

    Triangle of each, the corner opposite of it, a direction along it and one from it into its triangle, of length 1; and how
    far other edges lie from it at most that are one with it.
    """

    triangle: wp.array(dtype=wp.int32)
    along: wp.array(dtype=wp.vec3)
    inward: wp.array(dtype=wp.vec3)
    near: wp.array(dtype=float)


@wp.func
def inward_of(start: wp.vec3, end: wp.vec3, apex: wp.vec3) -> wp.vec3:
    """Direction from a side into its triangle, at right angles to the side."""
    along = wp.normalize(end - start)
    way = apex - start
    return wp.normalize(way - along * wp.dot(along, way))


@wp.func
def from_segment(point: wp.vec3, start: wp.vec3, end: wp.vec3) -> float:
    """Distance of a point from a segment."""
    way = end - start
    along = wp.clamp(wp.dot(point - start, way) / wp.max(wp.dot(way, way), 1.0e-30), 0.0, 1.0)
    return wp.length(point - start - along * way)


@wp.func
def goes_on(mesh: wp.uint64, part: wp.array(dtype=wp.int32), own: int, p: wp.vec3, inward: wp.vec3) -> bool:
    """Whether a part, ``own``, is still there a unit from a point of its edge."""
    hit = wp.mesh_query_point_no_sign(mesh, p + LEAST_WIDTH * inward, AS_WIDE)
    if not hit.result:
        return False
    return part[hit.face] == own


@wp.func
def way_beyond(
    mesh: wp.uint64, edges: int, other: int, p: wp.vec3, along: wp.vec3, inward: wp.vec3, near: float
) -> wp.vec3:
    """The way into a triangle from one of its ``edges`` that lies at a point of another edge and leads beyond that; 0 for none.

    Bit k of ``edges`` is the side opposite of corner k.
    """
    result = wp.vec3(0.0, 0.0, 0.0)
    for corner in range(3):
        if (edges >> corner & 1) == 1:
            start = wp.mesh_get_point(mesh, 3 * other + (corner + 1) % 3)
            end = wp.mesh_get_point(mesh, 3 * other + (corner + 2) % 3)
            way = inward_of(start, end, wp.mesh_get_point(mesh, 3 * other + corner))
            runs_along = wp.abs(wp.dot(wp.normalize(end - start), along)) > ALONG_COSINE
            if runs_along and wp.dot(way, inward) < -SMOOTH_COSINE and from_segment(p, start, end) <= near:
                result = way
    return result


@wp.kernel(enable_backward=False)
def find_continuations(
    first: int,
    mesh: wp.uint64,
    normal: wp.array(dtype=wp.vec3),
    part: wp.array(dtype=wp.int32),
    edge_sides: wp.array(dtype=wp.int32),
    sides: EdgeSides,
    side: wp.array(dtype=wp.int32),
    point: wp.array(dtype=wp.vec3),
    # outputs
    found: wp.array(dtype=wp.int32),
):
    """Find a triangle of another part that the surface continues on across an edge, at points of edges; -1 where there is none."""
    i = first + wp.tid()
    own, p = side[i], point[i]
    triangle, along, inward, near = sides.triangle[own], sides.along[own], sides.inward[own], sides.near[own]
    found[i] = -1
    # Whether its own part is wide enough: 1 or 0; -1 before that was asked.
    wide = int(-1)
    reach = wp.vec3(near, near, near)
    query = wp.mesh_query_aabb(mesh, p - reach, p + reach)
    other = int(0)
    while wp.mesh_query_aabb_next(query, other):
        # Of several the first, in whatever order they come.
        if part[other] == part[triangle] or (found[i] >= 0 and found[i] < other):
            continue
        if wp.dot(normal[other], normal[triangle]) > SMOOTH_COSINE:
            way = way_beyond(mesh, edge_sides[other], other, p, along, inward, near)
            if wp.length_sq(way) > 0.0 and goes_on(mesh, part, part[other], p, way):
                if wide < 0:
                    wide = wp.where(goes_on(mesh, part, part[triangle], p, inward), 1, 0)
                if wide == 1:
                    found[i] = other
