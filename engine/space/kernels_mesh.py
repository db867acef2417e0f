"""What kernels know of a mesh of nodes over the domain."""

from __future__ import annotations

import warp as wp

from .kernels_space import Space, number_inside

wp.set_module_options({"enable_backward": False})


@wp.struct
class Mesh:
    """Mesh of one potential per group: ``count`` nodes, their inverse spacing, the index of the node at the ``origin``."""

    count_x: wp.int32
    count_y: wp.int32
    inverse_spacing: wp.vec2
    margin: wp.int32
    origin: wp.vec2
    space: Space


@wp.func
def nearest_node(position: wp.vec2, mesh: Mesh):
    """Index of the mesh node nearest to ``position``, which lies inside the domain."""
    column = int((position[0] - mesh.origin[0]) * mesh.inverse_spacing[0] + 0.5) + mesh.margin
    row = int((position[1] - mesh.origin[1]) * mesh.inverse_spacing[1] + 0.5) + mesh.margin
    # Of a position that is no number, too, there is a node.
    return number_inside(row, mesh.count_y, mesh.space) * mesh.count_x + number_inside(column, mesh.count_x, mesh.space)
