"""How far the ground is from obstacles, on pixels a fraction of the bodies' spacing wide.

What attracts bodies ends smoothly within a pixel of an obstacle's edge, and so holds as much as is asked beside it. Where bodies may
be ends before that pixel: no body ever stands on an obstacle.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Sequence
from itertools import pairwise
from weakref import WeakKeyDictionary

import numpy as np

from .domain import Domain
from .obstacles import Obstacle

__all__ = ["clearance", "distance_to", "mask_shape"]

# Pixels over the mean spacing of bodies, and along the longer side of the domain at least and at most.
PIXELS_PER_SPACING = 5.0
FEWEST_PIXELS = 384
MOST_PIXELS = 4096
# Rows of an image that are looked at together.
ROWS = 32
# Images of distances that are kept of an obstacle: one problem asks for two, and other counts may ask for other numbers of pixels.
MOST_KNOWN = 3
# Edges times pixels of a polygon that are looked at together.
MOST_AT_ONCE = 1 << 18


def mask_shape(obstacles: Sequence[Obstacle], domain: Domain, shape: tuple[int, int], count: int) -> tuple[int, int]:
    """Pixels for a density of ``shape`` that obstacles are cut out of: each of its own is divided into whole ones.

    Args:
        obstacles: The obstacles.
        domain: Where.
        shape: Height and width of the density's image.
        count: Bodies that are to follow it.
    """
    longer = max(domain.size)
    wanted = PIXELS_PER_SPACING * longer / math.sqrt(domain.area / max(count, 1))
    pixel = longer / min(max(wanted, FEWEST_PIXELS), MOST_PIXELS)
    result = []
    for axis, (pixels, length) in enumerate(zip(shape, domain.size[::-1], strict=True)):
        of_images = [obstacle.image.shape[axis] for obstacle in obstacles if obstacle.image is not None]
        fine = max([math.ceil(length / pixel), *(min(n, MOST_PIXELS) for n in of_images)])
        result.append(pixels * math.ceil(fine / pixels))
    return result[0], result[1]


def clearance(obstacles: Sequence[Obstacle], domain: Domain, shape: tuple[int, int], reach: float) -> np.ndarray:
    """How far every pixel's center is from the nearest obstacle with its margin [m].

    Args:
        obstacles: The obstacles.
        domain: Where; obstacles in a periodic one go on at the other side.
        shape: Rows and columns of pixels over the domain, row 0 at the top.
        reach: Nobody asks for more than this [m].

    Returns:
        Shape ``shape``, float32: below 0 within an obstacle or its margin, and at most ``reach``.
    """
    result = np.full(shape, reach, np.float32)
    for obstacle in obstacles:
        if obstacle.image is not None:
            np.minimum(
                result,
                _from_image(obstacle, domain, shape, reach + obstacle.margin) - np.float32(obstacle.margin),
                out=result,
            )
            continue
        for shift in _shifts(domain):
            _cut_shape(result, obstacle, shift, domain, reach)
    return result


def distance_to(
    mask: np.ndarray, pixel: tuple[float, float], reach: float, periodic: bool, *, squares: bool = False
) -> np.ndarray:
    """Distance of every pixel's center from that of the nearest one in ``mask``, exact up to ``reach``, which is the most.

    Args:
        mask: Shape ``[height, width]``, bool.
        pixel: Width and height of a pixel.
        reach: Largest distance of interest.
        periodic: Whether the image wraps.
        squares: Whether it is the distance from the nearest pixel as a whole, which is 0 in it.
    """
    half = 0.5 if squares else 0.0
    rows, columns = (min(math.ceil(reach / side), n) for side, n in zip(pixel[::-1], mask.shape, strict=True))
    large = np.float32(np.float32(2.0 * reach + 1.0) ** 2)
    # First up and down, then across: the square of the distance is a sum.
    padded = np.pad(mask, ((rows, rows), (0, 0)), mode="wrap") if periodic else mask
    steps = _steps_to(padded, rows + 1)
    if periodic:
        steps = steps[rows : rows + mask.shape[0]]
    up = np.maximum(np.arange(rows + 1) - half, 0.0) * pixel[1]
    squared = np.append((up**2).astype(np.float32), large)[steps]
    across = (np.maximum(np.arange(columns + 1) - half, 0.0) * pixel[0]) ** 2
    # A few rows at a time, which stay in the processor's cache.
    for first in range(0, len(squared), ROWS):
        nearest = squared[first : first + ROWS]
        known = (nearest < large).any(axis=0)
        if not known.any():
            continue
        beside = ((0, 0), (columns, columns))
        wide = np.pad(nearest, beside, mode="wrap") if periodic else np.pad(nearest, beside, constant_values=large)
        for begin, end in _runs(np.pad(known, columns, mode="wrap" if periodic else "constant"), columns):
            for step in range(-columns, columns + 1):
                there = wide[:, columns + begin + step : columns + end + step]
                np.minimum(nearest[:, begin:end], there + np.float32(across[abs(step)]), out=nearest[:, begin:end])
    return np.minimum(np.sqrt(squared, out=squared), np.float32(reach), out=squared)


def _runs(known: np.ndarray, columns: int) -> list[tuple[int, int]]:
    """First and last columns, and the one behind these, of all that are no farther than so many from a known one.

    ``known`` has as many more on either side, which are those of copies, or unknown.
    """
    at = np.flatnonzero(known) - columns
    begin, end = np.maximum(at - columns, 0), np.minimum(at + columns + 1, len(known) - 2 * columns)
    parted = np.flatnonzero(begin[1:] > end[:-1])
    first, last = begin[np.concatenate([[0], parted + 1])], end[np.concatenate([parted, [len(at) - 1]])]
    return list(zip(first.tolist(), last.tolist(), strict=True))


def _steps_to(mask: np.ndarray, most: int) -> np.ndarray:
    """How many rows away the nearest pixel in ``mask`` of the same column is, and ``most`` where that is more, or there is none."""
    steps = np.where(mask, np.int16(0), np.int16(most))
    # Down, and up again: a row at a time, which is fifteen times as fast as what NumPy accumulates.
    for rows in (steps, steps[::-1]):
        for before, row in pairwise(rows):
            np.minimum(row, before + np.int16(1), out=row)
    return steps


def _shifts(domain: Domain) -> Iterator[tuple[float, float]]:
    copies = (-1, 0, 1) if domain.periodic else (0,)
    for row in copies:
        for column in copies:
            yield column * domain.size[0], row * domain.size[1]


def _window(
    low: np.ndarray, high: np.ndarray, domain: Domain, shape: tuple[int, int]
) -> tuple[slice, slice, np.ndarray, np.ndarray]:
    """Pixels that a box comes upon: rows and columns, x of the columns' centers and y of the rows'."""
    height, width = shape
    pixel_x, pixel_y = domain.size[0] / width, domain.size[1] / height
    left, right = np.clip([math.floor(low[0] / pixel_x), math.ceil(high[0] / pixel_x)], 0, width)
    bottom, top = np.clip([math.floor(low[1] / pixel_y), math.ceil(high[1] / pixel_y)], 0, height)
    rows, columns = slice(height - top, height - bottom), slice(left, right)
    x = (np.arange(left, right) + 0.5) * pixel_x
    y = domain.size[1] - (np.arange(height - top, height - bottom) + 0.5) * pixel_y
    return rows, columns, x.astype(np.float64), y.astype(np.float64)


def _cut_shape(
    result: np.ndarray, obstacle: Obstacle, shift: tuple[float, float], domain: Domain, reach: float
) -> None:
    """Bring the distance from a polygon or a disc, moved by ``shift``, into ``result``."""
    shape = (result.shape[0], result.shape[1])
    most = reach + obstacle.margin
    if obstacle.disc is not None:
        x, y, radius = obstacle.disc
        center = np.array([x, y]) + shift
        rows, columns, xs, ys = _window(center - radius - most, center + radius + most, domain, shape)
        away = np.hypot(xs - center[0], (ys - center[1])[:, None]) - radius - obstacle.margin
        np.minimum(result[rows, columns], away, out=result[rows, columns], casting="same_kind")
        return
    corners = np.asarray(obstacle.polygon) + shift
    rows, columns, xs, ys = _window(corners.min(0) - most, corners.max(0) + most, domain, shape)
    if not (len(xs) and len(ys)):
        return
    near = _all_edges if len(corners) * len(ys) * len(xs) <= MOST_AT_ONCE else _edge_by_edge
    away, inside = near(corners, xs, ys, most)
    np.sqrt(away, out=away)
    np.negative(away, out=away, where=inside)
    away -= obstacle.margin
    np.minimum(result[rows, columns], away, out=result[rows, columns], casting="same_kind")


def _all_edges(corners: np.ndarray, xs: np.ndarray, ys: np.ndarray, most: float) -> tuple[np.ndarray, np.ndarray]:
    """Squared distance of pixels from the nearest edge of a polygon, ``most`` squared at most, and whether they are inside.

    Args:
        corners: Of the polygon, shape ``[k, 2]``.
        xs: Of the columns' centers, shape ``[w]``.
        ys: Of the rows' centers, falling, shape ``[h]``.
        most: Distance beyond which nobody asks.

    Returns:
        Both of shape ``[h, w]``.
    """
    start, end = corners[:, :, None, None], np.roll(corners, -1, axis=0)[:, :, None, None]
    edge = end - start
    dx, dy = xs - start[:, 0], ys[:, None] - start[:, 1]
    along = np.clip((dx * edge[:, 0] + dy * edge[:, 1]) / np.maximum((edge**2).sum(axis=1), 1e-300), 0.0, 1.0)
    squared = ((dx - along * edge[:, 0]) ** 2 + (dy - along * edge[:, 1]) ** 2).min(axis=0)
    rises = np.where(edge[:, 1] == 0.0, 1.0, edge[:, 1])
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    crossed = (ys[:, None] >= low) & (ys[:, None] < high)
    left = xs < start[:, 0] + dy * edge[:, 0] / rises
    return np.minimum(squared, most**2), np.logical_xor.reduce(crossed & left, axis=0)


def _edge_by_edge(corners: np.ndarray, xs: np.ndarray, ys: np.ndarray, most: float) -> tuple[np.ndarray, np.ndarray]:
    """The same where there are many pixels: of each edge only those near it are looked at."""
    inside = np.zeros((len(ys), len(xs)), bool)
    away = np.full(inside.shape, most**2)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        # The pixels near this edge.
        low, high = np.minimum(a, b) - most, np.maximum(a, b) + most
        i = slice(*np.searchsorted(xs, [low[0], high[0]]))
        j = slice(*(len(ys) - np.searchsorted(ys[::-1], [high[1], low[1]])))
        edge = b - a
        dx, dy = xs[i] - a[0], (ys[j] - a[1])[:, None]
        along = np.clip((dx * edge[0] + dy * edge[1]) / max(float(edge @ edge), 1e-300), 0.0, 1.0)
        squared = (dx - along * edge[0]) ** 2 + (dy - along * edge[1]) ** 2
        np.minimum(away[j, i], squared, out=away[j, i])
        crossed = np.flatnonzero((ys >= min(a[1], b[1])) & (ys < max(a[1], b[1])))
        if len(crossed):
            crossing = a[0] + (ys[crossed] - a[1]) * edge[0] / edge[1]
            inside[crossed] ^= xs < crossing[:, None]
    return away, inside


# How far pixels are from images of obstacles, and up to which reach that is known, by domain and number of pixels: a problem asks more
# than once, and another one after an edit asks the same.
_distances: WeakKeyDictionary[Obstacle, dict[Hashable, tuple[float, np.ndarray]]] = WeakKeyDictionary()


def _from_image(obstacle: Obstacle, domain: Domain, shape: tuple[int, int], reach: float) -> np.ndarray:
    """Distance of every pixel's center from the edge of an image's obstacles, below 0 within them; right up to ``reach`` at least.

    It is kept as long as the obstacle is, and so nobody may write it.
    """
    assert obstacle.image is not None
    pixel = (domain.size[0] / shape[1], domain.size[1] / shape[0])
    reach += max(pixel)
    known = _distances.setdefault(obstacle, {})
    key = domain.size, domain.periodic, shape
    if key not in known or known[key][0] < reach:
        mask = np.ascontiguousarray(_any_of(_any_of(obstacle.image, shape[0]).T, shape[1]).T)
        away = distance_to(mask, pixel, reach, domain.periodic, squares=True)
        # Within them nobody asks how far: half a pixel on their edge, more than that elsewhere.
        away[mask] = np.float32(-min(pixel))
        known.pop(key, None)
        known[key] = reach, away
        if len(known) > MOST_KNOWN:
            known.pop(next(iter(known)))
    return known[key][1]


def _any_of(image: np.ndarray, rows: int) -> np.ndarray:
    """An image of so many rows, bool: where any part of a row is set."""
    own = len(image)
    if rows == own:
        return image
    if rows % own == 0:
        return np.repeat(image, rows // own, axis=0)
    begin = np.arange(rows) * own // rows
    end = -(-(np.arange(rows) + 1) * own // rows)
    before = np.zeros((own + 1, *image.shape[1:]), np.int32)
    np.cumsum(image, axis=0, out=before[1:])
    return before[end] > before[begin]
