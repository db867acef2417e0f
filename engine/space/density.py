"""Target densities: from images to charge on mesh nodes, to evenly spread grids, and back to points.

An image is piecewise constant: every pixel is a rectangle of one density. All integrals below are exact for that, so the
resolutions of image, mesh and spacing need not match.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from .part import Part

__all__ = [
    "FOLD",
    "Band",
    "box_integrals",
    "move_into_support",
    "order_of_axes",
    "overlap_bands",
    "sample_density",
    "spline_bands",
    "spline_deposit",
]

# Nodes beyond either end of a periodic mesh that splines within it reach.
FOLD = 3
# Bands of the last few meshes and images are kept: scenes of a batch are alike. An edit needs a dozen, of which half stay the same.
MOST_KEPT = 32
# What is moved into a pixel ends at least so far inside it, and at most so much farther, over the pixel's size.
EDGE, DEEPEST = 1e-3, 1e-3
# Weights of the pixels that reach each cell or node along one axis: the first pixel (may lie outside), shape [cells], and
# the weights of it and the following ones, shape [cells, reach].
Band = tuple[np.ndarray, np.ndarray]


def box_integrals(image: np.ndarray, shape: tuple[int, int], part: Part | None = None) -> np.ndarray:
    """Integrate an image over the cells of a grid that spans the same rectangle, bottom row first.

    Args:
        image: Density, shape ``[height, width]``, row 0 at the top.
        shape: Rows and columns of the grid.
        part: What of the rectangle the grid spans instead; all pixels above zero are in it.

    Returns:
        Share of the image's integral in every cell, shape ``shape``, float64, sum 1; row 0 at the bottom.
    """
    upright = np.asarray(image, dtype=np.float64)[::-1]
    result = _apply(overlap_bands(upright.shape, shape, part), upright)
    return result / result.sum()


def overlap_bands(image_shape: tuple[int, ...], shape: tuple[int, int], part: Part | None) -> list[Band]:
    """Weights of an image's pixels in the cells of a grid along y and along x, bottom first; see :func:`box_integrals`."""
    if part is None:
        return [_overlap_band(cells, pixels) for cells, pixels in zip(shape, image_shape, strict=True)]
    return [
        _overlap_band_of_part(cells, pixels, low, high)
        for cells, pixels, low, high in zip(shape, image_shape, part.low[::-1], part.high[::-1], strict=True)
    ]


def spline_deposit(
    image: np.ndarray,
    size: tuple[float, float],
    shape: tuple[int, int],
    spacing: tuple[float, float],
    margin: int,
    periodic: bool,
) -> np.ndarray:
    """Deposit an image on mesh nodes with cubic B-splines, exactly as its charge would be if it were points.

    Args:
        image: Density, shape ``[height, width]``, row 0 at the top.
        size: Extent of the image along x and y.
        shape: Rows and columns of the mesh.
        spacing: Distance of its nodes along x and y.
        margin: Index of the node at the origin.
        periodic: Whether the mesh wraps.

    Returns:
        Share of the image's integral at every node, shape ``shape``, float64, sum 1; row 0 at the bottom.
    """
    upright = np.asarray(image, dtype=np.float64)[::-1]
    result = _apply(spline_bands(image.shape, size, shape, spacing, margin, periodic), upright)
    if periodic:
        for axis in (0, 1):
            result = _fold(np.moveaxis(result, axis, 0), FOLD)
            result = np.moveaxis(result, 0, axis)
    return result / result.sum()


def spline_bands(
    image_shape: tuple[int, ...],
    size: tuple[float, float],
    shape: tuple[int, int],
    spacing: tuple[float, float],
    margin: int,
    periodic: bool,
    origin: tuple[float, float] = (0.0, 0.0),
) -> list[Band]:
    """Weights of an image's pixels at the nodes along y and along x, bottom first; see :func:`spline_deposit`.

    A periodic mesh gets ``FOLD`` nodes more at either end, which are to be folded onto the nodes that they stand for. That of a part
    begins at the ``origin``.
    """
    fold = FOLD if periodic else 0
    return [
        _spline_band(-fold - margin, nodes + fold - margin, length / pixels / step, pixels, begin / step)
        for nodes, pixels, length, step, begin in zip(
            shape, image_shape, size[::-1], spacing[::-1], origin[::-1], strict=True
        )
    ]


