"""Images that go on beyond the edges of a domain, and densities beyond those within it, too: as the nearest place is that has any."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..device.launcher import Launcher
from ..geometry.connected import connected_pixels
from .support import depth_in_support, nearest_in_support

__all__ = ["AxisBeyond", "DensityBeyond", "KnownWays", "density_beyond", "image_beyond"]

# A density that goes on over the whole domain ends nowhere, and makes no rows along its ends: that is taken if it does not make more
# than so many times as many bodies.
MOST_MORE = 4.0
# How many widths of the margin are tried for one in which densities have few pixels.
TRIED = 16
# Pixels are divided into at most so many, unless there are few of them all the same; where that is not enough each becomes as many as
# the last says, about.
MOST_FINER = 6
FEW_PIXELS = 1024
PIXELS_OF_ONE = 2.0


class DensityBeyond(NamedTuple):
    """A density that goes on beyond its edges.

    Attributes:
        image: That density.
        more: Its integral over that of the part within the edges.
        depth: How deep pixels lie within the edges [m]; None where these are the domain's only.
        part: Of several parts that do not meet, the number of the one that each pixel is in, or nearest to; None where it is one.
    """

    image: np.ndarray
    more: float
    depth: np.ndarray | None
    part: np.ndarray | None = None


class AxisBeyond(NamedTuple):
    """How images are laid over the larger domain along one axis.

    Attributes:
        margin: Beyond either end [m].
        pixels: Of a common grid over the domain: the margin is a whole number of them.
        beyond: That number.
    """

    margin: float
    pixels: int
    beyond: int

    @classmethod
    def of(cls, counts: Sequence[int], length: float, reach: float) -> AxisBeyond:
        """The axis for images of so many pixels over a length [m]; pixels are no wider than the reach."""
        pixels = max(counts)
        pixels *= max(1, math.ceil(length / pixels / reach))
        least = math.ceil(reach * pixels / length * (1.0 - 1e-9))
        beyond = min(range(least, least + TRIED), key=lambda n: max(_finer(many, pixels, n) * many for many in counts))
        return cls(beyond * length / pixels, pixels, beyond)

    def finer(self, count: int) -> int:
        """How many pixels one of an image of so many becomes, for the margin to be a whole number of them."""
        return _finer(count, self.pixels, self.beyond)


def _finer(count: int, pixels: int, beyond: int) -> int:
    return pixels // math.gcd(pixels, count * beyond)


class _Ways(NamedTuple):
    """Where a density is, seen from the pixels of a larger domain; every array has its shape.

    Attributes:
        nearest: Flat index of the nearest pixel that has a density.
        away: Distance from it [m], 0 where there is a density.
        deep: Distance from the nearest pixel that has none [m]; None where these are beyond the domain only.
        part: Number of the part of the density that the nearest pixel is in; None where it is one part.
    """

    nearest: np.ndarray
    away: np.ndarray
    deep: np.ndarray | None
    part: np.ndarray | None


# By shape and pixels that have a density.
KnownWays = dict[tuple[tuple[int, ...], bytes], _Ways]


def density_beyond(
    launcher: Launcher,
    image: np.ndarray,
    along: Sequence[AxisBeyond],
    reach: float,
    size: tuple[float, float],
    known: KnownWays,
) -> DensityBeyond:
    """Let a density go on beyond its edges as far as ``reach`` [m], in a domain of ``size`` [m]."""
    for number, axis in enumerate(along):
        count = image.shape[number]
        if axis.finer(count) <= MOST_FINER or axis.finer(count) * count <= FEW_PIXELS:
            image = np.repeat(image, axis.finer(count), axis=number)
        else:
            image = _with_pixels(image, axis.pixels * math.ceil(PIXELS_OF_ONE * count / axis.pixels), number)
    pads = [axis.beyond * n // axis.pixels for axis, n in zip(along, image.shape, strict=True)]
    inner = np.pad(image, [(n, n) for n in pads])
    pixel = np.array([size[0] / inner.shape[1], size[1] / inner.shape[0]])
    key = inner.shape, np.packbits(inner > 0.0).tobytes()
    if key not in known:
        known[key] = _ways_beside(image.shape, pads, pixel) if (image > 0.0).all() else _ways(launcher, inner, size)
    ways = known[key]
    result = inner.ravel()[ways.nearest]
    asked = float(image.sum(dtype=np.float64))
    if float(result.sum(dtype=np.float64)) > MOST_MORE * asked:
        result = np.where(ways.away <= reach + 0.5 * pixel.max(), result, np.float32(0.0))
    more = float(result.sum(dtype=np.float64)) / asked
    depth = None if ways.deep is None else np.where(inner > 0.0, ways.deep, -ways.away)
    return DensityBeyond(result, more, depth, ways.part)


def _with_pixels(image: np.ndarray, count: int, axis: int) -> np.ndarray:
    """An image with so many pixels along an axis: their means; 0 where their middles are so."""
    own = image.shape[axis]
    whole = np.moveaxis(image, axis, -1).astype(np.float64)
    sums = np.concatenate([np.zeros((*whole.shape[:-1], 1)), np.cumsum(whole, axis=-1)], axis=-1)
    at = np.arange(count + 1) * (own / count)
    left = np.minimum(at.astype(int), own - 1)
    edges = sums[..., left] + (at - left) * whole[..., left]
    middle = ((np.arange(count) + 0.5) * (own / count)).astype(int)
    means = np.where(whole[..., middle] > 0.0, np.diff(edges, axis=-1) * (count / own), 0.0)
    return np.ascontiguousarray(np.moveaxis(means, -1, axis), dtype=np.float32)


def _ways_beside(shape: tuple[int, ...], pads: Sequence[int], pixel: np.ndarray) -> _Ways:
    """Ways to a rectangle that has a density everywhere, with so many pixels beside it."""
    at = [np.arange(n + 2 * pad) for n, pad in zip(shape, pads, strict=True)]
    row, column = (np.clip(i, pad, pad + n - 1) for i, n, pad in zip(at, shape, pads, strict=True))
    away = np.hypot(((at[0] - row) * pixel[1])[:, None], ((at[1] - column) * pixel[0])[None])
    return _Ways(row[:, None] * len(at[1]) + column, away, None, None)


def _ways(launcher: Launcher, inner: np.ndarray, size: tuple[float, float]) -> _Ways:
    nearest, away = nearest_in_support(launcher, inner, size)
    part = connected_pixels(inner > 0.0)
    of_nearest = part.ravel()[nearest] if part.max() > 0 else None
    return _Ways(nearest, away, depth_in_support(launcher, inner, size), of_nearest)


def image_beyond(image: np.ndarray, beyond: Sequence[float]) -> np.ndarray:
    """Let an image go on beyond its edges, as far as these shares of its extent along x and y, with pixels about as large."""
    at = []
    for count, more in zip(image.shape[:2], (beyond[1], beyond[0]), strict=True):
        total = max(1, math.ceil(count * (1.0 + 2.0 * more)))
        middle = ((np.arange(total) + 0.5) / total * (1.0 + 2.0 * more) - more) * count
        at.append(np.clip(middle.astype(int), 0, count - 1))
    return image[np.ix_(*at)]
