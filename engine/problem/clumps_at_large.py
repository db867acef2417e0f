"""Clumps that leave a density as it is at large: blurred over several clumps, it is what was asked for.

The density with clumps is multiplied by a factor that is linear between nodes, a few for each clump. How dense it is then, summed at
the nodes, follows from the factor by a sparse matrix that is made once. So hundreds of rounds look for the factor without a look at
pixels, which are many times as many.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from .wave_filter import fast_length, linear_places, stretched

__all__ = ["Grid", "as_dense_at_large", "memory_at_large"]

# Width of the Gaussian by which densities are compared, in wavelengths of clumps; and nodes along it. Sums at these are off by what is
# as short as two nodes, of which B-splines leave next to nothing: with 7 errors are the same.
AT_LARGE, NODES_ALONG = 0.92, 4.0
# Widths of a Gaussian after which it has ended.
REACH_OF_BLUR = 4.5
# How often the factor is multiplied by what lacks; of many nodes less often, so that nodes times rounds are no more than these. With
# 56 rounds 4,096 bodies in clumps on a disc are off by five times as much at 4 spacings as without clumps, with 200 by two and a half
# times, and with these by one and a half times; with twice as many by as much.
ROUNDS, FEWEST_ROUNDS, NODES_IN_ALL = 440, 24, 24 * 2**20
# Rounds are slow for waves of which the Gaussian leaves little, above all those along edges. So first, for this share of the rounds,
# it is multiplied by so many terms of its inverse's series, with which more of them is left. Forty rounds without are enough.
FIRST_SHARE, TERMS = 0.91, 2
# So much of its logarithm the factor loses in every round, once in so many: where next to nothing lacks, it has no reason to be
# anything but 1, and clumps keep .94 of the density's deviation from its mean. Without it .92; with twice as much squares are off by
# two fifths more.
LOST, ROUNDS_TO_LOSE = 5e-5, 8
# What is blurred to less than this share of its peak is left as it is; and by how much a place is made denser or thinner at once, and
# in all, at most.
LEAST, MOST_AT_ONCE, MOST_IN_ALL = 1e-4, 1.5, 100.0
# A pixel's factor is that of two nodes along an axis, and its density is summed at four: their numbers differ by two at most.
SUMMED_AT, BESIDE = 4, 2
OFFSETS = 2 * BESIDE + 1
# At the peak, measured [bytes].
BYTES_PER_PIXEL, BYTES_PER_NODE, BYTES_PER_PADDED = 50, 150, 60


class Grid(NamedTuple):
    """What an image's pixels are.

    Attributes:
        pixel: Their height and width [m].
        wraps: Whether opposite edges of the image are joined.
    """

    pixel: Sequence[float]
    wraps: bool


def as_dense_at_large(
    asked: np.ndarray, clumped: np.ndarray, grid: Grid, wavelength: float, share: float, pushed_out: float = 0.0
) -> np.ndarray:
    """A density with clumps, made so that its bodies will be as dense as the one that was asked for, blurred over several clumps.

    It is not enough that clumps have no long waves: waves of the density beat with theirs, and edges cut them off.

    Args:
        asked: The density without clumps, shape ``[height, width]``.
        clumped: That with them.
        grid: What their pixels are.
        wavelength: Of the clumps: twice their diameter [m].
        share: How much of it is done, from 0 to 1.
        pushed_out: By how much bodies push each other out of clumps: times the Laplacian of the density's logarithm [m²].
    """
    if share == 0.0 or not asked.any():
        return clumped
    clumped = clumped * (asked.sum() / clumped.sum())
    width = AT_LARGE * wavelength
    nodes, step, padded = _nodes(asked.shape, grid, width)
    axes = [_Axis(many, count, grid.wraps) for many, count in zip(asked.shape, nodes, strict=True)]
    wanted = asked + pushed_out * _spreading(asked, clumped, grid) if pushed_out else asked
    everywhere = np.ones(nodes)
    sums = _Sums(clumped, axes)
    sums_wanted = share * _Sums(wanted, axes)(everywhere) + (1.0 - share) * sums(everywhere)
    rounds = min(ROUNDS, max(FEWEST_ROUNDS, NODES_IN_ALL // (padded[0] * padded[1])))
    first = round(FIRST_SHARE * rounds)
    factor = everywhere
    for kept, many in zip(_filters(padded, step, width), (first, rounds - first), strict=True):
        factor = _matched(factor, sums, sums_wanted, kept, padded, many)
    for many in asked.shape:
        factor = stretched(factor, many, grid.wraps).T
    clumped *= factor
    return clumped


def memory_at_large(shape: Sequence[int], grid: Grid, wavelength: float) -> int:
    """Estimate what :func:`as_dense_at_large` takes at its peak, beside its densities [bytes]."""
    nodes, _, padded = _nodes(shape, grid, AT_LARGE * wavelength)
    return (
        BYTES_PER_PIXEL * shape[0] * shape[1]
        + BYTES_PER_NODE * nodes[0] * nodes[1]
        + BYTES_PER_PADDED * padded[0] * padded[1]
    )


def _nodes(shape: Sequence[int], grid: Grid, width: float) -> tuple[list[int], list[float], list[int]]:
    """How many nodes there are along either side, how far apart [m], and with what is around them where they are blurred."""
    length = [many * own for many, own in zip(shape, grid.pixel, strict=True)]
    nodes = [min(many, math.ceil(NODES_ALONG * side / width)) for many, side in zip(shape, length, strict=True)]
    step = [side / count for side, count in zip(length, nodes, strict=True)]
    if grid.wraps:
        return nodes, step, nodes
    # What does not wrap ends at its edges: nothing is beyond.
    reach = [2 * BESIDE + math.ceil(REACH_OF_BLUR * width / own) for own in step]
    return nodes, step, [fast_length(count + more) for count, more in zip(nodes, reach, strict=True)]


def _spreading(asked: np.ndarray, clumped: np.ndarray, grid: Grid) -> np.ndarray:
    """Laplacian of the logarithm of what clumps multiply a density by [1/m²]; nothing goes to where the density is 0."""
    there = asked > 0.0
    factor = np.log(np.divide(clumped, asked, out=np.ones_like(asked), where=there))
    result = np.zeros_like(asked)
    for axis in (0, 1):
        flow = (np.roll(factor, -1, axis) - factor) / grid.pixel[axis] ** 2
        flow *= there & np.roll(there, -1, axis)
        if not grid.wraps:
            np.moveaxis(flow, axis, 0)[-1] = 0.0
        result += flow - np.roll(flow, 1, axis)
    return result


def _filters(padded: Sequence[int], step: Sequence[float], width: float) -> Iterator[np.ndarray]:
    """Shares of waves that are kept of sums at nodes: by a Gaussian and some terms of its inverse, then by the Gaussian alone."""
    along_y, along_x = np.fft.fftfreq(padded[0])[:, None], np.fft.rfftfreq(padded[1])[None, :]
    exponent = 0.5 * (2.0 * math.pi * width) ** 2 * ((along_y / step[0]) ** 2 + (along_x / step[1]) ** 2)
    # B-splines have blurred sums a little already.
    gaussian = np.exp(-exponent) / (np.sinc(along_y) * np.sinc(along_x)) ** SUMMED_AT
    yield gaussian * sum(exponent**term / math.factorial(term) for term in range(TERMS))
    yield gaussian


def _filtered(values: np.ndarray, kept: np.ndarray, padded: Sequence[int]) -> np.ndarray:
    """Values with zeros around them, filtered."""
    whole: np.ndarray = np.fft.irfft2(np.fft.rfft2(values, padded) * kept, padded)
    return whole[: values.shape[0], : values.shape[1]]


def _matched(
    factor: np.ndarray, sums: _Sums, wanted: np.ndarray, kept: np.ndarray, padded: Sequence[int], rounds: int
) -> np.ndarray:
    """Multiply a factor by what the density lacks with it, where it and what is wanted are filtered, so many times.

    Every round goes on with a growing share of the last one, as in Nesterov's method: what takes k² rounds without takes k.
    """
    wanted = _filtered(wanted, kept, padded)
    least = LEAST * float(wanted.max())
    np.maximum(wanted, least, out=wanted)
    inner = tuple(slice(margin, margin + many) for margin, many in zip(sums.margins, factor.shape, strict=True))
    last = np.ones_like(factor)
    for number in range(rounds):
        last **= number / (number + 3.0)
        there = _filtered(sums(factor * last), kept, padded)
        ratio = (wanted / np.maximum(there, least, out=there))[inner]
        if number % ROUNDS_TO_LOSE == 0:
            ratio = ratio * factor ** (-LOST * ROUNDS_TO_LOSE)
        last *= np.clip(ratio, 1.0 / MOST_AT_ONCE, MOST_AT_ONCE)
        factor = np.clip(factor * last, 1.0 / MOST_IN_ALL, MOST_IN_ALL)
        np.clip(last, 1.0 / MOST_AT_ONCE, MOST_AT_ONCE, out=last)
    return factor


class _Axis:
    """Pixels and nodes along an axis: factors are linear between two nodes, and densities are summed at four, by cubic B-splines."""

    def __init__(self, pixels: int, nodes: int, wraps: bool) -> None:
        self.nodes, self.wraps = nodes, wraps
        low, share = linear_places(nodes, pixels)
        # Pixels between the same two nodes follow each other.
        self._begin = np.flatnonzero(np.diff(low, prepend=low[0] - 1))
        self._interval = low[self._begin]
        rest = 1.0 - share
        self._linear = (rest, share)
        self._cubic = (
            rest**3 / 6.0,
            (share**2 * (3.0 * share - 6.0) + 4.0) / 6.0,
            (rest**2 * (3.0 * rest - 6.0) + 4.0) / 6.0,
            share**3 / 6.0,
        )

    def products(self, values: np.ndarray) -> np.ndarray:
        """Sum values along the first axis, times what pixels have of a node, at all nodes beside that one.

        Args:
            values: Of pixels, shape ``[pixels, n]``.

        Returns:
            Shape ``[5, nodes, n]``: by how many the number of the node at which is summed is larger, from -2 on; and the one node.
        """
        result = np.zeros((OFFSETS, self.nodes, values.shape[1]))
        for high, of_factor in enumerate(self._linear):
            counted = self._interval + high
            node = counted % self.nodes if self.wraps else np.clip(counted, 0, self.nodes - 1)
            for at, of_sum in enumerate(self._cubic):
                offset = self._interval - 1 + at - (counted if self.wraps else node) + BESIDE
                sums = np.add.reduceat(values * (of_factor * of_sum)[:, None], self._begin, axis=0)
                np.add.at(result, (offset, node), sums)
        return result


class _Sums:
    """A density summed at nodes, as it follows from the factor that it is multiplied by.

    Attributes:
        margins: Nodes before the first ones of the factor, along either axis.
    """

    def __init__(self, density: np.ndarray, axes: Sequence[_Axis]) -> None:
        down, across = axes
        self._wraps = down.wraps
        self.margins = (0, 0) if self._wraps else (BESIDE, BESIDE)
        self._products = [
            [np.ascontiguousarray(product.T) for product in across.products(np.ascontiguousarray(part.T))]
            for part in down.products(density)
        ]

    def __call__(self, factor: np.ndarray) -> np.ndarray:
        """Return sums at the nodes, and two more on every side where edges are not joined."""
        rows, columns = factor.shape
        result, product = np.zeros((rows + 2 * BESIDE, columns + 2 * BESIDE)), np.empty_like(factor)
        for below, along in enumerate(self._products):
            for beside, one in enumerate(along):
                result[below : below + rows, beside : beside + columns] += np.multiply(one, factor, out=product)
        return _joined(_joined(result).T).T if self._wraps else result


def _joined(values: np.ndarray) -> np.ndarray:
    """Add what is beyond either end of the first axis to the nodes at the other end."""
    many = len(values) - 2 * BESIDE
    result = values[BESIDE : BESIDE + many].copy()
    for beyond in range(BESIDE):
        result[(beyond - BESIDE) % many] += values[beyond]
        result[beyond % many] += values[BESIDE + many + beyond]
    return result
