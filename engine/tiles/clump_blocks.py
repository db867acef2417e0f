"""Clumps of a huge domain: what densities are multiplied by, block by block.

One solve makes them of noise over the whole domain; see :mod:`~esh.engine.problem.clumps`. Here the noise of every pixel follows from
where it is, and a block is made with what is beside it, far enough for it to fit to the blocks around. So blocks, which have nothing
to do with tiles, can be made by anybody in any order.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..problem.clumps import PIXELS_PER_CLUMP, WAVELENGTH, clump_factor, waves_of_noise
from ..problem.clumps_at_large import Grid, as_dense_at_large
from ..problem.random_numbers import random_shares
from .bodies import written_atomically
from .density_windows import Axis, Source, WrappedSource, sample_source, wrapped

__all__ = ["ClumpedSource", "Clumps", "write_block"]

# Pixels along a side of a block, and of what is made beside it and thrown away: eight wavelengths. Two neighbors then differ by three
# hundredths of the mean along the edge between them, of a density that differs by as much as its mean from clump to gap.
BLOCK, BESIDE = 512, 128


@dataclass(frozen=True)
class Clumps:
    """Those of one class.

    Attributes:
        size: Diameter of a clump [m].
        clustering: How strong they are.
        extent: Of the domain along x and y [m].
        wraps: Whether it is periodic.
        seed: From which the noise follows.
        share: See :func:`~.clumps.share_at_large`.
        pushed_out: See :func:`~.clumps_at_large.as_dense_at_large`.
        folder: Where the blocks are.
    """

    size: float
    clustering: float
    extent: tuple[float, float]
    wraps: bool
    seed: tuple[int, ...]
    share: float
    pushed_out: float
    folder: Path

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of pixels over the whole domain."""
        rows, columns = (max(4, math.ceil(PIXELS_PER_CLUMP * length / self.size)) for length in self.extent[::-1])
        return rows, columns

    @property
    def blocks(self) -> tuple[int, int]:
        """Rows and columns of blocks."""
        rows, columns = (max(1, round(pixels / BLOCK)) for pixels in self.shape)
        return rows, columns

    def path(self, number: int) -> Path:
        """The file of a block, counted row by row from the top left."""
        return self.folder / f"{number:07d}.npy"

    def values(self, top: int, bottom: int, left: int, right: int) -> np.ndarray:
        """Factors at pixels of the whole domain, float64, shape ``[bottom - top, right - left]``, also beyond one that wraps."""
        spans = [(top, bottom, self.shape[0]), (left, right, self.shape[1])]
        parts = [wrapped(begin, end, count) if self.wraps else [(begin, end)] for begin, end, count in spans]
        strips = [np.concatenate([self._inside(a, b, c, d) for c, d in parts[1]], axis=1) for a, b in parts[0]]
        return np.concatenate(strips, axis=0)

    def _inside(self, top: int, bottom: int, left: int, right: int) -> np.ndarray:
        result = np.empty((bottom - top, right - left))
        for i, (first, rows) in self._meeting(0, top, bottom):
            for j, (begin, columns) in self._meeting(1, left, right):
                block = np.load(self.path(i * self.blocks[1] + j), mmap_mode="r", allow_pickle=False)
                low, high = max(top, first), min(bottom, rows)
                near, far = max(left, begin), min(right, columns)
                part = block[low - first : high - first, near - begin : far - begin]
                result[low - top : high - top, near - left : far - left] = part
        return result

    def edges(self, axis: int, number: int) -> tuple[int, int]:
        """Pixels along rows (0) or columns (1) at which a row or column of blocks begins and ends."""
        pixels, blocks = self.shape[axis], self.blocks[axis]
        return pixels * number // blocks, pixels * (number + 1) // blocks

    def _meeting(self, axis: int, begin: int, end: int) -> Iterator[tuple[int, tuple[int, int]]]:
        for number in range(self.blocks[axis]):
            first, last = self.edges(axis, number)
            if first < end and last > begin:
                yield number, (first, last)


