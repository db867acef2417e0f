"""Kernels that take some charges out of all, and bring the forces on them back."""

from __future__ import annotations

import warp as wp

from ..surface.kernels_facets import Facets, smooth_normal, tile_of
from .kernels_on_surface import Charges

wp.set_module_options({"enable_backward": False})


@wp.kernel
def take(
    first: int,
    row: wp.array(dtype=wp.int32),
    charges: Charges,
    home: wp.array(dtype=wp.int32),
    facets: Facets,
    # outputs
    own: Charges,
):
    """Charges of some rows, with homes of their own, by tile, and as the facets' smooth normals look there."""
    k = first + wp.tid()
    j = row[k]
    own.points.position[k] = charges.points.position[j]
    own.points.normal[k] = smooth_normal(charges.facet[j], charges.weight[j], facets)
    own.facet[k] = charges.facet[j]
    own.weight[k] = charges.weight[j]
    own.home[k] = home[tile_of(charges.facet[j], charges.weight[j], facets)]


@wp.kernel
def add_field(
    first: int,
    row: wp.array(dtype=wp.int32),
    own: Charges,
    # outputs
    charges: Charges,
):
    k = first + wp.tid()
    charges.field[row[k]] = charges.field[row[k]] + own.field[k]
