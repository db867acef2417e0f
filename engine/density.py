"""Target densities: from images to charge on mesh nodes, to evenly spread grids, and back to points.

An image is piecewise constant: every pixel is a rectangle of one density. All integrals below are exact for that, so the
resolutions of image, mesh and spacing need not match.
"""

from __future__ import annotations

import numpy as np

__all__ = ["box_integrals", "sample_density", "settle_on_full_pixels", "spline_deposit"]


def box_integrals(image: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Integrate an image over the cells of a grid that spans the same rectangle, bottom row first.

    Args:
        image: Density, shape ``[height, width]``, row 0 at the top.
        shape: Rows and columns of the grid.

    Returns:
        Share of the image's integral in every cell, shape ``shape``, float64, sum 1; row 0 at the bottom.
    """
    upright = np.asarray(image, dtype=np.float64)[::-1]
    result = _apply(_overlap_matrix(shape[0], upright.shape[0]), upright, _overlap_matrix(shape[1], upright.shape[1]))
    return result / result.sum()


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
    weights = []
    for nodes, pixels, length, step in zip(shape, upright.shape, size[::-1], spacing[::-1], strict=True):
        edges = np.linspace(0.0, length, pixels + 1) / step + margin
        weights.append(_spline_matrix(nodes, edges, periodic) * (step * pixels / length))
    result = _apply(weights[0], upright, weights[1])
    return result / result.sum()


def sample_density(image: np.ndarray, position: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """Value of the pixel under every position (shape ``[n, 2]``), for positions inside the domain of ``size``."""
    height, width = image.shape
    column = np.clip((position[:, 0] / size[0] * width).astype(np.int64), 0, width - 1)
    row = np.clip(((1.0 - position[:, 1] / size[1]) * height).astype(np.int64), 0, height - 1)
    return image[row, column]


def settle_on_full_pixels(image: np.ndarray, position: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """Return positions (shape ``[n, 2]``) of which those on zero density moved to the nearest pixel above zero nearby.

    They end just inside that pixel, so that rounding cannot put them out again. Of pixels beyond the eight neighbours the
    one whose centre is nearest is taken.
    """
    result = np.array(position, dtype=np.float64)
    height, width = image.shape
    pixel = np.array([size[0] / width, size[1] / height])
    full = np.argwhere(image > 0.0)
    low = np.stack([full[:, 1], height - 1 - full[:, 0]], axis=1) * pixel
    for body in np.flatnonzero(sample_density(image, result, size) <= 0.0):
        outside = np.abs(low + 0.5 * pixel - result[body]) / pixel
        near = np.flatnonzero((outside <= 1.51).all(axis=1))
        candidates = near if len(near) else np.array([np.argmin((outside * pixel).max(axis=1))])
        inside = np.clip(result[body], low[candidates] + 1e-3 * pixel, low[candidates] + (1.0 - 1e-3) * pixel)
        result[body] = inside[np.argmin(((inside - result[body]) ** 2).sum(axis=1))]
    return result


def _apply(rows: np.ndarray, image: np.ndarray, columns: np.ndarray) -> np.ndarray:
    return rows @ image @ columns.T


def _overlap_matrix(cells: int, pixels: int) -> np.ndarray:
    """Length of the overlap of every cell with every pixel, both dividing the unit interval; shape [cells, pixels]."""
    low = np.maximum(np.arange(cells)[:, None] / cells, np.arange(pixels) / pixels)
    high = np.minimum(np.arange(1, cells + 1)[:, None] / cells, np.arange(1, pixels + 1) / pixels)
    return np.maximum(high - low, 0.0) * pixels


def _spline_matrix(nodes: int, edges: np.ndarray, periodic: bool) -> np.ndarray:
    """Mean of every node's cubic B-spline over every pixel with these edges (in mesh units); shape [nodes, pixels]."""
    node = np.arange(-3, nodes + 3) if periodic else np.arange(nodes)
    integral = _spline_integral(edges[None, :] - node[:, None])
    weights = np.diff(integral, axis=1)
    if periodic:
        wrapped = np.zeros((nodes, weights.shape[1]))
        np.add.at(wrapped, node % nodes, weights)
        return wrapped
    return weights


def _spline_integral(x: np.ndarray) -> np.ndarray:
    """Integral of the cubic B-spline from minus infinity to ``x``: a sum of truncated fourth powers."""
    x = np.clip(x, -2.0, 2.0)
    total = np.zeros_like(x)
    for shift, factor in zip((-2.0, -1.0, 0.0, 1.0), (1.0, -4.0, 6.0, -4.0), strict=True):
        total += factor * np.maximum(x - shift, 0.0) ** 4
    return total / 24.0
