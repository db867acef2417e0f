"""Bodies as they lie in space, so that those near each other lie near each other in memory."""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..space.cell_sort import CellSort
from . import kernels_spatial_order

__all__ = ["order_of_groups", "spatial_order"]

# Rows are so many times as high as bodies are apart, and where bodies of a cell keep their order it is so many times as wide.
ROW_HEIGHT, CELL_WIDTH = 2.0, 4.0


def spatial_order(launcher: Launcher, pose: wp.array, size: tuple[float, float]) -> np.ndarray:
    """Return the numbers of all bodies, row after row of the domain and from left to right in each, int32, shape ``[n]``.

    Args:
        launcher: Where to run.
        pose: Positions, and what else, ``wp.vec4``, shape ``[n]``.
        size: Extent of the domain.
    """
    n = len(pose)
    rows = max(1, int(math.sqrt(n / ROW_HEIGHT**2)))
    columns = max(1, n // rows)
    cells = CellSort(launcher, n, rows * columns)
    cells.sort(kernels_spatial_order.row_cells, [pose, wp.vec2(*size), rows, columns])
    launcher.launch(kernels_spatial_order.order_in_cells, rows * columns, [cells.cell_start, pose], [cells.order])
    return cells.order.numpy()[:n].copy()


def order_of_groups(
    launcher: Launcher, pose: wp.array, size: tuple[float, float], group: wp.array, count: np.ndarray
) -> wp.array:
    """Return the numbers of all bodies, group after group, and of each row after row, cell after cell from left to right.

    Args:
        launcher: Where to run.
        pose: Positions, and what else, ``wp.vec4``, shape ``[n]``.
        size: Extent of the domain.
        group: Of every body, ``wp.int32``, shape ``[n]``.
        count: Bodies of every group.

    Returns:
        ``wp.int32``, shape ``[n]`` or longer.
    """
    rows = np.maximum(np.sqrt(count) / ROW_HEIGHT, 1.0).astype(np.int32)
    columns = np.maximum(count / (rows * ROW_HEIGHT * CELL_WIDTH), 1.0).astype(np.int32)
    begin = np.concatenate([[0], np.cumsum(rows.astype(np.int64) * columns)])
    cells = CellSort(launcher, len(group), int(begin[-1]))
    of_groups = [launcher.array(values.astype(np.int32), wp.int32) for values in (rows, columns, begin)]
    cells.sort(kernels_spatial_order.row_cells_of_groups, [pose, wp.vec2(*size), group, *of_groups])
    return cells.order
