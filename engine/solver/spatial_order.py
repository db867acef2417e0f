"""Bodies as they lie in space, so that those near each other lie near each other in memory."""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..space.cell_sort import CellSort
from . import kernels_spatial_order

__all__ = ["spatial_order"]

# Rows are so many times as high as bodies are apart.
ROW_HEIGHT = 2.0


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
