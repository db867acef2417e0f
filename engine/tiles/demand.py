"""What the whole domain asks of every group: shares of densities, and what fixed bodies leave of them.

Fixed bodies count as part of what their density asks for. Where they are more than that, the excess is a target of its own, so that
others do not keep away from them far and wide; see :mod:`~esh.engine.model.attraction`, which does so for one solve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..model.attraction import BLUR_OF_FIXED, but_for_chance, water_level
from ..problem.image_filters import gaussian_blur
from .bodies import written_atomically
from .coarse import SCALE, CoarseGrid
from .groups import TileGroups
from .layout import Layout

__all__ = ["Demand", "find_demand", "integrals_of_tiles", "read_demand", "write_demand"]


@dataclass(frozen=True, eq=False)
class Demand:
    """What is asked for.

    Attributes:
        totals: Integral of every class's density over the whole domain, in m² times density, shape ``[classes]``.
        level: Bodies of every group that its density stands for over those that there are, shape ``[groups]``; 1 without excess.
        excess: Of groups that have fixed bodies beyond what is asked for: how many in every cell of the coarse grid.
        left: Of groups that have fixed bodies: how many others each cell is to get.
        vacancy: Of classes that have fixed bodies: what share of what is asked for in every cell these leave to others.
    """

    totals: np.ndarray
    level: np.ndarray
    excess: dict[int, np.ndarray]
    left: dict[int, np.ndarray]
    vacancy: dict[int, np.ndarray]


def find_demand(groups: TileGroups, grid: CoarseGrid, target: np.ndarray, totals: np.ndarray) -> Demand:
    """Find what is asked for.

    Args:
        groups: All groups.
        grid: The coarse grid.
        target: Integral of every class's density in its cells, shape ``[classes, rows, columns]``.
        totals: Integral over the domain, shape ``[classes]``.
    """
    level = np.ones(groups.number)
    excess: dict[int, np.ndarray] = {}
    left: dict[int, np.ndarray] = {}
    fixed_group = groups.group_of(groups.fixed_identity)
    for g in np.unique(fixed_group).tolist():
        position = groups.fixed.position[fixed_group == g]
        whole = np.zeros((1, *grid.shape), np.int64)
        grid.deposit(position, np.zeros(len(position), np.int64), 1).add_to(whole)
        count = int(groups.count[g])
        spacing = math.sqrt(math.prod(grid.size) / count)
        sigma = BLUR_OF_FIXED * spacing / max(grid.cell)
        there = gaussian_blur(whole[0] / SCALE, sigma)
        there *= len(position) / float(there.sum())
        density = target[groups.class_index[g]] * (count / float(target[groups.class_index[g]].sum()))
        asked = gaussian_blur(density, sigma)
        there = but_for_chance(there, asked)
        share = water_level(asked, there, float(count), 1.0)
        over = np.maximum(there - share * asked, 0.0)
        # Nowhere that nothing is asked for.
        left[g] = np.maximum(share - there / np.maximum(asked, 1e-300), 0.0) * density
        # What rounding leaves is no excess.
        if over.sum() > 1e-6 * count:
            level[g], excess[g] = share, over
    vacancy = {}
    for c in {int(groups.class_index[g]) for g in left}:
        density = target[c] / float(target[c].sum())
        own = np.flatnonzero(groups.class_index == c).tolist()
        asked = sum(float(level[g]) * int(groups.count[g]) for g in own) * density
        there = sum(left.get(g, int(groups.count[g]) * density) for g in own)
        vacancy[c] = there / np.maximum(asked, 1e-300)
    return Demand(totals, level, excess, left, vacancy)


def integrals_of_tiles(cells: np.ndarray, grid: CoarseGrid, layout: Layout) -> np.ndarray:
    """What lies in every tile, shape ``[tiles]``, of what lies in the cells of a grid, evenly within each."""
    before = np.zeros((cells.shape[0] + 1, cells.shape[1] + 1))
    before[1:, 1:] = np.cumsum(np.cumsum(cells, axis=0), axis=1)
    for axis in (1, 0):
        edge = layout.cuts(axis, 0.0) / layout.units[axis] * grid.shape[1 - axis]
        first = np.minimum(edge.astype(np.int64), grid.shape[1 - axis] - 1)
        share = edge - first
        along = 1 - axis
        shape = [1, 1]
        shape[along] = -1
        share = share.reshape(shape)
        low, high = np.take(before, first, axis=along), np.take(before, first + 1, axis=along)
        before = (1.0 - share) * low + share * high
    return np.diff(np.diff(before, axis=0), axis=1).ravel()


def write_demand(path: Path, demand: Demand) -> None:
    """Write what windows and flows need of it."""
    grids = {f"excess_{g}": values for g, values in demand.excess.items()}
    grids |= {f"vacancy_{c}": values for c, values in demand.vacancy.items()}
    with written_atomically(path) as file:
        np.savez(file, totals=demand.totals, level=demand.level, **grids)


def read_demand(path: Path) -> Demand:
    """Read what :func:`write_demand` wrote."""
    with np.load(path, allow_pickle=False) as stored:
        excess, vacancy = (
            {int(key.removeprefix(start)): stored[key] for key in stored.files if key.startswith(start)}
            for start in ("excess_", "vacancy_")
        )
        return Demand(stored["totals"], stored["level"], excess, {}, vacancy)
