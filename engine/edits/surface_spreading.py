"""Points spread evenly over a density on a surface: where an edit takes bodies out, and where it sets new ones down.

As in the plane (:mod:`.spread`) they repel each other for a few steps, so that no stretch of the surface loses or gets two while
another one has none. Strata of a curve through space alone mix what is near in space and far along the surface.
"""

from __future__ import annotations

import math

import numpy as np

from ..descent.surface_descent import SurfaceDescent
from ..descent.surface_placement import points_of
from ..model.model import Model
from ..model.surface_places import Spots, spots_near_points, tiles_of, with_first_corner
from ..problem.body_class import BodyClass
from ..problem.problem import Problem
from ..problem.size import Size
from ..surface.facets import Facets

__all__ = ["SpreadingOnSurface", "is_spread", "nearest_of"]

# Measured with a twentieth of a surface painted and counts as they were, by the coverage error at a spacing over that after 100 more
# steps. A fifth of the density there: on a knotted tube with 1,000 bodies 5.6 without these steps and 1.6 with them, with 3,000 1.7
# and 1.3, on a torus 1.4 and 1.3. Three times the density: on the tube 2.3 and 1.4, 1.7 and 1.5; on a sphere no less.
STEPS = 24
# Densities that take less of the surface are followed by strata: they hold few bodies, and finer facets would take longer.
BROAD = 0.5
# Every triangle takes time, however few points are spread.
MOST_TRIANGLES = 30_000
# Many points are even enough without, and would take as long as all that follows.
MOST_POINTS = 20_000
# Share over the largest one for its area that a tile has at least: points may leave where there is no density.
LEAST = 1e-7
# Spacings of points that are taken as the same: so many from an area for each to twice that; and how many descents of different ones
# are kept.
SPACINGS_OF_TWICE = 2
MOST_KEPT = 3
# So many bodies before and behind a point on the curve are looked at for the nearest one.
AROUND = 100


def is_spread(facets: Facets, share: np.ndarray, count: int) -> bool:
    """Whether so many points are spread over a share of every tile, shape ``[tile_count]``, rather than taken from strata."""
    area = facets.tile_area
    some = (share > 0.0) & (area > 0.0)
    if not 1 < count <= MOST_POINTS or len(facets.surface.triangle) > MOST_TRIANGLES or not some.any():
        return False
    # As large as what would hold as much at the mean density that its points see.
    used = float(share[some].sum()) ** 2 / float((share[some] ** 2 / area[some]).sum())
    return used > BROAD * float(area.sum())


class SpreadingOnSurface:
    """Spreads points on a surface, again and again; what the surface is at a spacing is found once, and lasts for some more."""

    def __init__(self) -> None:
        # The last ones, by their spacings.
        self._descents: dict[int, SurfaceDescent] = {}

    def spread(self, facets: Facets, share: np.ndarray, start: Spots) -> Spots:
        """Return places that are spread evenly.

        Args:
            facets: The surface, always the same one, cut in any way.
            share: Of every tile, shape ``[tile_count]``; their sum is above 0.
            start: Where the points begin.
        """
        launcher, surface, count = facets.launcher, facets.surface, len(start[0])
        spacing = round(SPACINGS_OF_TWICE * math.log2(surface.area / count))
        before = self._descents.pop(spacing, None)
        problem = Problem(surface, [BodyClass("points", [Size("point", 1e-3 * surface.area / count, count)])])
        model = Model(problem, unit=2.0 ** (0.5 * spacing / SPACINGS_OF_TWICE))
        some = np.flatnonzero(share)
        facet, weight = facets.tiles(np.arange(facets.count))
        middles = surface.points(*facets.in_triangle(facet[some], weight[some]))
        begin = surface.points(*facets.in_triangle(*with_first_corner(start)))

        def shares(coarse: Facets) -> np.ndarray:
            tile = tiles_of(coarse, *spots_near_points(launcher, coarse, middles))
            found = np.bincount(tile, share[some], coarse.tile_count)
            area = np.maximum(coarse.tile_area, 1e-300)
            found = np.maximum(found, LEAST * float((found / area).max()) * area)
            return np.asarray(found / found.sum())[None]

        def put(new: SurfaceDescent) -> None:
            new.put_at(spots_near_points(launcher, new.facets, begin), None, None)

        descent = SurfaceDescent(model, launcher, put, before, shares)
        descent.step.play(STEPS)
        points = points_of(launcher, descent.facets, descent.state)
        launcher.release(descent.step)
        self._descents[spacing] = descent
        for oldest in list(self._descents)[:-MOST_KEPT]:
            del self._descents[oldest]
        return spots_near_points(launcher, facets, points)


def nearest_of(place: np.ndarray, tile: np.ndarray, body: np.ndarray, body_tile: np.ndarray) -> np.ndarray:
    """Return for every point a body near to it, for each another one: the nearest of those that are near it on the curve of tiles.

    Args:
        place: Where the points are, shape ``[n, 3]``.
        tile: The tile that each is on.
        body: Where the bodies are, along the curve, shape ``[m, 3]`` with ``m >= n``.
        body_tile: The tiles that these are on.
    """
    chosen = np.full(len(place), -1)
    free = np.ones(len(body), bool)
    while (left := np.flatnonzero(chosen < 0)).size:
        number = np.flatnonzero(free)
        width = min(2 * AROUND, len(number))
        first = np.clip(np.searchsorted(body_tile[number], tile[left]) - width // 2, 0, len(number) - width)
        candidate = number[first[:, None] + np.arange(width)]
        way = np.linalg.norm(body[candidate] - place[left, None], axis=2)
        best = way.argmin(axis=1)
        wanted, length = candidate[np.arange(len(left)), best], way[np.arange(len(left)), best]
        # Of points that want the same body the nearest one gets it.
        order = np.lexsort((left, length, wanted))
        _, winner = np.unique(wanted[order], return_index=True)
        got = order[winner]
        chosen[left[got]], free[wanted[got]] = wanted[got], False
    return chosen
