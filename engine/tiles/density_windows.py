"""What a class's density is in a part of the domain, on pixels fine enough for the bodies there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

__all__ = ["ArraySource", "Axis", "Source", "WrappedSource", "into_pixels", "sample_source", "units_along", "wrapped"]

# Cuts between tiles lie between pixels of the finest density, which is divided until a tile has so many.
FEWEST_UNITS = 16
# Of pixels so many times finer than asked for means are taken.
MOST_DETAIL = 4
# Pixels that are read at once.
PIXELS_AT_ONCE = 2**21


class Source(Protocol):
    """An image of which parts can be read, row 0 at the top."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""

    def read(self, top: int, bottom: int, left: int, right: int) -> np.ndarray:
        """Values of rows and columns, float32, shape ``[bottom - top, right - left]``."""


@dataclass(frozen=True, eq=False)
class ArraySource:
    """An image in memory."""

    image: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.image.shape[0], self.image.shape[1]

    def read(self, top: int, bottom: int, left: int, right: int) -> np.ndarray:
        """Values of rows and columns, float32, shape ``[bottom - top, right - left]``."""
        return self.image[top:bottom, left:right]


@dataclass(frozen=True, eq=False)
class WrappedSource:
    """An image that repeats itself: rows and columns beyond its ends are those of its other side."""

    source: Source

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the image itself."""
        return self.source.shape

    def read(self, top: int, bottom: int, left: int, right: int) -> np.ndarray:
        """The same, wherever they are."""
        rows, columns = self.source.shape
        strips = [
            np.concatenate([self.source.read(a, b, c, d) for c, d in wrapped(left, right, columns)], axis=1)
            for a, b in wrapped(top, bottom, rows)
        ]
        return np.concatenate(strips, axis=0)


def wrapped(begin: int, end: int, count: int) -> list[tuple[int, int]]:
    """Return the parts of a repeated axis of ``count`` pixels that make up ``begin`` to ``end - 1``."""
    result = []
    while begin < end:
        first = begin % count
        last = min(count, first + end - begin)
        result.append((first, last))
        begin += last - first
    return result


@dataclass(frozen=True)
class Axis:
    """A part of the domain along one axis: from unit ``begin`` to unit ``end`` of ``units``, counted as an image's pixels are."""

    begin: int
    end: int
    units: int


def units_along(pixels: list[int], tiles: int) -> int:
    """Units that an axis is divided into, between which cuts may lie: pixels of the finest density, or parts of them."""
    units = max(pixels)
    return units * max(1, math.ceil(FEWEST_UNITS * tiles / units))


def sample_source(source: Source, down: Axis, across: Axis, wanted: tuple[int, int]) -> np.ndarray:
    """Return a part of an image, shape ``[rows, columns]``, float32, of about as many as ``wanted`` or more.

    Where cuts lie between its pixels, every pixel of the result lies in one pixel of the image. Of much finer images means are taken.
    """
    rows, columns = (
        _sampling(axis, pixels, least) for axis, pixels, least in zip((down, across), source.shape, wanted, strict=True)
    )
    parts = []
    # Strips of whole rows of the result.
    step = max(1, int(PIXELS_AT_ONCE / max(columns.last - columns.first, 1) / max(rows.per_result, 1.0)))
    for begin in range(0, rows.count, step):
        strip = rows.part(begin, min(begin + step, rows.count))
        values = source.read(strip.first, strip.last, columns.first, columns.last)
        parts.append(columns.apply(strip.apply(values, 0), 1))
    return np.ascontiguousarray(np.concatenate(parts), dtype=np.float32)


