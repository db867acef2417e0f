"""Kernels that look at a mesh from above. Positions are relative to the middle of the mesh, where float32 is finest."""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel(enable_backward=False)
def cast_down(
    first: int,
    mesh: wp.uint64,
    ray_origin: wp.array(dtype=wp.vec3),
    reach: float,
    # outputs
    hit_face: wp.array(dtype=wp.int32),
):
    """Find the first triangle below every origin, or -1."""
    i = first + wp.tid()
    hit = wp.mesh_query_ray(mesh, ray_origin[i], wp.vec3(0.0, 0.0, -1.0), reach)
    hit_face[i] = wp.where(hit.result, hit.face, -1)


@wp.kernel(enable_backward=False)
def find_nearest(
    first: int,
    mesh: wp.uint64,
    point: wp.array(dtype=wp.vec3),
    reach: float,
    # outputs
    near_face: wp.array(dtype=wp.int32),
    near_weight: wp.array(dtype=wp.vec3),
):
    """Find the nearest point of the mesh: its triangle, or -1, and the weights of the triangle's corners."""
    i = first + wp.tid()
    hit = wp.mesh_query_point_no_sign(mesh, point[i], reach)
    near_face[i] = wp.where(hit.result, hit.face, -1)
    near_weight[i] = wp.vec3(hit.u, hit.v, 1.0 - hit.u - hit.v)
