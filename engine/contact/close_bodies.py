"""Bodies that stand closer to another one than any should, as some do where forces had no part in where they stand."""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..device.launcher import GRAIN_OF_NEIGHBORS, Launcher
from ..space.cell_sort import CellSort
from ..space.kernels_cells import CellGrid, compute_cell_keys
from ..space.kernels_mesh import Mesh
from ..space.space import Space
from . import kernels_close

__all__ = ["close_bodies"]

# Over the width of a square for every body, of which one with a small charge fills a smaller one. Where forces have settled, no two of
# one class are nearer than .9, and no two of two classes than .75.
CLOSE = 0.65


def close_bodies(
    launcher: Launcher,
    position: np.ndarray,
    charge: np.ndarray,
    space: Space,
    mesh: Mesh,
    spacing: wp.array,
    factor: float,
) -> np.ndarray:
    """Return which bodies have another one nearer than they should, shape ``[n]``, bool.

    Args:
        launcher: Where to run.
        position: Where they are, shape ``[n, 2]``, in a space that ends at its edges.
        charge: Their charges, shape ``[n]``.
        space: This space, in the same unit.
        mesh: The mesh that spacings are known on.
        spacing: Of bodies at its nodes, over ``factor``.
        factor: What it is to be multiplied by.
    """
    n = len(position)
    low, high = position.min(axis=0), position.max(axis=0)
    extent = np.maximum(high - low, 1e-6 * max(space.size))
    # About one in a cell, on average; where they are thin, those beside it may hide one. That is not where they crowd.
    side = math.sqrt(float(extent.prod()) / n)
    columns, rows = (int(np.clip(length / side, 1, n)) for length in extent)
    grid = CellGrid()
    grid.count_x, grid.count_y = columns, rows
    grid.inverse_size = wp.vec2(columns / extent[0], rows / extent[1])
    grid.origin, grid.space = wp.vec2(*low.tolist()), space.for_kernels()
    at = launcher.array(position.astype(np.float32), wp.vec2)
    cells = CellSort(launcher, n, columns * rows)
    cells.sort(compute_cell_keys, [at, grid])
    share = launcher.array(np.sqrt(np.minimum(charge / charge.mean(), 1.0)), float)
    close = launcher.empty(n, wp.uint8)
    launcher.launch(
        kernels_close.find_close,
        n,
        [at, share, spacing, CLOSE * factor, mesh, cells.order, cells.cell_start, grid],
        [close],
        grain=GRAIN_OF_NEIGHBORS,
    )
    return close.numpy().astype(bool)
