"""Levels of size: bodies of very different reach find each other in cells of their own."""

from __future__ import annotations

import numpy as np

__all__ = ["coarse_cells", "levels_of"]

# Levels of size, each of bodies within a factor of two; whatever is smaller still goes into the last.
MOST_LEVELS = 12
# Cells that larger bodies may look through for every body of a level of its own: as many as a few more neighbors of it cost.
CELLS_PER_BODY = 64.0


def coarse_cells(level_reach: np.ndarray) -> np.ndarray:
    """Sizes of cells that larger bodies look for those of a level in: of the smallest among these, how far it reaches."""
    return np.concatenate([level_reach[:1], level_reach[:-1]])


def levels_of(reach: np.ndarray, *, coarse: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Levels of size, the largest first, by how far bodies reach: that of each, int32, and the farthest reach in every one.

    Args:
        reach: How far bodies reach, shape ``[n]``.
        coarse: Whether larger bodies look for those of a level in :func:`coarse_cells`; else in cells twice as large as these reach.
    """
    level = np.clip(np.log2(reach.max() / reach), 0, MOST_LEVELS - 1).astype(np.int32)
    level = np.unique(level, return_inverse=True)[1].ravel().astype(np.int32)
    count = np.bincount(level)
    for m in range(len(count) - 1, 0, -1):
        # Cells that larger bodies look through for those of a level: a few small ones are found sooner among the larger.
        own = reach[level == m].max()
        cell = reach[level == m - 1].max() if coarse else 2.0 * own
        cells = (2.0 * (reach[level < m] + own) / cell + 1.0) ** 3
        if cells.sum() > CELLS_PER_BODY * count[m]:
            level[level == m] = m - 1
            count[m - 1] += count[m]
    level = np.unique(level, return_inverse=True)[1].ravel().astype(np.int32)
    return level, np.array([reach[level == m].max() for m in range(int(level.max()) + 1)])
