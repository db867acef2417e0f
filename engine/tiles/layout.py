"""Where tiles and windows lie: the cuts of every pass, and the order of the tiles along a Hilbert curve."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..space.hilbert_curve import along_hilbert_curve
from .density_windows import Axis

__all__ = ["Box", "Layout", "hilbert_order", "within"]


@dataclass(frozen=True)
class Box:
    """A part of the domain.

    Attributes:
        across: Units along x.
        up: Units along y.
        low: Lower left corner [m].
        high: Upper right corner [m].
        cut: Whether the left, right, lower and upper sides are cuts, rather than edges of the domain.
        period: Extent of a periodic domain [m], beyond whose upper right edges a part may reach; None of one that ends.
        rim: How far within the four sides the cuts of a window lie that is seen with its surroundings [m]: see :meth:`.Layout.around`.
    """

    across: Axis
    up: Axis
    low: tuple[float, float]
    high: tuple[float, float]
    cut: tuple[bool, bool, bool, bool]
    period: tuple[float, float] | None = None
    rim: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def framed(self, position: np.ndarray) -> np.ndarray:
        """Positions in a periodic domain [m], shape ``[n, 2]``, where this part sees them: from its lower left corner on."""
        if self.period is None:
            return position
        # Those that lie here as they are stay as they are, to the last bit.
        return np.where(position < self.low, position + self.period, position)

    @property
    def size(self) -> tuple[float, float]:
        """Extent along x and y [m]."""
        return self.high[0] - self.low[0], self.high[1] - self.low[1]

    @property
    def down(self) -> Axis:
        """Units along y, counted from the top as rows of images are."""
        return Axis(self.up.units - self.up.end, self.up.units - self.up.begin, self.up.units)

    def holds(self, position: np.ndarray) -> np.ndarray:
        """Which positions [m], shape ``[n, 2]``, are this part's: those on a cut belong to the part beyond."""
        x, y = position.T
        inside = (x >= self.low[0]) & (y >= self.low[1])
        inside &= (x < self.high[0]) if self.cut[1] else (x <= self.high[0])
        return inside & ((y < self.high[1]) if self.cut[3] else (y <= self.high[1]))

    def confine(self, position: np.ndarray) -> np.ndarray:
        """Positions [m], shape ``[n, 2]``, of which those outside are brought to the nearest place that :meth:`holds` them."""
        high = [np.nextafter(self.high[k], self.low[k]) if self.cut[2 * k + 1] else self.high[k] for k in (0, 1)]
        return within(position, self.low, high)

    def depth(self, position: np.ndarray) -> np.ndarray:
        """Distance to the nearest cut [m], shape ``[n]``, below 0 in the rim beyond it; infinite where there is none."""
        result = np.full(len(position), np.inf)
        for axis in (0, 1):
            if self.cut[2 * axis]:
                np.minimum(result, position[:, axis] - (self.low[axis] + self.rim[2 * axis]), out=result)
            if self.cut[2 * axis + 1]:
                np.minimum(result, self.high[axis] - self.rim[2 * axis + 1] - position[:, axis], out=result)
        return result

    def inside(self, depth: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """Lower left and upper right corner [m], from those of this part, of what is at least so far from all cuts."""
        left, right, below, above = (depth + rim if cut else 0.0 for cut, rim in zip(self.cut, self.rim, strict=True))
        return (left, below), (self.size[0] - right, self.size[1] - above)

    def fade(self, x: np.ndarray, y: np.ndarray, taper: float) -> np.ndarray:
        """How much counts at a place: 1, and within ``taper`` [m] of sides with cuts less, down to 0 on these; broadcast over x, y."""
        along = []
        for axis, place in enumerate((x, y)):
            one = np.ones(place.shape)
            if self.cut[2 * axis]:
                one *= _smooth((place - self.low[axis]) / taper)
            if self.cut[2 * axis + 1]:
                one *= _smooth((self.high[axis] - place) / taper)
            along.append(one)
        return along[0] * along[1]


@dataclass(frozen=True)
class Layout:
    """Tiles over a domain.

    Attributes:
        size: Extent of the domain along x and y [m].
        tiles: Columns and rows of tiles.
        units: Units along x and y; cuts lie between units.
        periodic: Whether the domain wraps; it then has one tile, or several along both axes.
    """

    size: tuple[float, float]
    tiles: tuple[int, int]
    units: tuple[int, int]
    periodic: bool = False

    def in_domain(self, position: np.ndarray) -> np.ndarray:
        """Positions [m], shape ``[n, 2]``, that a part may have seen beyond the edges of a periodic domain, inside it."""
        if not self.periodic:
            return position
        size = np.array(self.size)
        wrapped = np.where(position >= size, position - size, np.where(position < 0.0, position + size, position))
        # What is below 0 by less than a rounding ends on the far edge.
        return np.where(wrapped >= size, 0.0, wrapped)

    def cuts(self, axis: int, shift: float) -> np.ndarray:
        """Units at which windows that are shifted by a share of a tile begin, and the last one ends, int64, ascending."""
        tiles, units = self.tiles[axis], self.units[axis]
        if tiles == 1:
            return np.array([0, units])
        if self.periodic:
            begin = np.floor((np.arange(tiles) + shift) * units / tiles + 0.5).astype(np.int64)
            return np.append(begin, begin[0] + units)
        inner = np.arange(0 if shift else 1, tiles)
        between = np.floor((inner + shift) * units / tiles + 0.5).astype(np.int64)
        return np.unique(np.concatenate([[0], between, [units]]))

    def shape(self, shift: tuple[float, float]) -> tuple[int, int]:
        """Columns and rows of windows."""
        return len(self.cuts(0, shift[0])) - 1, len(self.cuts(1, shift[1])) - 1

    def box(self, shift: tuple[float, float], number: int) -> Box:
        """A window, counted row by row from the lower left."""
        columns, _ = self.shape(shift)
        axes, cut = [], []
        for axis, place in ((0, number % columns), (1, number // columns)):
            edges = self.cuts(axis, shift[axis])
            begin, end = int(edges[place]), int(edges[place + 1])
            axes.append(Axis(begin, end, self.units[axis]))
            wraps = self.periodic and self.tiles[axis] > 1
            cut += [wraps or begin > 0, wraps or end < self.units[axis]]
        low, high = (
            tuple(self.size[k] * unit / self.units[k] for k, unit in enumerate(ends))
            for ends in ((axes[0].begin, axes[1].begin), (axes[0].end, axes[1].end))
        )
        period = self.size if self.periodic else None
        return Box(axes[0], axes[1], (low[0], low[1]), (high[0], high[1]), (cut[0], cut[1], cut[2], cut[3]), period)

    def around(self, box: Box, reach: float) -> Box:
        """A window with what lies beyond its cuts, as far as ``reach`` [m] or a little more, or as far as the domain goes.

        Args:
            box: The window.
            reach: How far [m]; 0 returns the window itself.
        """
        if reach == 0.0:
            return box
        axes, rim = [], []
        for axis, along in enumerate((box.across, box.up)):
            units = self.units[axis]
            more = math.ceil(reach / self.size[axis] * units)
            before, after = (more if box.cut[2 * axis + k] else 0 for k in (0, 1))
            begin, end = along.begin - before, along.end + after
            if box.period is None:
                begin, end = max(begin, 0), min(end, units)
            rim += [(beyond * self.size[axis]) / units for beyond in (along.begin - begin, end - along.end)]
            if begin < 0:
                # Parts of a domain that wraps begin within it.
                begin, end = begin + units, end + units
            axes.append(Axis(begin, end, units))
        low, high = (
            tuple(self.size[k] * unit / self.units[k] for k, unit in enumerate(ends))
            for ends in ((axes[0].begin, axes[1].begin), (axes[0].end, axes[1].end))
        )
        whole = (rim[0], rim[1], rim[2], rim[3])
        return Box(axes[0], axes[1], (low[0], low[1]), (high[0], high[1]), box.cut, box.period, whole)

    def near(self, shift: tuple[float, float], box: Box, reach: float) -> Iterator[int]:
        """Numbers of the windows that a box comes upon, or comes nearer to than ``reach`` [m]."""
        columns, _ = self.shape(shift)
        ranges = []
        for axis in (0, 1):
            edges = self.cuts(axis, shift[axis]) * (self.size[axis] / self.units[axis])
            if self.periodic:
                around = np.arange(-1, 2)[:, None] * self.size[axis]
                begin, end = edges[:-1] + around, edges[1:] + around
                meets = (begin < box.high[axis] + reach) & (end > box.low[axis] - reach)
                ranges.append(np.flatnonzero(meets.any(axis=0)).tolist())
                continue
            first = int(np.searchsorted(edges, box.low[axis] - reach, side="right")) - 1
            last = int(np.searchsorted(edges, box.high[axis] + reach, side="left"))
            ranges.append(list(range(max(first, 0), min(last, len(edges) - 1))))
        for row in ranges[1]:
            for column in ranges[0]:
                yield row * columns + column


def within(position: np.ndarray, low: Sequence[float], high: Sequence[float]) -> np.ndarray:
    """Positions, shape ``[n, 2]``, brought between two corners; axis by axis, which takes NumPy a fraction of the time."""
    result = np.empty_like(position)
    for axis in (0, 1):
        np.clip(position[:, axis], low[axis], high[axis], out=result[:, axis])
    return result


def hilbert_order(columns: int, rows: int) -> np.ndarray:
    """Numbers of tiles, counted row by row, in the order of a Hilbert curve through them, shape ``[columns * rows]``."""
    number = np.arange(columns * rows)
    return np.argsort(along_hilbert_curve(number % columns, number // columns), kind="stable")


def _smooth(share: np.ndarray) -> np.ndarray:
    """From 0 to 1 with two derivatives that are 0 at both ends."""
    t = np.clip(share, 0.0, 1.0)
    return t * t * t * (t * (6.0 * t - 15.0) + 10.0)
