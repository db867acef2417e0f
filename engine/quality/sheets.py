"""Which parts of a surface are one sheet, for the report: found from their borders and creases, with nothing taken from the solver."""

from __future__ import annotations

import math

import numpy as np

from ..device.launcher import Launcher
from ..problem.connected import connected
from ..problem.surface import Surface
from ..surface.continuations import continued_parts

__all__ = ["sheets_of"]

# Borders meet that come this near to each other, in mean spacings of the bodies.
MEETS = 0.1
# Places along a side that are looked at, at most.
MOST_PLACES = 1000
# Parts that would hold fewer bodies than this are one: they are crumbs rather than surfaces of their own.
CRUMBS = 8.0


def sheets_of(surface: Surface, count: int, launcher: Launcher) -> np.ndarray:
    """Return a number for every triangle, shape ``[t]``: bodies on triangles of different numbers do not overlap, however near.

    Args:
        surface: The surface.
        count: Number of bodies.
        launcher: Where to run.
    """
    part = surface.part
    if part.max() == part.min():
        return part
    unit = math.sqrt(surface.area / count)
    part, _ = continued_parts(launcher, surface, unit, _met(surface, MEETS * unit), MEETS)
    area = np.bincount(part, surface.triangle_area)
    crumb = area < CRUMBS * unit**2
    return np.where(crumb, len(area), np.arange(len(area)))[part]


def _met(surface: Surface, near: float) -> np.ndarray:
    """Return a number for every triangle: parts whose open sides come nearer than this [m] have one."""
    part = surface.part
    triangle, corner = np.nonzero(surface.open_side)
    if not len(triangle):
        return part
    start, end = (surface.position[surface.triangle[triangle, (corner + k) % 3]] for k in (1, 2))
    places = np.clip(np.ceil(np.linalg.norm(end - start, axis=1) / near), 1, MOST_PLACES).astype(np.int64)
    side = np.repeat(np.arange(len(triangle)), places)
    within = np.arange(len(side)) - np.repeat(np.cumsum(places) - places, places)
    point = start[side] + (end - start)[side] * ((within + 0.5) / places[side])[:, None]
    own = part[triangle[side]]
    pairs = []
    # What is so near shares a cell with it in one of eight grids.
    for shift in range(8):
        moved = point / (2.0 * near) + 0.5 * np.array([shift & 1, shift >> 1 & 1, shift >> 2 & 1])
        cell = np.unique(np.floor(moved).astype(np.int64), axis=0, return_inverse=True)[1].ravel()
        order = np.argsort(cell, kind="stable")
        follows = cell[order[1:]] == cell[order[:-1]]
        pairs.append(np.stack([own[order[1:]][follows], own[order[:-1]][follows]]))
    return connected(int(part.max()) + 1, *np.concatenate(pairs, axis=1))[part]
