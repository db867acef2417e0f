"""What tiles have in common with those of another density on the same facets: an edit changes few of them."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..surface.facets import Facets, are_near

__all__ = ["CarriedTiles"]

# Shares that differ by less, as a share of them, are the same.
SAME_SHARE = 1e-6
# Cells that what is near a change is looked for in, along the distance.
CELLS = 4
# A point of a triangle is no farther than this, times its longest side, from its corners or its middle.
OFF_MARKS = 0.334


class CarriedTiles:
    """Which tiles were there before, and where as much is asked for on them as before, but for one factor.

    Args:
        facets: The surface as it is cut now.
        share: Share of every image on every tile, shape ``[column_count, tile_count]``.
        cuts: How the same facets were cut before, shape ``[f]``.
        share_before: The shares then, shape ``[column_count, tile count then]``.

    Attributes:
        facets: The surface.
        source: Number that every tile had, -1 for new ones, shape ``[tile_count]``.
        factor: What the shares of most tiles were multiplied by, shape ``[column_count]``.
        changed: Facets that were cut otherwise, or on which shares changed otherwise, shape ``[f]``.
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
        """Number that every corner of tiles had that lies on a facet that is kept, -1 for all others, shape ``[corner_count]``."""
        now, before = ((cuts + 1) * (cuts + 2) // 2 for cuts in (self.facets.cuts, self._cuts))
        return self._sources(now, before, kept)

    def is_near(self, place: np.ndarray, distance: float) -> np.ndarray:
        """Which places [units], shape ``[n, 3]``, are within a distance of what changed, and some that are farther; shape ``[n]``."""
        return are_near(place, self._marks[self.changed].reshape(-1, 3), distance + self._off_marks, CELLS)

    def are_facets_near(self, distance: float) -> np.ndarray:
        """Which facets have points that are, shape ``[f]``."""
        return self.is_near(self._marks.reshape(-1, 3), distance + self._off_marks).reshape(-1, 4).any(axis=1)

    @cached_property
    def _marks(self) -> np.ndarray:
        """Corners and middle of every facet, shape ``[f, 4, 3]``."""
        corner = self.facets.corner
        return np.concatenate([corner, corner.mean(axis=1, keepdims=True)], axis=1)

    @property
    def _off_marks(self) -> float:
        """How far a point of a facet is from the nearest of these at most."""
        return OFF_MARKS * float(self.facets.longest.max())

    def _sources(self, count: np.ndarray, count_before: np.ndarray, kept: np.ndarray | None = None) -> np.ndarray:
        """Number before of everything of which a facet has so many, one facet after the other; -1 where it is new, or not kept."""
        kept = self._as_before if kept is None else self._as_before & kept
        shift = (np.cumsum(count_before) - count_before) - (np.cumsum(count) - count)
        number = np.arange(int(count.sum())) + np.repeat(shift, count)
        return np.where(np.repeat(kept, count), number, -1).astype(np.int32)
