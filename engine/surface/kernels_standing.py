"""Kernels that find where one part of a surface stands on another: at edges that lie in faces."""

from __future__ import annotations

import warp as wp

from .kernels_continuations import EdgeSides, goes_on
from .kernels_near_surface import nearest_in_triangle

wp.set_module_options({"enable_backward": False})

# An edge lies in a face whose normal it is at right angles to, to within 0.8 degrees, and the face beside it rises by 30 or more.
IN_FACE_COSINE = wp.constant(0.014)
LEAST_RISE = wp.constant(0.5)
# So many parts are found at a place, on which another one stands there.
MOST_AT_PLACE = 4


@wp.func
def from_triangle(mesh: wp.uint64, other: int, p: wp.vec3):
    """Distance of a point from a triangle."""
    a = wp.mesh_get_point(mesh, 3 * other)
    b = wp.mesh_get_point(mesh, 3 * other + 1)
    return wp.length(nearest_in_triangle(p, a, b, wp.mesh_get_point(mesh, 3 * other + 2)) - p)


@wp.kernel(enable_backward=False)
def find_grounds(
    first: int,
    mesh: wp.uint64,
    normal: wp.array(dtype=wp.vec3),
    part: wp.array(dtype=wp.int32),
    sides: EdgeSides,
    side: wp.array(dtype=wp.int32),
    point: wp.array(dtype=wp.vec3),
    # outputs
    found: wp.array2d(dtype=wp.int32),
):
    """Find the parts that the face beside an edge stands on, at points of edges; -1 where there are no more.

    The face rises from them for at least a unit, and they go on in front of it for as much.
    """
    i = first + wp.tid()
    own, p = side[i], point[i]
    triangle, along, inward, near = sides.triangle[own], sides.along[own], sides.inward[own], sides.near[own]
    looks = normal[triangle]
    count = int(0)
    for k in range(wp.static(MOST_AT_PLACE)):
        found[i, k] = -1
    # Whether its own part is high enough: 1 or 0; -1 before that was asked.
    high = int(-1)
    reach = wp.vec3(near, near, near)
    query = wp.mesh_query_aabb(mesh, p - reach, p + reach)
    other = int(0)
    while wp.mesh_query_aabb_next(query, other):
        ground, up = part[other], normal[other]
        flat = wp.abs(wp.dot(up, along)) < IN_FACE_COSINE and wp.dot(up, inward) > LEAST_RISE
        if ground == part[triangle] or not flat or count == wp.static(MOST_AT_PLACE):
            continue
        known = int(0)
        for k in range(count):
            known += int(found[i, k] == ground)
        if known > 0 or from_triangle(mesh, other, p) > near:
            continue
        if high < 0:
            high = wp.where(goes_on(mesh, part, part[triangle], p, inward), 1, 0)
        in_front = wp.normalize(looks - up * wp.dot(up, looks))
        if high == 1 and goes_on(mesh, part, ground, p, in_front):
            found[i, count] = ground
            count += 1


@wp.kernel(enable_backward=False)
def find_near_places(
    first: int,
    mesh: wp.uint64,
    place: wp.array(dtype=wp.vec3),
    near: float,
    # outputs
    is_near: wp.array(dtype=wp.int32),
):
    """Note triangles of a mesh that come near to places."""
    p = place[first + wp.tid()]
    reach = wp.vec3(near, near, near)
    query = wp.mesh_query_aabb(mesh, p - reach, p + reach)
    other = int(0)
    while wp.mesh_query_aabb_next(query, other):
        if is_near[other] == 0 and from_triangle(mesh, other, p) <= near:
            is_near[other] = 1
