"""Places on a surface: of bodies that are fixed, of new ones that leave obstacles room, and of those that an edit brings."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..errors import ProblemError, Reason, Refusal
from ..geometry.nearest_on_triangles import corner_weights
from ..geometry.small_matrices import inverses
from ..problem.body_kind import radius_of
from ..problem.given_values import show
from ..problem.surface import PointsOnSurface
from ..surface import kernels_facets
from ..surface.facets import Facets
from .model import Model

__all__ = [
    "PlacesOnSurface",
    "TilePlaces",
    "balls_of",
    "cells_of",
    "clear_of_balls",
    "clearances",
    "middles_of_strata",
    "positions_of",
    "reach_into_balls",
    "spots_near_points",
    "spots_of_fixed",
    "spots_of_places",
    "spots_of_points",
    "tile_middles",
    "tiles_of",
    "with_first_corner",
]

# How far from the surface a fixed body may be given, in units.
NEAR = 1.0
# Who touches a ball does not reach into it, whatever rounding makes of that.
ROUNDED = 1.0 - 1e-5

# Facet of every point, shape [n], and the weights of its second and third corner, [n, 2].
Spots = tuple[np.ndarray, np.ndarray]


def spots_of_points(facets: Facets, points: PointsOnSurface) -> Spots:
    """Return where points of the surface are by facets."""
    order = np.argsort(facets.triangle, kind="stable")
    first = np.searchsorted(facets.triangle[order], points.triangle)
    count = np.searchsorted(facets.triangle[order], points.triangle, side="right") - first
    row = np.repeat(np.arange(len(first)), count)
    before = np.cumsum(count) - count
    within = np.arange(len(row)) - np.repeat(before, count)
    candidate = order[first[row] + within]
    used, which = np.unique(candidate, return_inverse=True)
    weight = np.einsum("nk,nkd->nd", points.barycentric[row], inverses(facets.weight[used])[which])
    if len(row) == len(first):
        return candidate.astype(np.int32), _inside(weight)
    # Of the facets of its triangle, that which a point lies deepest in.
    depth = weight.min(axis=1)
    best = np.lexsort((candidate, -depth, row))
    chosen = best[before]
    return candidate[chosen].astype(np.int32), _inside(weight[chosen])


def spots_near_points(launcher: Launcher, facets: Facets, points: PointsOnSurface) -> Spots:
    """Return what :func:`spots_of_points` does, sooner where triangles have many facets."""
    count = np.bincount(facets.triangle, minlength=len(facets.surface.triangle))
    whole = count[points.triangle] == 1
    if whole.all():
        return spots_of_points(facets, points)
    facet, weight = np.empty(len(whole), np.int32), np.empty((len(whole), 2), np.float32)
    for own, spots in ((whole, spots_of_points), (~whole, partial(_spots_in_parts, launcher))):
        some = np.flatnonzero(own)
        if len(some):
            facet[some], weight[some] = spots(
                facets, points.surface.points(points.triangle[some], points.barycentric[some])
            )
    return facet, weight


def _spots_in_parts(launcher: Launcher, facets: Facets, points: PointsOnSurface) -> Spots:
    """The same of points on triangles of which each has many facets."""
    place = (points.position - facets.middle) / facets.unit
    facet = _nearest_facets(launcher, facets, place)
    weight = _inside(corner_weights(facets.corner[facet], place))
    # What lies on two sides of a face at once, or on an edge, is on the triangle that it is said to be on.
    other = np.flatnonzero((facet < 0) | (facets.triangle[facet] != points.triangle))
    if len(other):
        some = points.surface.points(points.triangle[other], points.barycentric[other])
        facet[other], weight[other] = spots_of_points(facets, some)
    return facet, weight


def _nearest_facets(launcher: Launcher, facets: Facets, place: np.ndarray) -> np.ndarray:
    """Facets that are the nearest to places, in units, int32; -1 for what is far from all of them."""
    near = launcher.empty(len(place), wp.int32)
    on_device = wp.array(place.astype(np.float32), dtype=wp.vec3, device=launcher.device)
    launcher.launch(kernels_facets.find_faces, len(place), [facets.mesh.id, on_device, NEAR], [near])
    return near.numpy().copy()


def spots_of_fixed(launcher: Launcher, model: Model, facets: Facets) -> Spots:
    """Return where the fixed bodies of a problem are by facets, in the order of its table.

    Raises:
        ProblemError: One of them is not on the surface.
    """
    table = model.problem.fixed
    at = PlacesOnSurface(table.position, table.mesh, table.triangle, table.barycentric)
    return spots_of_places(launcher, facets, at, "`fixed.position`")


class PlacesOnSurface(NamedTuple):
    """Places on or near a surface, as whoever kept them knows them.

    Attributes:
        position: [m], shape ``[n, 3]``.
        mesh: Of which mesh of the surface a triangle is, shape ``[n]``.
        triangle: Triangle of that mesh, -1 where only the position is known, shape ``[n]``.
        barycentric: Weights of that triangle's corners, shape ``[n, 3]``.
    """

    position: np.ndarray
    mesh: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray


def spots_of_places(launcher: Launcher, facets: Facets, places: PlacesOnSurface, key: str) -> Spots:
    """Return where places are by facets; ``key`` is how a sentence names their positions.

    Raises:
        ProblemError: One of them is not on the surface.
    """
    count = len(places.position)
    facet, weight = np.zeros(count, np.int32), np.zeros((count, 2), np.float32)
    known = np.flatnonzero(places.triangle >= 0)
    if len(known):
        points = facets.surface.locate(places.mesh[known], places.triangle[known], places.barycentric[known])
        facet[known], weight[known] = spots_of_points(facets, points)
    found = np.flatnonzero(places.triangle < 0)
    if len(found):
        place = (places.position[found] - facets.middle) / facets.unit
        facet[found] = _nearest_facets(launcher, facets, place)
        missed = np.flatnonzero(facet[found] < 0)
        if len(missed):
            raise ProblemError(
                f"{key} must lie on the surface; {show(places.position[found[missed[0]]].tolist())} is more than "
                f"{NEAR * facets.unit:.3g} m away from it, that of body {found[missed[0]]}",
                Refusal(Reason.FIXED_OFF_SURFACE, NEAR * facets.unit, NEAR * facets.unit),
            )
        weight[found] = _inside(corner_weights(facets.corner[facet[found]], place))
    return facet, weight


def balls_of(model: Model, facets: Facets) -> np.ndarray:
    """Return the balls that bodies keep out of, in units: center and radius, shape ``[m, 4]``."""
    found = [(*one.ball[:3], one.ball[3] + one.margin) for one in model.problem.obstacles if one.ball is not None]
    balls = np.array(found, dtype=np.float64).reshape(-1, 4)
    balls[:, :3] -= facets.middle
    return balls / facets.unit


def clearances(model: Model) -> np.ndarray:
    """Return how far bodies keep off obstacles, in units, shape ``[n]``: by their footprints where these may not overlap.

    Outlines reach as far as their farthest points, however they come to be turned; of lines, to their sides.
    """
    if not model.problem.avoid_overlap:
        return np.zeros(model.body_count)
    longest = model.body.longest
    width = model.widths(longest) if model.kinds else np.zeros(len(longest))
    footprints = model.footprints
    outlined = footprints.is_outline & (model.body.kind < 0)
    return np.where(outlined, footprints.circumradius, radius_of(width, model.body.area)) / model.unit


def clear_of_balls(model: Model, facets: Facets, share: np.ndarray, balls: np.ndarray, clear: np.ndarray) -> np.ndarray:
    """Return the share of every class's density on tiles that lie outside of all balls as a whole.

    Raises:
        ProblemError: Nothing of a class is left.
    """
    if not len(balls):
        return share
    facet_of_tile, middle = tile_middles(facets)
    corner = facets.corner[facet_of_tile]
    reach = np.linalg.norm(corner - corner.mean(axis=1, keepdims=True), axis=2).max(axis=1) / facets.cuts[facet_of_tile]
    result = share.copy()
    for k, body_class in enumerate(model.problem.classes):
        most = float(clear[model.body.class_index == k].max())
        for ball in balls:
            away = np.linalg.norm(middle - ball[:3], axis=1) - ball[3] - most
            result[k, away < reach] = 0.0
        if not result[k].any():
            raise ProblemError(
                f'`obstacles` must leave room for class "{body_class.name}", which keeps away from them by its size',
                Refusal(Reason.OBSTACLES_TOO_NEAR, most * facets.unit, 0, (body_class.name, "")),
            )
    return result


def reach_into_balls(facets: Facets, spots: Spots, balls: np.ndarray, clear: np.ndarray) -> np.ndarray:
    """Return which bodies at spots are nearer to a ball than they may be, by more than rounding, shape ``[n]``."""
    place, _ = positions_of(facets, spots)
    result = np.zeros(len(place), bool)
    for ball in balls:
        away = np.linalg.norm(place - ball[:3], axis=1)
        result |= away < (ball[3] + clear) * ROUNDED
    return result


class TilePlaces:
    """Draws places from shares of tiles.

    Args:
        facets: The surface.
        rng: What is random.
    """

    def __init__(self, facets: Facets, rng: np.random.Generator) -> None:
        self._facets, self._rng = facets, rng
        self._facet, self._weight = facets.tiles(np.arange(facets.count))
        self._middle = tile_middles(facets)[1]

    def draw(self, share: np.ndarray, count: int) -> Spots:
        """Return ``count`` places that are spread evenly over a share of every tile, shape ``[tile_count]``; others every time."""
        tile = middles_of_strata(self._middle, share, count, self._rng.random())
        facet = self._facet[tile]
        within = 0.3 * (self._rng.random((count, 2)) - 0.5) / self._facets.cuts[facet][:, None]
        return facet.astype(np.int32), (self._weight[tile, 1:] + within).astype(np.float32)


def middles_of_strata(position: np.ndarray, weight: np.ndarray, count: int, phase: float = 0.0) -> np.ndarray:
    """Cut things into as many strata of equal weight, and return the one in the middle of each.

    Args:
        position: Where they are, in the order of a curve that neighbors in space are near to each other on, shape ``[n, 3]``.
        weight: Of each, 0 or more, shape ``[n]``.
        count: How many strata.
        phase: By how much of a stratum they are shifted along the curve, 0 to 1.

    Returns:
        Their numbers, shape ``[count]``: all different where none has more than the weight of a stratum.
    """
    if not count:
        return np.zeros(0, np.int64)
    running = np.cumsum(weight)
    share = running[-1] / count
    # Whoever lies across the middle of a stratum along the curve is in it, unless it is larger.
    along = (np.arange(count) + 0.5 - phase) % count
    result = np.minimum(np.searchsorted(running, along * share, side="right"), len(running) - 1)
    has_weight = np.flatnonzero(weight > 0.0)
    own = weight[has_weight]
    stratum = ((running[has_weight] - 0.5 * own) / share + phase).astype(int) % count
    total = np.bincount(stratum, own, count)
    place = position[has_weight]
    middle = np.stack([np.bincount(stratum, own * axis, count) / np.maximum(total, 1e-300) for axis in place.T], axis=1)
    away = np.linalg.norm(place - middle[stratum], axis=1)
    order = np.lexsort((has_weight, away, stratum))
    found, first = np.unique(stratum[order], return_index=True)
    result[found] = has_weight[order[first]]
    return result


def tile_middles(facets: Facets) -> tuple[np.ndarray, np.ndarray]:
    """Return the facet of every tile, shape ``[tile_count]``, and where its middle is, in units, ``[tile_count, 3]``."""
    facet, weight = facets.tiles(np.arange(facets.count))
    return facet, np.einsum("nk,nkd->nd", weight, facets.corner[facet])


def with_first_corner(spots: Spots) -> tuple[np.ndarray, np.ndarray]:
    """Facets, and the weights of all three of their corners, shape ``[n, 3]``."""
    facet, weight = spots
    return facet, np.column_stack([1.0 - weight.sum(axis=1), weight])


def positions_of(facets: Facets, spots: Spots) -> tuple[np.ndarray, np.ndarray]:
    """Return where spots are, in units, and the weights of all three corners of their facets, both of shape ``[n, 3]``."""
    facet, full = with_first_corner(spots)
    return np.einsum("nk,nkd->nd", full, facets.corner[facet]), full


def cells_of(place: np.ndarray, normal: np.ndarray, size: float) -> np.ndarray:
    """Number of the cell that each place is in, another one for each of six directions that the surface looks to."""
    cell = np.floor(place / size).astype(np.int64)
    cell -= cell.min(axis=0)
    extent = cell.max(axis=0) + 1
    axis = np.argmax(np.abs(normal), axis=1)
    sheet = 2 * axis + (normal[np.arange(len(normal)), axis] > 0.0)
    return ((cell[:, 0] * extent[1] + cell[:, 1]) * extent[2] + cell[:, 2]) * 6 + sheet


def _inside(weight: np.ndarray) -> np.ndarray:
    """Weights of the second and third corner, float32, of points brought into their triangle."""
    weight = np.maximum(weight, 0.0)
    weight /= weight.sum(axis=1, keepdims=True)
    return weight[:, 1:].astype(np.float32)


def tiles_of(facets: Facets, facet: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the number of the tile that each place is on, as kernels count them."""
    cuts = facets.cuts[facet]
    x, y = weight[:, 0].astype(np.float64) * cuts, weight[:, 1].astype(np.float64) * cuts
    j = np.clip(np.floor(y).astype(np.int64), 0, cuts - 1)
    i = np.clip(np.floor(x).astype(np.int64), 0, cuts - 1 - j)
    upper = (i < cuts - 1 - j) & ((x - i) + (y - j) > 1.0)
    return facets.first_tile[facet] + j * (2 * cuts - j) + 2 * i + upper
