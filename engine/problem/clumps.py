"""Clumps: a density that is denser in spots and thinner between them, and the same as before at large.

The density is multiplied by the exponential of a random field of one wavelength. What that has of longer waves is taken out, and then
what the product has of them that the density has not: clumps say where bodies are within a wavelength, and the density at large.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..errors import ProblemError, Reason, Refusal
from .domain import Domain
from .machine_memory import format_bytes, machine_memory
from .prepared_class import PreparedClass
from .wave_filter import filter_waves

__all__ = [
    "PIXELS_PER_CLUMP",
    "WAVELENGTH",
    "as_dense_at_large",
    "clump_factor",
    "clump_size_of",
    "crowding_of",
    "memory_of_clumps",
    "occupied",
    "pushed_out_at",
    "share_at_large",
    "with_clumps",
]

# Diameter of a clump where none is given, in mean spacings of the class; two clumps are twice as far apart, so that there are some
# twenty bodies for each.
SPACINGS = 2.5
# A wavelength is a clump and the gap beside it.
WAVELENGTH = 2.0
# Logarithm of the density, at the strongest, where the field is at its standard deviation; and where the field is cut off.
CONTRAST, HIGHEST = 1.3, 2.0
# Width of the band of wave numbers, over its middle: narrow ones have clumps in rows, wide ones clumps of all sizes.
BAND = 0.25
# Over that middle: what the factor on the density has less of than the first is taken away, and above the second all is kept.
LOWEST_WAVES = (0.6, 0.9)
# The factor on the density is at least this, about: nowhere does a class lose its ground.
LEAST_FACTOR = 0.05
PIXELS_PER_CLUMP = 8.0
MOST_PIXELS = 4096
# How often what is below that is cut off, and long waves are taken out: each time less of both is left. Of many pixels less often. And
# along a side of more pixels than this there are a few more: transforms are slow where a length has large prime factors.
TIMES, FEWEST_TIMES = 24, 6
# Then the density is made what it was where both are filtered by a Gaussian of so many wavelengths, again and again. That is slow for
# waves of which the Gaussian leaves little, above all those along edges. So first, for this share of the times, it is multiplied by so
# many terms of its inverse's series, with which more of them is left. A wider Gaussian takes less of the clumps, and more times then
# leave less of the error: with these they keep .95 of the density's deviation from its mean, and most of the error is the solver's.
AT_LARGE, TIMES_AT_LARGE = 0.85, 56
TERMS, FIRST_SHARE = 3, 0.8
# Bodies push each other out of where they are crowded: their density is what they follow less so many times the Laplacian of its
# logarithm, per area. Over clumps that sums up to half of the error at large, and is made up for. Measured at these regularities.
REGULARITIES, PUSHED_OUT = (0.0, 0.3, 0.6, 1.0), (0.0027, 0.0062, 0.0125, 0.0255)
# Where a density has room for few clumps, patches of it are as large as they are, and to keep both is to have no clumps. So nothing of
# this is done where there is room for the first number of them, and all of it from the second on.
LITTLE_ROOM, MUCH_ROOM = 15.0, 45.0
# Widths of a blur after which it has ended.
REACH_OF_BLUR = 4.5
# Blocks of pixels along the width of the Gaussian: with 16 or more, 4,096 bodies of an even density are off by .00016 at 4 spacings,
# with 12 by .00022. What they are multiplied by is taken over to the pixels after so many times, since within a block the density
# leans to one side.
BLOCKS_ALONG, TIMES_IN_BLOCKS = 16.0, 6
# What is blurred to less than this share of its peak is left as it is; and by how much it is made denser or thinner at once, at most.
LEAST_AT_LARGE, MOST_AT_ONCE = 1e-4, 1.5
PIXELS_IN_ALL = 24 * 2**20
LONG_SIDE = 1024
# Mean square of the factor on a density, less 1, at these strengths.
STRENGTHS, CROWDING = (0.0, 0.25, 0.5, 0.75, 1.0), (0.0, 0.08, 0.32, 0.70, 1.15)
# At the peak, measured [bytes]: the grid of waves and what is filtered; what the density is compared with; and, per block of its
# pixels with what lies around it where it is blurred, spectra and their copies.
BYTES_PER_PIXEL_OF_CLUMPS, BYTES_PER_PIXEL_MATCHED, BYTES_PER_BLOCK_BLURRED = 36, 52, 110


def with_clumps(body_class: PreparedClass, index: int, domain: Domain, seed: int, regularity: float) -> PreparedClass:
    """Return a class whose density has the clumps that it asks for; its image may have more pixels.

    Args:
        body_class: The class.
        index: Its place among the classes; each has clumps of its own.
        domain: Where.
        seed: Of the problem.
        regularity: Of the problem.

    Raises:
        ProblemError: Clumps too small for the domain, or for this machine's memory.
    """
    if body_class.clustering == 0.0:
        return body_class
    image = body_class.density_image
    size = clump_size_of(body_class.clump_size, domain, body_class.body_count, occupied(image))
    shape = _shape(image, size, domain, body_class.name)
    factors = [n // own for n, own in zip(shape, image.shape, strict=True)]
    fine = np.repeat(np.repeat(image.astype(np.float64), factors[0], axis=0), factors[1], axis=1)
    factor = _factor(shape, size, domain, body_class.clustering, np.random.default_rng([seed, 8, index]))
    pixel = (domain.size[1] / shape[0], domain.size[0] / shape[1])
    pushed_out = pushed_out_at(regularity) / max(body_class.body_count, 1) * float(fine.sum()) * pixel[0] * pixel[1]
    blocks = _blocks(shape, pixel, size, domain.periodic)
    times = min(TIMES_AT_LARGE, max(FEWEST_TIMES, PIXELS_IN_ALL * blocks[0] * blocks[1] // fine.size))
    weight = share_at_large(fine, pixel, size)
    clumped = as_dense_at_large(fine, fine * factor, size, pixel, domain.periodic, weight, pushed_out, times)
    return replace(body_class, density_image=clumped.astype(np.float32))


def clump_size_of(asked: float, domain: Domain, body_count: int, share: float) -> float:
    """Diameter of the clumps of a class [m] that stands on so large a :func:`share <occupied>` of a domain.

    Where none is ``asked`` for it follows from the class's spacing, but an image that shows them has no more than so many pixels.
    """
    over_domain = SPACINGS * math.sqrt(domain.area / max(body_count, 1))
    shown = PIXELS_PER_CLUMP * max(domain.size) / LONG_SIDE
    return asked or max(over_domain * math.sqrt(share), min(over_domain, shown))


def occupied(density: np.ndarray) -> float:
    """Share of the ground of an even density that is as crowded as an average body finds this one: 1 where it is even itself."""
    mean, square = float(density.mean(dtype=np.float64)), float(np.square(density, dtype=np.float64).mean())
    return mean**2 / square if mean > 0.0 else 1.0


def pushed_out_at(regularity: float) -> float:
    """By how much bodies push each other out of clumps, see :data:`PUSHED_OUT`."""
    return float(np.interp(regularity, REGULARITIES, PUSHED_OUT))


def crowding_of(clustering: float) -> float:
    """By how much more others an average body of an even class with such clumps sees around it, of its class: as a share."""
    return float(np.interp(clustering, STRENGTHS, CROWDING))


def share_at_large(asked: np.ndarray, pixel: Sequence[float], size: float) -> float:
    """How much of it is done that a density with clumps is as dense at large as it was: from 0 to 1, by the room it has for clumps.

    Args:
        asked: The density without clumps, shape ``[height, width]``.
        pixel: Height and width of its pixels [m].
        size: Diameter of a clump [m].
    """
    room = pixel[0] * pixel[1] * asked.size * occupied(asked) / (WAVELENGTH * size) ** 2
    return float(min(max((room - LITTLE_ROOM) / (MUCH_ROOM - LITTLE_ROOM), 0.0), 1.0))


def _shape(image: np.ndarray, size: float, domain: Domain, name: str) -> tuple[int, int]:
    """Height and width of an image that shows the clumps, and whose pixels divide those of ``image``."""
    wanted = [math.ceil(PIXELS_PER_CLUMP * length / size) for length in domain.size[::-1]]
    if max(wanted) > MOST_PIXELS:
        least = PIXELS_PER_CLUMP * max(domain.size) / MOST_PIXELS
        raise ProblemError(
            f'`clump_size` of class "{name}" must be at least {least:.3g} m in a domain of '
            f"{domain.size[0]:g} x {domain.size[1]:g} m; got {size:.3g}",
            Refusal(Reason.CLUMPS_TOO_SMALL, size, least, (name, "")),
        )
    rows, columns = (own * math.ceil(many / own) for own, many in zip(image.shape, wanted, strict=True))
    required, available = memory_of_clumps(image, (rows, columns), size, domain), machine_memory()
    if available is not None and required > available:
        raise ProblemError(
            f'`clump_size` of class "{name}" is too small ({size:.3g} m): its density would have {columns} x {rows} pixels and take '
            f"about {format_bytes(required)} of memory, and this machine has {format_bytes(available)}",
            Refusal(Reason.MEMORY_FOR_CLUMPS, required, available, (name, "")),
        )
    return rows, columns


def memory_of_clumps(
    asked: np.ndarray, shape: Sequence[int], size: float, domain: Domain, crowding: float = 0.0
) -> int:
    """Estimate what making clumps takes at its peak [bytes].

    Args:
        asked: The density, shape ``[height, width]``.
        shape: Height and width of the image that shows the clumps.
        size: Their diameter [m].
        domain: Where.
        crowding: Of clumps that ``asked`` has already, see :func:`crowding_of`.
    """
    own = (domain.size[1] / asked.shape[0], domain.size[0] / asked.shape[1])
    # Of a single pixel no sum leaves the range of its numbers.
    whole = asked.astype(np.float64) if asked.size > 1 else np.ones((1, 1))
    blurred = 0
    if whole.any() and share_at_large(whole, own, size / math.sqrt(1.0 + crowding)) > 0.0:
        pixel = [length / n for length, n in zip(domain.size[::-1], shape, strict=True)]
        blocks = _blocks(shape, pixel, size, domain.periodic)
        padded = _padded(*_in_blocks(shape, pixel, blocks), size, domain.periodic)
        blurred = max(BYTES_PER_PIXEL_MATCHED * shape[0] * shape[1], BYTES_PER_BLOCK_BLURRED * padded[0] * padded[1])
    return BYTES_PER_PIXEL_OF_CLUMPS * shape[0] * shape[1] + blurred


def _padded(shape: Sequence[int], pixel: Sequence[float], size: float, wraps: bool) -> list[int]:
    """Height and width of what a density is blurred in. What does not wrap ends at its edges: nothing is beyond."""
    reach = REACH_OF_BLUR * AT_LARGE * WAVELENGTH * size
    return [
        many if wraps else _fast_length(many + math.ceil(reach / step)) for many, step in zip(shape, pixel, strict=True)
    ]


def _factor(
    shape: tuple[int, int], size: float, domain: Domain, clustering: float, random: np.random.Generator
) -> np.ndarray:
    """What a density is multiplied by at an image's pixels: clumps, and nothing of longer waves."""
    count = [_length_of_transform(math.ceil(PIXELS_PER_CLUMP * length / size)) for length in domain.size[::-1]]
    pixel = [length / many for length, many in zip(domain.size[::-1], count, strict=True)]
    factor = clump_factor(random.standard_normal(count), pixel, size, domain.periodic, clustering, measured=True)
    return _stretched(_stretched(factor, shape[0], domain.periodic).T, shape[1], domain.periodic).T