def into_pixels(source: Source, down: Axis, across: Axis, wanted: tuple[int, int], place: np.ndarray) -> np.ndarray:
    """Bring places of which :func:`sample_source` took means for true onto pixels that are above 0.

    Args:
        source: The image.
        down: The part, as there.
        across: As well.
        wanted: As well.
        place: Places from the image's left and top, in pixels, shape ``[n, 2]``, in the part.

    Returns:
        The same, of which those on pixels of 0 are in the nearest one above that is nearby, if there is one.
    """
    rows, columns = (
        _sampling(axis, pixels, least) for axis, pixels, least in zip((down, across), source.shape, wanted, strict=True)
    )
    if rows.edge is None and columns.edge is None:
        return place
    result = place.copy()
    wraps = isinstance(source, WrappedSource)
    at = np.floor(place).astype(np.int64)
    if not wraps:
        at = np.minimum(at, [source.shape[1] - 1, source.shape[0] - 1])
    reach = np.ceil([2.0 * columns.per_result, 2.0 * rows.per_result]).astype(np.int64)
    step = max(1, PIXELS_AT_ONCE // max(columns.last - columns.first, 1))
    for top in range(rows.first, rows.last, step):
        own = np.flatnonzero((at[:, 1] >= top) & (at[:, 1] < top + step))
        if not len(own):
            continue
        values = source.read(top, min(top + step, rows.last), columns.first, columns.last)
        inside = (at[own, 0] >= columns.first) & (at[own, 0] < columns.last)
        own = own[inside]
        empty = own[values[at[own, 1] - top, at[own, 0] - columns.first] <= 0.0]
        for body in empty.tolist():
            low, high = at[body] - reach, at[body] + reach + 1
            if not wraps:
                low, high = np.maximum(low, 0), np.minimum(high, source.shape[::-1])
            near = np.argwhere(source.read(low[1], high[1], low[0], high[0]) > 0.0)[:, ::-1] + low
            if len(near):
                within = np.clip(place[body], near + 1e-3, near + (1.0 - 1e-3))
                result[body] = within[np.argmin(((within - place[body]) ** 2).sum(axis=1))]
    return result


@dataclass(frozen=True, eq=False)
class _Sampling:
    """Pixels ``first`` to ``last - 1`` of an axis, and which of them make every pixel of the result.

    Attributes:
        index: Which one it is, where each is one of them.
        edge: Where the pixels of each begin, and where they end, where means are taken; both counted from ``first``.
    """

    first: int
    last: int
    index: np.ndarray | None
    edge: np.ndarray | None

    @property
    def count(self) -> int:
        """Pixels of the result."""
        if self.index is not None:
            return len(self.index)
        assert self.edge is not None
        return len(self.edge) - 1

    @property
    def per_result(self) -> float:
        """Pixels over those of the result."""
        return (self.last - self.first) / self.count

    def part(self, begin: int, end: int) -> _Sampling:
        """Only some pixels of the result."""
        if self.index is not None:
            index = self.index[begin:end]
            low = int(index[0])
            return _Sampling(self.first + low, self.first + int(index[-1]) + 1, index - low, None)
        assert self.edge is not None
        edge = self.edge[begin : end + 1]
        return _Sampling(self.first + int(edge[0]), self.first + int(edge[-1]), None, edge - edge[0])

    def apply(self, values: np.ndarray, axis: int) -> np.ndarray:
        """The result, of the pixels that were read."""
        if self.index is not None:
            return np.take(values, self.index, axis=axis)
        assert self.edge is not None
        sums = np.add.reduceat(values.astype(np.float64), self.edge[:-1], axis=axis)
        shape = [1, 1]
        shape[axis] = -1
        return sums / np.diff(self.edge).reshape(shape)


def _sampling(axis: Axis, pixels: int, wanted: int) -> _Sampling:
    begin, end, units = axis.begin, axis.end, axis.units
    span = (end - begin) * pixels / units
    if span > MOST_DETAIL * wanted:
        first, last = begin * pixels // units, -(-end * pixels // units)
        edge = np.round(np.linspace(0, last - first, 2 * wanted + 1)).astype(np.int64)
        return _Sampling(first, last, None, edge)
    # Whole units, so that borders between pixels stay where they are; unless that would be far more than is asked for.
    count = (end - begin) * max(1, -(-wanted // (end - begin)))
    if count > MOST_DETAIL * max(wanted, span):
        count = 2 * max(wanted, math.ceil(span))
    place = 2 * count * begin + (2 * np.arange(count, dtype=np.int64) + 1) * (end - begin)
    index = place * pixels // (2 * count * units)
    first = int(index[0])
    return _Sampling(first, int(index[-1]) + 1, index - first, None)
