"""Obstacles that are outlines on a surface, for the solver: on a device, and among the bodies whose outlines are parted."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..model.model import Model
from ..model.surface_places import Spots, spots_near_points
from ..motion import kernels_obstacles
from ..problem.body_kind import radius_of
from ..problem.outlines_of_obstacles import outlines_of_obstacles
from ..problem.outlines_on_surface import OutlinesOnSurface
from ..problem.problem import Problem
from ..problem.surface import Surface
from ..space.cell_sort import CellSort
from ..space.size_levels import levels_of
from ..surface.facets import Facets
from .surface_contact import SLOTS_PER_BODY

__all__ = ["clear_of_outlines", "outlines_among", "outlines_on_ground", "rooms", "spots_of_outlines"]

# Cells of outlines are no smaller than this share of the room that the widest body keeps.
CELLS_OF_ROOM = 0.5


def outlines_among(model: Model) -> OutlinesOnSurface:
    """Return the obstacles that stand among bodies whose outlines are parted: none where bodies may overlap."""
    problem = model.problem
    return problem.outlines_on_surface if problem.avoid_overlap else outlines_of_obstacles(_surface_of(problem), ())


def spots_of_outlines(launcher: Launcher, facets: Facets, outlines: OutlinesOnSurface) -> Spots:
    """Return where outlines lie, by facets."""
    return spots_near_points(launcher, facets, outlines.points)


def rooms(model: Model) -> np.ndarray:
    """Return how far the middles of bodies keep off outlines, in units, shape ``[n]``.

    Where footprints may not overlap it is as far as none of them can come nearer, however it is turned; they are parted exactly in the
    end. Elsewhere it is nothing.
    """
    if not model.problem.avoid_overlap:
        return np.zeros(model.body_count)
    longest = model.body.longest
    width = model.widths(longest) if model.kinds else np.zeros(len(longest))
    footprints = model.footprints
    inner = np.array([outline.inner_radius for outline in footprints.shapes] + [0.0])[footprints.shape]
    own = np.where(footprints.is_outline, inner * footprints.factor, radius_of(width, model.body.area))
    return own * np.minimum(footprints.room, 1.0) / model.unit


def clear_of_outlines(model: Model, facets: Facets, share: np.ndarray) -> np.ndarray:
    """Return the share of every class's density on tiles whose middles are as far from outlines as any of its bodies must be.

    Where there are no such tiles, it is as it was.
    """
    outlines = model.problem.outlines_on_surface
    if not len(outlines):
        return share
    room = rooms(model) * model.unit
    needed = [float(room[model.body.class_index == k].min(initial=0.0)) for k in range(len(share))]
    middles = facets.surface.points(*facets.in_triangle(*facets.tiles(np.arange(facets.count))))
    away = outlines.distance(middles, max(needed))
    result = share.copy()
    for k, own in enumerate(needed):
        left = np.where(away >= own, share[k], 0.0)
        if left.any():
            result[k] = left
    return result


def outlines_on_ground(launcher: Launcher, model: Model, facets: Facets) -> kernels_obstacles.OutlinesOnGround:
    """Return them as the descent's kernels take them."""
    outlines, unit, device = model.problem.outlines_on_surface, model.unit, launcher.device
    m = len(outlines)
    result = kernels_obstacles.OutlinesOnGround()
    result.count = m
    if not m:
        return result
    facet, _ = spots_of_outlines(launcher, facets, outlines)
    corners = np.array([len(shape.corners) for shape in outlines.shapes])[outlines.shape]
    first = np.concatenate([[0], np.cumsum(corners)]).astype(np.int32)
    corner = np.empty((int(first[-1]), 2))
    for number, shape in enumerate(outlines.shapes):
        own = np.flatnonzero(outlines.shape == number)
        corner[first[own][:, None] + np.arange(len(shape.corners))] = shape.corners * outlines.scale[own, None, None]
    reach = outlines.reach / unit
    level, level_reach = levels_of(reach)
    cell = np.maximum(level_reach, CELLS_OF_ROOM * float(rooms(model).max(initial=0.0)))
    table = wp.zeros(m, dtype=kernels_obstacles.OutlineOnGround, device="cpu").numpy()
    values = {
        "position": (outlines.position - facets.middle) / unit,
        "normal": outlines.normal,
        "along": outlines.along,
        "label": facets.label[facet],
        "first_corner": first[:-1],
        "end_corner": first[1:],
        "rounding": outlines.rounding / unit,
        "reach": reach,
        "level": level,
    }
    for name, column in values.items():
        table[name] = column
    slots = 1 << max(4, (SLOTS_PER_BODY * m - 1).bit_length())
    result.mask = slots - 1
    result.level_count = len(level_reach)
    result.level = wp.array(np.column_stack([level_reach, 0.5 / cell]), dtype=wp.vec2, device=device)
    result.corner = wp.array(corner / unit, dtype=wp.vec2, device=device)
    given = wp.array(table, dtype=kernels_obstacles.OutlineOnGround, device=device)
    sort = CellSort(launcher, m, slots)
    sort.sort(kernels_obstacles.outline_slots, [given, result.level, result.mask])
    result.start = sort.cell_start
    result.outline = wp.array(table[sort.order.numpy()[:m]], dtype=kernels_obstacles.OutlineOnGround, device=device)
    return result


def _surface_of(problem: Problem) -> Surface:
    assert isinstance(problem.domain, Surface)
    return problem.domain