def clump_factor(
    noise: np.ndarray, pixel: Sequence[float], size: float, wraps: bool, clustering: float, *, measured: bool
) -> np.ndarray:
    """Return what a density is multiplied by so that it has clumps, shape ``[height, width]``.

    Args:
        noise: Random numbers of which none depends on another, of mean 0 and standard deviation 1, of that shape.
        pixel: Height and width of pixels [m].
        size: Diameter of a clump [m].
        wraps: Whether opposite edges are joined.
        clustering: How strong clumps are.
        measured: Whether the strength of these waves, and the mean of what comes of them, are measured; otherwise they are what
            they are on average, so that parts of a larger field agree.
    """
    rows, columns = noise.shape
    if wraps:
        wave = np.hypot(np.fft.fftfreq(rows, pixel[0])[:, None], np.fft.rfftfreq(columns, pixel[1])[None, :])
    else:
        # What does not wrap goes on as in mirrors, and is made of cosines: clumps at an edge are whole ones.
        along_y, along_x = (
            0.5 * np.arange(many) / (many * step) for many, step in zip(noise.shape, pixel, strict=True)
        )
        wave = np.hypot(along_y[:, None], along_x[None, :])
    wave *= WAVELENGTH * size
    factor = np.exp(CONTRAST * clustering * _waves(noise, wave, wraps, measured))
    factor /= factor.mean() if measured else _mean_factor(CONTRAST * clustering)
    low, high = LOWEST_WAVES
    # In place, as all of this: grids may have millions of pixels.
    kept = np.clip((wave - low) / (high - low), 0.0, 1.0, out=wave)
    kept *= kept * (3.0 - 2.0 * kept)
    for _ in range(min(TIMES, max(FEWEST_TIMES, PIXELS_IN_ALL // factor.size))):
        # What is cut off below has long waves again, though fewer.
        factor = 1.0 + filter_waves(np.maximum(factor, LEAST_FACTOR) - 1.0, kept, wraps)
    return np.maximum(factor, 0.5 * LEAST_FACTOR)


def as_dense_at_large(
    asked: np.ndarray,
    clumped: np.ndarray,
    size: float,
    pixel: Sequence[float],
    wraps: bool,
    weight: float,
    pushed_out: float,
    times: int,
) -> np.ndarray:
    """A density with clumps, made so that its bodies will be as dense as the one that was asked for, blurred over several clumps.

    It is not enough that clumps have no long waves: waves of the density beat with theirs, and edges cut them off.

    Args:
        asked: The density without clumps, shape ``[height, width]``.
        clumped: That with them.
        size: Diameter of a clump [m].
        pixel: Height and width of pixels [m].
        wraps: Whether opposite edges are joined.
        weight: How much of it is done, see :func:`share_at_large`.
        pushed_out: By how much bodies push each other out of clumps: see :data:`PUSHED_OUT`, of the density that one body has.
        times: How often it is multiplied by what it lacks.
    """
    if weight == 0.0 or not asked.any():
        return clumped
    reach = AT_LARGE * WAVELENGTH * size
    blocks = _blocks(asked.shape, pixel, size, wraps)
    shape, coarse = _in_blocks(asked.shape, pixel, blocks)
    padded = _padded(shape, coarse, size, wraps)
    along_y = np.fft.fftfreq(padded[0], coarse[0])[:, None]
    along_x = np.fft.rfftfreq(padded[1], coarse[1])[None, :]
    exponent = 0.5 * (2.0 * math.pi * reach) ** 2 * (along_y**2 + along_x**2)
    gaussian = np.exp(-exponent)
    series = sum(exponent**term / math.factorial(term) for term in range(TERMS))
    clumped = clumped * (asked.sum() / clumped.sum())
    first = round(FIRST_SHARE * times)
    wanted = _sums_of_blocks(asked + pushed_out * _spreading(asked, clumped, pixel, wraps), blocks)
    for kept, own_times in ((gaussian * series, first), (gaussian, times - first)):
        _match(clumped, wanted, _Filter(kept, padded), blocks, wraps, weight, own_times)
    return clumped


def _spreading(asked: np.ndarray, clumped: np.ndarray, pixel: Sequence[float], wraps: bool) -> np.ndarray:
    """Laplacian of the logarithm of what clumps multiply a density by [1/m²]; nothing goes to where the density is 0."""
    there = asked > 0.0
    factor = np.log(np.divide(clumped, asked, out=np.ones_like(asked), where=there))
    result = np.zeros_like(asked)
    for axis in (0, 1):
        flow = (np.roll(factor, -1, axis) - factor) / pixel[axis] ** 2
        flow *= there & np.roll(there, -1, axis)
        if not wraps:
            np.moveaxis(flow, axis, 0)[-1] = 0.0
        result += flow - np.roll(flow, 1, axis)
    return result


class _Filter(NamedTuple):
    """Shares of waves that are kept, in an image of so many rows and columns."""

    kept: np.ndarray
    padded: Sequence[int]

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return an image, with zeros around it, filtered."""
        whole: np.ndarray = np.fft.irfft2(np.fft.rfft2(values, self.padded) * self.kept, self.padded)
        return whole[: values.shape[0], : values.shape[1]]


def _blocks(shape: Sequence[int], pixel: Sequence[float], size: float, wraps: bool) -> tuple[int, int]:
    """Rows and columns of pixels that are one where a density is blurred over several clumps; they divide what wraps."""
    most = [int(AT_LARGE * WAVELENGTH * size / (BLOCKS_ALONG * step)) for step in pixel]
    rows, columns = (
        next(block for block in range(max(1, min(own, many)), 0, -1) if not wraps or many % block == 0)
        for own, many in zip(most, shape, strict=True)
    )
    return rows, columns


def _in_blocks(shape: Sequence[int], pixel: Sequence[float], blocks: Sequence[int]) -> tuple[list[int], list[float]]:
    """Rows and columns of blocks of an image, and their height and width [m]."""
    return (
        [-(-many // block) for many, block in zip(shape, blocks, strict=True)],
        [step * block for step, block in zip(pixel, blocks, strict=True)],
    )


def _sums_of_blocks(values: np.ndarray, blocks: Sequence[int]) -> np.ndarray:
    """Sums of the pixels of all blocks; those at the far edges may have fewer."""
    for axis, block in enumerate(blocks):
        values = np.add.reduceat(values, np.arange(0, values.shape[axis], block), axis=axis)
    return values


def _over_blocks(values: np.ndarray, shape: Sequence[int], blocks: Sequence[int], wraps: bool) -> np.ndarray:
    """Values of blocks at the pixels of an image of this shape, linearly between the blocks' middles."""
    for many, block in zip(shape, blocks, strict=True):
        values = _stretched(values, len(values) * block, wraps)[:many].T
    return values


def _match(
    density: np.ndarray,
    asked: np.ndarray,
    filtered: _Filter,
    blocks: Sequence[int],
    wraps: bool,
    weight: float,
    times: int,
) -> None:
    """Multiply a density, in place, by what it lacks where it and the one that was asked for are filtered, so many times.

    Each time goes on with a growing share of the last one, as in Nesterov's method: what takes k² times without takes k. Both are
    filtered as sums of blocks of pixels; what these are multiplied by is as smooth as the filter, and is taken over to the pixels
    now and then.
    """
    wanted = filtered(asked)
    least = LEAST_AT_LARGE * float(wanted.max())
    np.maximum(wanted, least, out=wanted)
    sums = _sums_of_blocks(density, blocks)
    last, pending = np.ones_like(sums), np.ones_like(sums)
    for time in range(times):
        last **= time / (time + 3.0)
        factor = (wanted / np.maximum(filtered(sums * last), least)) ** weight
        last *= np.clip(factor, 1.0 / MOST_AT_ONCE, MOST_AT_ONCE, out=factor)
        sums *= last
        pending *= last
        np.clip(last, 1.0 / MOST_AT_ONCE, MOST_AT_ONCE, out=last)
        if (time + 1) % TIMES_IN_BLOCKS == 0 or time == times - 1:
            density *= _over_blocks(pending, density.shape, blocks, wraps)
            sums = _sums_of_blocks(density, blocks)
            pending.fill(1.0)


def _waves(noise: np.ndarray, wave: np.ndarray, wraps: bool, measured: bool) -> np.ndarray:
    """Of noise the waves as long as clumps are apart, of standard deviation 1 but for its peaks."""
    band = np.exp(-0.5 * ((wave - 1.0) / BAND) ** 2)
    band[0, 0] = 0.0
    waves = filter_waves(noise, band, wraps)
    deviation = float(waves.std()) if measured else math.sqrt(float((band**2).mean()))
    # Where the domain is smaller than a clump there is next to nothing.
    waves /= max(deviation, 1e-9)
    return np.clip(waves, -HIGHEST, HIGHEST)


def _mean_factor(contrast: float) -> float:
    """Mean of what a density is multiplied by, where waves are normally distributed but for their peaks."""
    step = 1e-3
    wave = np.arange(-8.0, 8.0, step)
    weight = np.exp(-0.5 * wave**2) * (step / math.sqrt(2.0 * math.pi))
    return float((weight * np.exp(contrast * np.clip(wave, -HIGHEST, HIGHEST))).sum())


def _length_of_transform(least: int) -> int:
    """Pixels along a side: so many; of many the next number that is fast."""
    return max(least, 4) if least <= LONG_SIDE else _fast_length(least)


def _fast_length(least: int) -> int:
    """The next number whose prime factors are 2, 3 and 5."""
    powers = (2**two * 3**three * 5**five for two in range(14) for three in range(9) for five in range(6))
    return min(number for number in powers if number >= least)


def _stretched(values: np.ndarray, count: int, wraps: bool) -> np.ndarray:
    """Values along the first axis at so many places, linearly between the middles of pixels; they wrap, or go on as they end."""
    many = len(values)
    place = (np.arange(count) + 0.5) * (many / count) - 0.5
    low = np.floor(place).astype(np.int64)
    share = (place - low)[:, None]
    below, above = (low % many, (low + 1) % many) if wraps else (np.maximum(low, 0), np.minimum(low + 1, many - 1))
    return (1.0 - share) * values[below] + share * values[above]
