"""Nodes beyond the edges of a surface, in the planes of the facets that end there, so that charges near an edge have nodes all around.

A potential that is fitted to nodes on one side only is wrong near an edge. Measured on a box with walls of 0.3 spacings: without
these points bodies near the rim stand 0.02 spacings too far inside, and coverage errors at 1 and 2 spacings are 0.0074 and 0.0021;
with them they are 0.0036 and 0.0008.
"""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..surface import kernels_facets
from ..surface.facets import Facets
from .kernels_points import Points
from .points import chosen, empty_points, joined, lists_of, nearest_of, thinned

__all__ = ["with_nodes_beyond_edges"]

# Candidates are this far apart, over the distance of nodes.
STEP = 0.5
# An edge gets nodes beyond it only if the surface is about plane inside of it: at a distance of INSIDE lengths from the edge, the
# surface must come as near to the plane as NEAR lengths, with a cosine between the normals of more than SAME_SIDE.
INSIDE = 1.0
NEAR = 0.15
SAME_SIDE = 0.9
# Nodes are on one sheet if the cosine between their normals is more than this.
OF_SHEET = 0.3


def with_nodes_beyond_edges(
    launcher: Launcher,
    facets: Facets,
    on_device: kernels_facets.Facets,
    nodes: Points,
    *,
    apart: float,
    reach: float,
    length: float,
) -> tuple[Points, wp.array]:
    """Add nodes beyond the edges of a surface.

    Args:
        launcher: Where to run.
        facets: The surface.
        on_device: The same facets, as kernels take them.
        nodes: Nodes on the surface, part after part.
        apart: Least distance of two nodes, in units.
        reach: Distance from an edge up to which nodes are added, in units.
        length: Spacing that is to be resolved, in units.

    Returns:
        All nodes, and the number that every given one has among them, ``wp.int32``.
    """
    count = len(nodes.position)
    found = _candidates(launcher, facets, on_device, STEP * apart, reach, length)
    start = lists_of(launcher, found, nodes, apart, OF_SHEET).start.numpy()
    free = np.flatnonzero(np.diff(start) == 0)
    if not len(free):
        return nodes, launcher.array(np.arange(count, dtype=np.int32), wp.int32)
    found = chosen(launcher, found, launcher.array(free.astype(np.int32), wp.int32))
    beyond = chosen(launcher, found, thinned(launcher, found, apart))
    # Each comes behind the node that it is nearest to. So nodes of a part stay together, and so do neighbors.
    nearest = nearest_of(launcher, beyond, nodes, reach + 2.0 * length, length).numpy()
    there = np.flatnonzero(nearest >= 0).astype(np.int32)
    order = np.argsort(np.concatenate([np.arange(count), nearest[there]]), kind="stable").astype(np.int32)
    place = np.empty(len(order), np.int32)
    place[order] = np.arange(len(order))
    together = joined(launcher, nodes, chosen(launcher, beyond, launcher.array(there, wp.int32)))
    return chosen(launcher, together, launcher.array(order, wp.int32)), launcher.array(place[:count], wp.int32)


def _candidates(
    launcher: Launcher, facets: Facets, on_device: kernels_facets.Facets, step: float, reach: float, length: float
) -> Points:
    """Return points at even steps along all edges and away from them, beyond those inside of which the surface is about plane."""
    facet, corner = np.nonzero(facets.edge_side)
    start, end, apex = (facets.corner[facet, (corner + k) % 3] for k in (1, 2, 0))
    normal = facets.normal[facet]
    long = np.linalg.norm(end - start, axis=1)
    along = (end - start) / np.maximum(long, 1e-30)[:, None]
    out = np.cross(along, normal)
    out *= np.sign(((start - apex) * out).sum(axis=1))[:, None]
    # Sides may be far shorter than a step, so steps are counted along all sides together.
    gone = np.cumsum(long)
    count = int(gone[-1] / step) if len(gone) else 0
    place = (np.arange(count) + 0.5) * step
    side = np.minimum(np.searchsorted(gone, place), len(gone) - 1)
    point = start[side] + (long[side] - (gone[side] - place))[:, None] * along[side]
    inner = launcher.empty(count, wp.int32)
    inside = (point - INSIDE * length * out[side]).astype(np.float32)
    launcher.launch(
        kernels_facets.find_faces,
        count,
        [on_device.mesh, launcher.array(inside, wp.vec3), NEAR * length],
        [inner],
    )
    face = inner.numpy()
    goes_on = face >= 0
    goes_on &= (facets.normal[face] * normal[side]).sum(axis=1) > SAME_SIDE
    goes_on &= facets.label[face] == facets.label[facet[side]]
    side, point = side[goes_on], point[goes_on]
    away = step * (np.arange(math.ceil(reach / step)) + 0.5)
    result = empty_points(launcher, len(side) * len(away))
    result.position.assign((point[:, None] + away[:, None] * out[side][:, None]).reshape(-1, 3).astype(np.float32))
    result.normal.assign(np.repeat(normal[side], len(away), axis=0).astype(np.float32))
    result.label.assign(np.repeat(facets.label[facet[side]], len(away)).astype(np.int32))
    return result