def sample_density(image: np.ndarray, position: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """Value, or values, of the pixel under every position (shape ``[n, 2]``), for positions inside the domain of ``size``."""
    height, width = image.shape[:2]
    column = np.clip((position[:, 0] / size[0] * width).astype(np.int64), 0, width - 1)
    row = np.clip(((1.0 - position[:, 1] / size[1]) * height).astype(np.int64), 0, height - 1)
    return image[row, column]


def move_into_support(image: np.ndarray, position: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """Return positions (shape ``[n, 2]``) of which those on zero density moved to the nearest pixel above zero nearby.

    They end inside that pixel, so that rounding cannot put them out again; the farther they were away the deeper, so that no two end
    in one place that were in different ones.
    """
    result = np.array(position, dtype=np.float64)
    height, width = image.shape
    pixel = np.array([size[0] / width, size[1] / height])
    for body in np.flatnonzero(sample_density(image, result, size) <= 0.0):
        column, row = np.clip(np.floor(result[body] / pixel).astype(int), 0, (width - 1, height - 1))
        row = height - 1 - row
        # Ever more pixels around it; where there are some at last, a nearer one may still lie beside them.
        reach, near = 1, np.zeros((0, 2), int)
        while not len(near) and reach < 2 * max(height, width):
            found = reach
            reach *= 2
            top, left = max(row - found, 0), max(column - found, 0)
            near = np.argwhere(image[top : row + found + 1, left : column + found + 1] > 0.0) + (top, left)
        low = np.stack([near[:, 1], height - 1 - near[:, 0]], axis=1) * pixel
        below, above = np.maximum(low - result[body], 0.0) / pixel, np.maximum(result[body] - low - pixel, 0.0) / pixel
        first, last = (EDGE + DEEPEST * away / (1.0 + away) for away in (below, above))
        inside = np.clip(result[body], low + first * pixel, low + (1.0 - last) * pixel)
        result[body] = inside[np.argmin(((inside - result[body]) ** 2).sum(axis=1))]
    return result


def _apply(bands: list[Band], image: np.ndarray) -> np.ndarray:
    """Sum an image with one band per axis."""
    for axis in order_of_axes(image.shape, [len(first) for first, _ in bands]):
        first, weights = bands[axis]
        if _leaves_all(bands[axis], image.shape[axis]):
            continue
        given = np.ascontiguousarray(np.moveaxis(image, axis, 0))
        rows = np.zeros((len(first), given.shape[1]))
        # Where every pixel has so many cells to itself, nothing reaches into a second one.
        for k in np.flatnonzero(weights.any(axis=0)).tolist():
            rows += weights[:, k, None] * given[np.clip(first + k, 0, given.shape[0] - 1)]
        image = np.moveaxis(rows, 0, axis)
    return np.ascontiguousarray(image)


def _leaves_all(band: Band, pixels: int) -> bool:
    """Whether every cell is a pixel, as where an image is as fine as what it is summed on."""
    first, weights = band
    each = np.arange(pixels)
    return np.array_equal(first, each) and bool((weights[:, 0] == 1.0).all()) and not weights[:, 1:].any()


def order_of_axes(given: Sequence[int], made: Sequence[int]) -> tuple[int, int]:
    """Return along which axis an image is summed first: down its columns, unless along its rows leaves less than half as much.

    A single row of pixels may be very long.
    """
    return (0, 1) if made[0] * given[1] <= 2 * given[0] * made[1] else (1, 0)


def _fold(values: np.ndarray, fold: int) -> np.ndarray:
    """Add the first and last ``fold`` rows to those one period further on."""
    count = len(values) - 2 * fold
    result = values[fold:-fold].copy()
    result[np.arange(-fold, 0) % count] += values[:fold]
    result[np.arange(fold) % count] += values[-fold:]
    return result


@lru_cache(maxsize=MOST_KEPT)
def _overlap_band(cells: int, pixels: int) -> Band:
    """Overlap of every cell with its pixels, both dividing the same interval."""
    cell = np.arange(cells)[:, None]
    first = np.arange(cells) * pixels // cells
    pixel = first[:, None] + np.arange(-(-pixels // cells) + 1)
    low = np.maximum(cell / cells, pixel / pixels)
    high = np.minimum((cell + 1) / cells, (pixel + 1) / pixels)
    return _for_reading(first, np.where(pixel < pixels, np.maximum(high - low, 0.0) * pixels, 0.0))


@lru_cache(maxsize=MOST_KEPT)
def _overlap_band_of_part(cells: int, pixels: int, begin: float, end: float) -> Band:
    """The same for cells that divide only what is between two shares of the interval."""
    edge = begin + (end - begin) * np.arange(cells + 1) / cells
    first = np.floor(edge[:-1] * pixels).astype(np.int64)
    pixel = first[:, None] + np.arange(math.ceil((end - begin) * pixels / cells) + 2)
    low = np.maximum(edge[:-1, None], pixel / pixels)
    high = np.minimum(edge[1:, None], (pixel + 1) / pixels)
    return _for_reading(first, np.where(pixel < pixels, np.maximum(high - low, 0.0) * pixels, 0.0))


@lru_cache(maxsize=MOST_KEPT)
def _spline_band(begin: int, end: int, width: float, pixels: int, origin: float) -> Band:
    """Mean of the cubic B-spline at the nodes ``begin`` to ``end - 1``, from an origin on, over its pixels.

    These are ``width`` wide and begin at 0.
    """
    node = np.arange(begin, end) + origin
    first = np.floor((node - 2.0) / width).astype(np.int64)
    pixel = first[:, None] + np.arange(int(np.ceil(4.0 / width)) + 2)
    weights = _spline_integral((pixel + 1) * width - node[:, None]) - _spline_integral(pixel * width - node[:, None])
    return _for_reading(first, np.where((pixel >= 0) & (pixel < pixels), weights / width, 0.0))


def _for_reading(first: np.ndarray, weights: np.ndarray) -> Band:
    """A band that may be kept: nobody can change it."""
    first.setflags(write=False)
    weights.setflags(write=False)
    return first, weights


def _spline_integral(x: np.ndarray) -> np.ndarray:
    """Integral of the cubic B-spline from minus infinity to ``x``: a sum of truncated fourth powers."""
    x = np.clip(x, -2.0, 2.0)
    total = np.zeros_like(x)
    for shift, factor in zip((-2.0, -1.0, 0.0, 1.0), (1.0, -4.0, 6.0, -4.0), strict=True):
        # NumPy takes ten times as long for a fourth power.
        square = np.maximum(x - shift, 0.0) ** 2
        total += factor * (square * square)
    return total / 24.0
