"""The coarse warp: what is too many bodies in one part of the domain flows to where there are too few.

Windows settle what is near; over distances longer than a window nothing moves in them. So all bodies are counted on a coarse grid, and
a flow that carries the blurred difference from the target away is found by one Poisson equation, with cosines, over the whole domain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..problem.image_filters import gaussian_blur
from ..problem.wave_filter import from_cosines, to_cosines

__all__ = ["CoarseGrid", "Patch", "cell_sums", "displacement", "solve_flow"]

# Fixed point of deposits: sums of integers do not depend on the order.
SCALE = 2.0**32
# Farthest that a body is moved, in spacings of its group.
LIMIT = 0.25
# A flow is divided by the density that it flows in, which counts as so large a share of its mean at least.
LEAST_DENSITY = 0.02


@dataclass(frozen=True)
class CoarseGrid:
    """A grid of cells over a domain, row 0 at the bottom.

    Attributes:
        size: Extent of the domain along x and y [m].
        shape: Rows and columns, 2 of either at least.
        periodic: Whether the domain wraps.
    """

    size: tuple[float, float]
    shape: tuple[int, int]
    periodic: bool = False

    @property
    def cell(self) -> tuple[float, float]:
        """Extent of a cell along x and y [m]."""
        return self.size[0] / self.shape[1], self.size[1] / self.shape[0]

    def deposit(self, position: np.ndarray, group: np.ndarray, groups: int) -> Patch:
        """Count bodies in the cells around them, by cubic splines.

        Linear weights would make a regular pattern of bodies look uneven, by as much as there is to be warped.

        Args:
            position: [m], shape ``[n, 2]``.
            group: Group of each, shape ``[n]``.
            groups: Number of groups.
        """
        if not len(position):
            return Patch(0, 0, np.zeros((groups, 0, 0), np.int64))
        scaled = position / self.cell - 0.5
        corner = np.floor(scaled).astype(np.int64)
        share = scaled - corner
        weights = [_spline(share[:, axis]) for axis in (0, 1)]
        # What lies beyond an edge of the domain is mirrored, as cosines are.
        around = [corner[:, axis] + np.arange(-1, 3)[:, None] for axis in (0, 1)]
        places = [
            place % cells
            if self.periodic
            else np.where(place < 0, -1 - place, np.where(place < cells, place, 2 * cells - 1 - place))
            for place, cells in zip(around, self.shape[::-1], strict=True)
        ]
        low = [int(place.min()) for place in places]
        columns, rows = (int(place.max()) + 1 - least for place, least in zip(places, low, strict=True))
        result = np.zeros(groups * rows * columns, np.int64)
        for up in range(4):
            first = (group * rows + places[1][up] - low[1]) * columns - low[0]
            for right in range(4):
                weight = weights[1][up] * weights[0][right]
                np.add.at(result, first + places[0][right], np.rint(weight * SCALE).astype(np.int64))
        return Patch(low[1], low[0], result.reshape(groups, rows, columns))


@dataclass(frozen=True, eq=False)
class Patch:
    """A part of a grid.

    Attributes:
        row: Its first row.
        column: Its first column.
        values: Shape ``[layers, rows, columns]``.
    """

    row: int
    column: int
    values: np.ndarray

    def add_to(self, whole: np.ndarray) -> None:
        """Add it to the whole grid, shape ``[layers, rows, columns]``."""
        _, rows, columns = self.values.shape
        whole[:, self.row : self.row + rows, self.column : self.column + columns] += self.values


def _spline(t: np.ndarray) -> np.ndarray:
    """Weights of the four points around a place that is a share ``t`` of a cell after the second of them, shape ``[4, n]``."""
    middle = [3.0 * t**3 - 6.0 * t**2 + 4.0, -3.0 * t**3 + 3.0 * t**2 + 3.0 * t + 1.0]
    return np.stack([(1.0 - t) ** 3, *middle, t**3]) / 6.0


def cell_sums(
    values: np.ndarray, axis: int, span: tuple[float, float], length: float, cells: int
) -> tuple[int, np.ndarray]:
    """Sums of pixels in the cells of a whole axis; pixels on the border of two cells belong to both, in part.

    Args:
        values: Shape ``[rows, columns]``; along ``axis`` they lie between the two ends of ``span``.
        axis: 0 or 1.
        span: Where the pixels begin and end.
        length: Of the whole axis.
        cells: Along it.

    Returns:
        The first cell, and the sums from there on.
    """
    values = np.moveaxis(values, axis, 0)
    pixels = len(values)
    scale = cells / length
    first = min(max(math.floor(span[0] * scale), 0), cells - 1)
    last = min(max(math.ceil(span[1] * scale - 1e-9), first + 1), cells)
    # Sums of all before an edge: linear within a pixel.
    edge = (np.arange(first, last + 1) / scale - span[0]) / (span[1] - span[0]) * pixels
    edge[0], edge[-1] = 0.0, pixels
    edge = np.clip(edge, 0.0, pixels)
    before = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0, dtype=np.float64)])
    whole = np.minimum(edge.astype(np.int64), pixels - 1)
    at_edge = before[whole] + (edge - whole)[:, None] * values[whole]
    return first, np.moveaxis(np.diff(at_edge, axis=0), 0, axis)


def solve_flow(
    grid: CoarseGrid, count: np.ndarray, target: np.ndarray, blur: float, threads: int = 1
) -> tuple[np.ndarray, ...]:
    """Find the flow that carries away what is too much.

    Args:
        grid: The grid.
        count: What there is in every cell, shape ``grid.shape``.
        target: What there ought to be, of the same sum.
        blur: Standard deviation of the Gaussian that the difference is blurred by [m].
        threads: That transform; the flow does not depend on their number.

    Returns:
        Flow along x through the edges between columns, shape ``[rows, columns + 1]``, and along y through those between rows, shape
        ``[rows + 1, columns]``; and the density that it flows in, shape ``[rows, columns]``; all per m², float32.
    """
    if grid.periodic:
        return _periodic_flow(grid, count, target, blur)
    (rows, columns), (width, height) = grid.shape, grid.cell
    along_x = 2.0 * np.sin(0.5 * np.pi * np.arange(columns) / columns) / width
    along_y = 2.0 * np.sin(0.5 * np.pi * np.arange(rows) / rows) / height
    squared = along_x[None, :] ** 2 + along_y[:, None] ** 2
    squared[0, 0] = 1.0
    factor = np.exp(-0.5 * blur**2 * squared) / squared
    factor[0, 0] = 0.0
    area = width * height
    # Counting has blurred the bodies by a spline, and the target by cells.
    of_cells = np.sinc(0.5 * np.arange(columns) / columns)[None, :] * np.sinc(0.5 * np.arange(rows) / rows)[:, None]
    difference = to_cosines(count, threads) / of_cells**4
    # A target that is even has one wave only, which is not asked for.
    if float(np.ptp(target)) > 0.0:
        difference -= to_cosines(target, threads) / of_cells
    potential = from_cosines(difference * (-factor / area), threads)
    flow_x, flow_y = np.zeros((rows, columns + 1), np.float32), np.zeros((rows + 1, columns), np.float32)
    flow_x[:, 1:-1] = np.diff(potential, axis=1) / width
    flow_y[1:-1] = np.diff(potential, axis=0) / height
    density = gaussian_blur(target, 1.0) / area
    return flow_x, flow_y, np.maximum(density, LEAST_DENSITY * density.mean()).astype(np.float32)


def _periodic_flow(grid: CoarseGrid, count: np.ndarray, target: np.ndarray, blur: float) -> tuple[np.ndarray, ...]:
    """What :func:`solve_flow` returns, in a domain that wraps: flows through its edges are those that come in on the other side."""
    (rows, columns), (width, height) = grid.shape, grid.cell
    turn_x, turn_y = np.arange(columns // 2 + 1) / columns, np.fft.fftfreq(rows)
    along_x, along_y = 2.0 * np.sin(np.pi * turn_x) / width, 2.0 * np.sin(np.pi * turn_y) / height
    squared = along_x[None, :] ** 2 + along_y[:, None] ** 2
    squared[0, 0] = 1.0
    factor = np.exp(-0.5 * blur**2 * squared) / squared
    factor[0, 0] = 0.0
    area = width * height
    of_cells = np.sinc(turn_x)[None, :] * np.sinc(turn_y)[:, None]
    difference = np.fft.rfft2(count) / of_cells**4 - np.fft.rfft2(target) / of_cells
    potential = np.fft.irfft2(difference * (-factor / area), grid.shape)
    flow_x = np.diff(np.concatenate([potential[:, -1:], potential, potential[:, :1]], axis=1), axis=1) / width
    flow_y = np.diff(np.concatenate([potential[-1:], potential, potential[:1]], axis=0), axis=0) / height
    pad = min(4, rows, columns)
    density = gaussian_blur(np.pad(target, pad, mode="wrap"), 1.0)[pad:-pad, pad:-pad] / area
    density = np.maximum(density, LEAST_DENSITY * density.mean())
    return flow_x.astype(np.float32), flow_y.astype(np.float32), density.astype(np.float32)


def displacement(folder: Path, grid: CoarseGrid, position: np.ndarray, most: float) -> np.ndarray:
    """How far a flow moves bodies [m], shape ``[n, 2]``.

    Args:
        folder: Where :func:`solve_flow`'s arrays lie, as ``x.npy``, ``y.npy`` and ``density.npy``; only what is needed is read.
        grid: Their grid.
        position: Of the bodies [m], shape ``[n, 2]``.
        most: No body is moved farther [m].
    """
    x, y = (position / grid.cell).T
    # Of what lies in the middles of cells, those on the other side of a domain that wraps are next to those at its edge.
    wraps = grid.periodic
    flow = np.stack(
        [
            _between(np.load(folder / "x.npy", mmap_mode="r"), x, y - 0.5, (False, wraps)),
            _between(np.load(folder / "y.npy", mmap_mode="r"), x - 0.5, y, (wraps, False)),
        ],
        axis=1,
    )
    density = _between(np.load(folder / "density.npy", mmap_mode="r"), x - 0.5, y - 0.5, (wraps, wraps))
    moved = flow / density[:, None]
    far = np.hypot(moved[:, 0], moved[:, 1])
    longest = np.minimum(LIMIT / np.sqrt(density), most)
    return moved * np.minimum(1.0, longest / np.maximum(far, 1e-300))[:, None]


def _between(values: np.ndarray, x: np.ndarray, y: np.ndarray, wraps: tuple[bool, bool]) -> np.ndarray:
    """Values of a grid between its points, linearly; beyond them those at its edges, or along axes that wrap on its other side."""
    rows, columns = values.shape
    if any(wraps):
        padded = np.pad(values, [(int(wraps[1]), int(wraps[1])), (int(wraps[0]), int(wraps[0]))], mode="wrap")
        return _between(padded, x + wraps[0], y + wraps[1], (False, False))
    x, y = np.clip(x, 0.0, columns - 1.0), np.clip(y, 0.0, rows - 1.0)
    left, low = np.minimum(x.astype(np.int64), columns - 1), np.minimum(y.astype(np.int64), rows - 1)
    right, high = np.minimum(left + 1, columns - 1), np.minimum(low + 1, rows - 1)
    # Only the part that is asked for, of an array that may lie in a file.
    top, bottom, first, last = int(low.min()), int(high.max()) + 1, int(left.min()), int(right.max()) + 1
    part = np.array(values[top:bottom, first:last], np.float64)
    a, b = x - left, y - low
    left, right, low, high = left - first, right - first, low - top, high - top
    lower = (1.0 - a) * part[low, left] + a * part[low, right]
    upper = (1.0 - a) * part[high, left] + a * part[high, right]
    return (1.0 - b) * lower + b * upper
