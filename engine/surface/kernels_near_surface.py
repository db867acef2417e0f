"""Kernels that find what of a surface is near places in space, and which of its points something covers."""

from __future__ import annotations

import warp as wp

from ..problem import one_sheet

wp.set_module_options({"enable_backward": False})

LEAST_COSINE = wp.constant(one_sheet.LEAST_COSINE)


@wp.func
def nearest_in_triangle(p: wp.vec3, a: wp.vec3, b: wp.vec3, c: wp.vec3):
    """The point of a triangle that is nearest to another one."""
    ab = b - a
    ac = c - a
    ap = p - a
    d1 = wp.dot(ab, ap)
    d2 = wp.dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return a
    bp = p - b
    d3 = wp.dot(ab, bp)
    d4 = wp.dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return b
    cp = p - c
    d5 = wp.dot(ab, cp)
    d6 = wp.dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return c
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return a + (d1 / (d1 - d3)) * ab
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return a + (d2 / (d2 - d6)) * ac
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        return b + ((d4 - d3) / ((d4 - d3) + (d5 - d6))) * (c - b)
    total = 1.0 / (va + vb + vc)
    return a + (vb * total) * ab + (vc * total) * ac


@wp.kernel
def find_nearest(
    first: int,
    mesh: wp.uint64,
    position: wp.array(dtype=wp.vec3),
    looks: wp.array(dtype=wp.vec3),
    within: wp.array(dtype=float),
    # outputs
    face: wp.array(dtype=wp.int32),
    nearest: wp.array(dtype=wp.vec3),
):
    """The point of a mesh that is nearest to every place, of faces that look along ``looks`` where that is not 0; -1: none is near."""
    i = first + wp.tid()
    p = position[i]
    along = looks[i]
    face[i] = -1
    hit = wp.mesh_query_point_no_sign(mesh, p, within[i])
    if not hit.result:
        return
    asked = wp.length_sq(along) > 0.0
    if not asked or wp.dot(wp.mesh_eval_face_normal(mesh, hit.face), along) > 0.0:
        face[i] = hit.face
        nearest[i] = wp.mesh_eval_position(mesh, hit.face, hit.u, hit.v)
        return
    # It is on the other side of a wall.
    reach = wp.vec3(within[i], within[i], within[i])
    least = within[i]
    query = wp.mesh_query_aabb(mesh, p - reach, p + reach)
    other = int(0)
    while wp.mesh_query_aabb_next(query, other):
        if wp.dot(wp.mesh_eval_face_normal(mesh, other), along) > 0.0:
            there = nearest_in_triangle(
                p,
                wp.mesh_get_point(mesh, 3 * other),
                wp.mesh_get_point(mesh, 3 * other + 1),
                wp.mesh_get_point(mesh, 3 * other + 2),
            )
            away = wp.length(there - p)
            # Of equal ones the first, in whatever order they come.
            if away < least or (away == least and (face[i] < 0 or other < face[i])):
                least = away
                face[i] = other
                nearest[i] = there


@wp.kernel
def find_inside(
    first: int,
    mesh: wp.uint64,
    position: wp.array(dtype=wp.vec3),
    # outputs
    inside: wp.array(dtype=wp.uint8),
):
    """Whether every place lies inside a closed mesh."""
    i = first + wp.tid()
    hit = wp.mesh_query_point_sign_winding_number(mesh, position[i], 1.0e30)
    inside[i] = wp.uint8(0)
    if hit.result and hit.sign < 0.0:
        inside[i] = wp.uint8(1)


@wp.kernel
def find_covered(
    first: int,
    grid: wp.uint64,
    disc: wp.array(dtype=wp.vec3),
    disc_normal: wp.array(dtype=wp.vec3),
    radius: float,
    position: wp.array(dtype=wp.vec3),
    normal: wp.array(dtype=wp.vec3),
    # outputs
    covered: wp.array(dtype=wp.uint8),
):
    """Whether a disc of this radius that lies on the same side of the surface holds every place."""
    i = first + wp.tid()
    if covered[i] != wp.uint8(0):
        return
    query = wp.hash_grid_query(grid, position[i], radius)
    j = int(0)
    while wp.hash_grid_query_next(query, j):
        if wp.length(disc[j] - position[i]) <= radius and wp.dot(disc_normal[j], normal[i]) >= LEAST_COSINE:
            covered[i] = wp.uint8(1)
            return
