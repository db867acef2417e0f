"""Kernels that find where one part of a surface continues on another: at edges that lie on edges."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

# Edges are one where they run along each other to within 0.8 degrees: those of parts that run into each other cross.
ALONG_COSINE = wp.constant(0.9999)
# The faces beside them look to about the same side, and lie on opposite ones of the edge: within 60 degrees.
SMOOTH_COSINE = wp.constant(0.5)


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
def edge_beside(
    mesh: wp.uint64, edges: int, other: int, p: wp.vec3, along: wp.vec3, inward: wp.vec3, near: float
) -> bool:
    """Whether one of a triangle's ``edges`` (bit k: opposite of corner k) lies at a point of another edge, and it beyond that."""
    for corner in range(3):
        if (edges >> corner & 1) == 1:
            start = wp.mesh_get_point(mesh, 3 * other + (corner + 1) % 3)
            end = wp.mesh_get_point(mesh, 3 * other + (corner + 2) % 3)
            apex = wp.mesh_get_point(mesh, 3 * other + corner)
            runs_along = wp.abs(wp.dot(wp.normalize(end - start), along)) > ALONG_COSINE
            opposite = wp.dot(inward_of(start, end, apex), inward) < -SMOOTH_COSINE
            if runs_along and opposite and from_segment(p, start, end) <= near:
                return True
    return False


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
    reach = wp.vec3(near, near, near)
    query = wp.mesh_query_aabb(mesh, p - reach, p + reach)
    other = int(0)
    while wp.mesh_query_aabb_next(query, other):
        # Of several the first, in whatever order they come.
        if part[other] == part[triangle] or (found[i] >= 0 and found[i] < other):
            continue
        if wp.dot(normal[other], normal[triangle]) > SMOOTH_COSINE:
            if edge_beside(mesh, edge_sides[other], other, p, along, inward, near):
                found[i] = other
