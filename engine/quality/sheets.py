"""Which parts of a surface are one sheet, for the report: found from their borders, with nothing taken from the solver."""

from __future__ import annotations

import math

import numpy as np

from ..problem.surface import Surface

__all__ = ["sheets_of"]

# Borders meet that come this near to each other, in mean spacings of the bodies.
MEETS = 0.1
# Places along a side that are looked at, at most.
MOST_PLACES = 1000
# Parts that would hold fewer bodies than this are one: they are crumbs rather than surfaces of their own.
CRUMBS = 8.0


def sheets_of(surface: Surface, count: int) -> np.ndarray:
    """Return a number for every triangle, shape ``[t]``: bodies on triangles of different numbers do not overlap, however near.

    Args:
        surface: The surface.
        count: Number of bodies.
    """
    part = surface.part
    label = np.arange(int(part.max()) + 1)
    if len(label) == 1:
        return part
    triangle, corner = np.nonzero(surface.open_side)
    near = MEETS * math.sqrt(surface.area / count)
    if len(triangle):
        start, end = (surface.position[surface.triangle[triangle, (corner + k) % 3]] for k in (1, 2))
        places = np.clip(np.ceil(np.linalg.norm(end - start, axis=1) / near), 1, MOST_PLACES).astype(np.int64)
        side = np.repeat(np.arange(len(triangle)), places)
        within = np.arange(len(side)) - np.repeat(np.cumsum(places) - places, places)
        point = start[side] + (end - start)[side] * ((within + 0.5) / places[side])[:, None]
        own = part[triangle[side]]
        # What is so near shares a cell with it in one of eight grids.
        for shift in range(8):
            moved = point / (2.0 * near) + 0.5 * np.array([shift & 1, shift >> 1 & 1, shift >> 2 & 1])
            cell = np.unique(np.floor(moved).astype(np.int64), axis=0, return_inverse=True)[1].ravel()
            order = np.argsort(cell, kind="stable")
            follows = cell[order[1:]] == cell[order[:-1]]
            label = _united(label, own[order[1:]][follows], own[order[:-1]][follows])
    area = np.bincount(label[part], surface.triangle_area, len(label))
    crumb = area[label] < CRUMBS * surface.area / count
    label = np.where(crumb, len(label), label)
    return label[part]


def _united(label: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Labels of parts after couples of parts have become one."""
    pairs = np.unique(np.stack([one, other], axis=1), axis=0)
    while True:
        low = np.minimum(label[pairs[:, 0]], label[pairs[:, 1]])
        if (label[pairs] == low[:, None]).all():
            return label
        lower = np.arange(len(label))
        for column in (0, 1):
            np.minimum.at(lower, label[pairs[:, column]], low)
        label = lower[label]