@dataclass(frozen=True, eq=False)
class ClumpedSource:
    """A density with clumps; its pixels are parts of those of the density, and fine enough to show them."""

    source: Source
    clumps: Clumps

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, columns = (
            own * math.ceil(many / own) for own, many in zip(self.source.shape, self.clumps.shape, strict=True)
        )
        return rows, columns

    def read(self, top: int, bottom: int, left: int, right: int) -> np.ndarray:
        """Values of rows and columns, float32, shape ``[bottom - top, right - left]``."""
        times = [many // own for many, own in zip(self.shape, self.source.shape, strict=True)]
        rows, columns = np.arange(top, bottom) // times[0], np.arange(left, right) // times[1]
        part = self.source.read(int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1)
        return (part[np.ix_(rows - rows[0], columns - columns[0])] * self._factor(top, bottom, left, right)).astype(
            np.float32
        )

    def _factor(self, top: int, bottom: int, left: int, right: int) -> np.ndarray:
        """What pixels are multiplied by: linearly between the middles of those of the clumps."""
        clumps = self.clumps
        low, share, ends = [], [], []
        for axis, (begin, end) in enumerate(((top, bottom), (left, right))):
            many = clumps.shape[axis]
            place = (np.arange(begin, end) + 0.5) * (many / self.shape[axis]) - 0.5
            if not clumps.wraps:
                place = np.clip(place, 0.0, many - 1.0)
            first = np.floor(place).astype(np.int64)
            low.append(first - first[0])
            share.append(place - first)
            last = int(first[-1]) + 2
            ends += [int(first[0]), last if clumps.wraps else min(last, many)]
        values = clumps.values(*ends)
        for axis in (0, 1):
            values = np.moveaxis(values, axis, 0)
            above = np.minimum(low[axis] + 1, len(values) - 1)
            part = share[axis][:, None]
            values = np.moveaxis((1.0 - part) * values[low[axis]] + part * values[above], 0, axis)
        return values


def write_block(density: ClumpedSource, number: int) -> None:
    """Make a block of the clumps of a density."""
    clumps = density.clumps
    source = WrappedSource(density.source) if clumps.wraps else density.source
    inside, around = [], []
    for axis, place in enumerate((number // clumps.blocks[1], number % clumps.blocks[1])):
        begin, end = clumps.edges(axis, place)
        low, high = begin - BESIDE, end + BESIDE
        if not clumps.wraps:
            low, high = max(low, 0), min(high, clumps.shape[axis])
        inside.append(slice(begin - low, end - low))
        around.append(Axis(low, high, clumps.shape[axis]))
    factor = _made(clumps, source, around[0], around[1])[inside[0], inside[1]]
    clumps.folder.mkdir(parents=True, exist_ok=True)
    with written_atomically(clumps.path(number)) as file:
        np.save(file, factor.astype(np.float16), allow_pickle=False)


def _made(clumps: Clumps, source: Source, down: Axis, across: Axis) -> np.ndarray:
    """Factors in a part of the domain, as if there was nothing else."""
    asked = _means(source, down, across)
    if not asked.any():
        return np.ones(asked.shape)
    rows, columns = (np.arange(axis.begin, axis.end, dtype=np.int64) % axis.units for axis in (down, across))
    number = rows[:, None] * across.units + columns
    # As random as normal ones: every wave has a part of many of them.
    noise = math.sqrt(12.0) * (random_shares(number, list(clumps.seed)) - 0.5)
    grid = Grid([length / many for length, many in zip(clumps.extent[::-1], clumps.shape, strict=True)], wraps=False)
    waves = waves_of_noise(noise, grid, clumps.size)
    factor = clump_factor(waves, grid, clumps.size, clumps.clustering, measured=False)
    clumped = as_dense_at_large(asked, asked * factor, grid, WAVELENGTH * clumps.size, clumps.share, clumps.pushed_out)
    return np.divide(clumped, asked, out=factor, where=asked > 0.0)


def _means(source: Source, down: Axis, across: Axis) -> np.ndarray:
    """Mean densities of the pixels of a part, float64."""
    rows, columns = down.end - down.begin, across.end - across.begin
    fine = sample_source(source, down, across, (2 * rows, 2 * columns)).astype(np.float64)
    return fine.reshape(rows, fine.shape[0] // rows, columns, fine.shape[1] // columns).mean(axis=(1, 3))
