"""Which tiles of a surface an edit left as they were: only what is near the others has to be found anew."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..surface.facets import Facets, are_near

__all__ = ["CarriedTiles"]

# Shares are the same if they differ by no more than this, relatively.
SAME_SHARE = 1e-6
# Places near a change are looked for in cells of the distance over this.
CELLS = 4
# Every point of a triangle is nearer than this, times its longest side, to one of its corners or its center.
OFF_MARKS = 0.334


class CarriedTiles:
    """Tiles before and after an edit.

    An edit of a density in one place changes the shares of all other tiles by one factor, because they add up to 1. Tiles with that
    factor count as unchanged.

    Args:
        facets: The surface as it is cut now.
        share: Share of every image on every tile, shape ``[image_count, tile_count]``.
        cuts: Tiles along a side of each facet before the edit, shape ``[facet_count]``.
        share_before: The shares then, shape ``[image_count, tile count then]``.

    Attributes:
        facets: The surface.
        source: Number of every tile before the edit, -1 for new ones, shape ``[tile_count]``.
        factor: By what the shares of most tiles were multiplied, shape ``[image_count]``.
        changed: Which facets are cut otherwise, or have shares that changed by another factor, shape ``[facet_count]``.
    """

    def __init__(self, facets: Facets, share: np.ndarray, cuts: np.ndarray, share_before: np.ndarray) -> None:
        self.facets = facets
        self._as_before = facets.cuts == cuts
        self._cuts = cuts
        self.source = self._sources(facets.cuts**2, cuts**2)
        there = np.flatnonzero(self.source >= 0)
        now, before = share[:, there], share_before[:, self.source[there]]
        self.factor = np.ones(len(share))
        for k in range(len(share)):
            some = before[k] > 0.0
            if some.any():
                self.factor[k] = np.median(now[k, some] / before[k, some])
        expected = self.factor[:, None] * before
        differs = (np.abs(now - expected) > SAME_SHARE * expected).any(axis=0)
        of_tile = np.repeat(np.arange(facets.count), facets.cuts**2)
        self.changed = ~self._as_before
        self.changed[of_tile[there[differs]]] = True

    def corners_before(self, kept: np.ndarray) -> np.ndarray:
        """Number before the edit of all corners of tiles on facets that are ``kept``, -1 for others, shape ``[corner_count]``."""
        now, before = ((cuts + 1) * (cuts + 2) // 2 for cuts in (self.facets.cuts, self._cuts))
        return self._sources(now, before, kept)

    def is_near(self, place: np.ndarray, distance: float) -> np.ndarray:
        """Which places [units], shape ``[n, 3]``, may be within a distance of a changed facet: all that are, and some that are not."""
        return are_near(place, self._marks[self.changed].reshape(-1, 3), distance + self._off_marks, CELLS)

    def are_facets_near(self, distance: float) -> np.ndarray:
        """Which facets may have points within a distance of a changed one, shape ``[facet_count]``."""
        return self.is_near(self._marks.reshape(-1, 3), distance + self._off_marks).reshape(-1, 4).any(axis=1)

    @cached_property
    def _marks(self) -> np.ndarray:
        """Corners and center of every facet, shape ``[facet_count, 4, 3]``."""
        corner = self.facets.corner
        return np.concatenate([corner, corner.mean(axis=1, keepdims=True)], axis=1)

    @property
    def _off_marks(self) -> float:
        """Greatest distance of a point of a facet from the nearest of these."""
        return OFF_MARKS * float(self.facets.longest.max())

    def _sources(self, count: np.ndarray, count_before: np.ndarray, kept: np.ndarray | None = None) -> np.ndarray:
        """Numbers before the edit of items that are numbered facet by facet, -1 for those that are new or not kept.

        Args:
            count: Items of every facet now.
            count_before: The same before the edit.
            kept: Which facets are kept; None for all that are cut as before.
        """
        kept = self._as_before if kept is None else self._as_before & kept
        shift = (np.cumsum(count_before) - count_before) - (np.cumsum(count) - count)
        number = np.arange(int(count.sum())) + np.repeat(shift, count)
        return np.where(np.repeat(kept, count), number, -1).astype(np.int32)
