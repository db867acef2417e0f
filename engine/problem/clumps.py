"""Clumps: a density that is denser in spots and thinner between them, and the same as before at large.

The density is multiplied by the exponential of a random field of one wavelength. What that has of longer waves is taken out, and then
what the product has of them that the density has not: clumps say where bodies are within a wavelength, and the density at large.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..errors import ProblemError, Reason, Refusal
from .clumps_at_large import Grid, as_dense_at_large, memory_at_large
from .domain import Domain
from .machine_memory import format_bytes, machine_memory
from .prepared_class import PreparedClass
from .random_numbers import random_shares
from .wave_filter import fast_length, filter_waves, from_cosines, stretched

__all__ = [
    "PIXELS_PER_CLUMP",
    "WAVELENGTH",
    "clump_factor",
    "clump_size_of",
    "clumps_kept",
    "crowding_of",
    "memory_of_clumps",
    "occupied",
    "pushed_out_at",
    "share_at_large",
    "waves_by_number",
    "waves_of_noise",
    "with_clumps",
]

# Diameter of a clump where none is given, in mean spacings of the class; two clumps are twice as far apart, so that there are some
# twenty bodies for each.
SPACINGS = 2.5
# A chosen diameter is a power of this: most edits, as a stroke over a density, leave it and so all clumps as they are.
SIZE_STEP = 1.08
# And an edit leaves it where the one that would be chosen differs by less than this factor.
MOST_CHANGE = 1.3
# A wavelength is a clump and the gap beside it.
WAVELENGTH = 2.0
# Logarithm of the density, at the strongest, where the field is at its standard deviation; and where the field is cut off.
CONTRAST, HIGHEST = 1.3, 2.0
# Width of the band of wave numbers, over its middle: narrow ones have clumps in rows, wide ones clumps of all sizes.
# Beyond so many widths there are no waves.
BAND, WIDTHS_OF_BAND = 0.25, 4.0
# More waves than go into a domain along one side.
NUMBERS = 2**24
# Over that middle: what the factor on the density has less of than the first is taken away, and above the second all is kept.
LOWEST_WAVES = (0.6, 0.9)
# The factor on the density is at least this, about: nowhere does a class lose its ground.
LEAST_FACTOR = 0.05
PIXELS_PER_CLUMP = 8.0
MOST_PIXELS = 4096
# How often what is below that is cut off, and long waves are taken out: each time less of both is left. Of many pixels less often. And
# along a side of more pixels than this there are a few more: transforms are slow where a length has large prime factors.
TIMES, FEWEST_TIMES = 24, 6
# Bodies push each other out of where they are crowded: their density is what they follow less so many times the Laplacian of its
# logarithm, per area, measured at these regularities. Over clumps that sums up to half of the error at large. Where one solve places
# all of them it is measured and made up for during the run (:mod:`~esh.engine.field.target_feedback`); tiles make up for it before.
REGULARITIES, PUSHED_OUT = (0.0, 0.3, 0.6, 1.0), (0.0024, 0.0056, 0.0113, 0.023)
# Where a density has room for few clumps, patches of it are as large as they are, and to keep both takes half of the clumps away. So
# nothing of this is done where there is room for the first number of them, and all of it from the second on.
LITTLE_ROOM, MUCH_ROOM = 7.0, 14.0
PIXELS_IN_ALL = 24 * 2**20
LONG_SIDE = 1024
# Mean square of the factor on a density, less 1, at these strengths.
STRENGTHS, CROWDING = (0.0, 0.25, 0.5, 0.75, 1.0), (0.0, 0.07, 0.295, 0.66, 1.1)
# Densities with clumps, and what densities are multiplied by, that are kept, each of no more pixels than these.
MOST_KEPT, MOST_PIXELS_KEPT = 4, 2**20
# At the peak, measured: the grid of waves and what is filtered [bytes].
BYTES_PER_PIXEL_OF_CLUMPS = 36


def with_clumps(
    body_class: PreparedClass, index: int, domain: Domain, seed: int, size: float | None = None
) -> PreparedClass:
    """Return a class whose density has the clumps that it asks for; its image may have more pixels.

    Args:
        body_class: The class.
        index: Its place among the classes; each has clumps of its own.
        domain: Where.
        seed: Of the problem.
        size: Diameter of the clumps [m]; None for what the class asks for.

    Raises:
        ProblemError: Clumps too small for the domain, or for this machine's memory.
    """
    if body_class.clustering == 0.0:
        return body_class
    image = body_class.density_image
    if size is None:
        size = clump_size_of(body_class.clump_size, domain, body_class.body_count, occupied(image))
    own = _Own(_shape(image, size, domain, body_class.name), size, domain, body_class.clustering, (seed, 8, index))
    if max(math.prod(own.shape), image.size) <= MOST_PIXELS_KEPT:
        clumped = _clumped_again(image.tobytes(), image.shape, image.dtype.str, own)
    else:
        clumped = _clumped(image, own)
    return replace(body_class, density_image=clumped, clumps=size)


def clumps_kept(body_class: PreparedClass, before: PreparedClass) -> bool:
    """Whether clumps of a chosen size stay as large as they were ``before``: a little more or less moves nearly all bodies."""
    if not body_class.clumps or not before.clumps or body_class.clump_size or before.clump_size:
        return False
    ratio = body_class.clumps / before.clumps
    return ratio != 1.0 and 1.0 / MOST_CHANGE < ratio < MOST_CHANGE


class _Own(NamedTuple):
    """What clumps of a class follow from, beside its density."""

    shape: tuple[int, int]
    size: float
    domain: Domain
    clustering: float
    seed: tuple[int, ...]


@lru_cache(maxsize=MOST_KEPT)
def _clumped_again(pixels: bytes, shape: tuple[int, ...], kind: str, own: _Own) -> np.ndarray:
    """What :func:`_clumped` made of a density, also for the next problems: most edits leave densities of most classes as they are."""
    density = _clumped(np.frombuffer(pixels, kind).reshape(shape), own)
    density.setflags(write=False)
    return density


def _clumped(image: np.ndarray, own: _Own) -> np.ndarray:
    """A density with clumps, float32, shape ``own.shape``."""
    times = [many // few for many, few in zip(own.shape, image.shape, strict=True)]
    fine = np.repeat(np.repeat(image.astype(np.float64), times[0], axis=0), times[1], axis=1)
    grid = _grid(own.domain, own.shape)
    clumped = fine * _factor(own)
    share = share_at_large(fine, grid.pixel, own.size)
    return as_dense_at_large(fine, clumped, grid, WAVELENGTH * own.size, share).astype(np.float32)


def clump_size_of(asked: float, domain: Domain, body_count: int, share: float) -> float:
    """Diameter of the clumps of a class [m] that stands on so large a :func:`share <occupied>` of a domain.

    Where none is ``asked`` for it follows from the class's spacing, in steps, but an image that shows them has no more than about
    so many pixels.
    """
    if asked:
        return asked
    over_domain = SPACINGS * math.sqrt(domain.area / max(body_count, 1))
    shown = PIXELS_PER_CLUMP * max(domain.size) / LONG_SIDE
    size = max(over_domain * math.sqrt(share), min(over_domain, shown))
    return float(SIZE_STEP ** round(math.log(size) / math.log(SIZE_STEP)))


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
    required, available = memory_of_clumps((rows, columns), size, domain), machine_memory()
    if available is not None and required > available:
        raise ProblemError(
            f'`clump_size` of class "{name}" is too small ({size:.3g} m): its density would have {columns} x {rows} pixels and take '
            f"about {format_bytes(required)} of memory, and this machine has {format_bytes(available)}",
            Refusal(Reason.MEMORY_FOR_CLUMPS, required, available, (name, "")),
        )
    return rows, columns


def memory_of_clumps(shape: Sequence[int], size: float, domain: Domain) -> int:
    """Estimate what making clumps takes at its peak [bytes].

    Args:
        shape: Height and width of the image that shows the clumps.
        size: Their diameter [m].
        domain: Where.
    """
    at_large = memory_at_large(shape, _grid(domain, shape), WAVELENGTH * size)
    return BYTES_PER_PIXEL_OF_CLUMPS * shape[0] * shape[1] + at_large


def _factor(own: _Own) -> np.ndarray:
    """What a density is multiplied by at an image's pixels: clumps, and nothing of longer waves."""
    count = [_length_of_transform(math.ceil(PIXELS_PER_CLUMP * length / own.size)) for length in own.domain.size[::-1]]
    make = _coarse_factor_again if math.prod(count) <= MOST_PIXELS_KEPT else _coarse_factor
    factor, wraps = make((count[0], count[1]), own._replace(shape=(0, 0))), own.domain.periodic
    return stretched(stretched(factor, own.shape[0], wraps).T, own.shape[1], wraps).T


def _coarse_factor(count: tuple[int, int], own: _Own) -> np.ndarray:
    """The same at as many pixels as clumps need."""
    grid = _grid(own.domain, count)
    waves = waves_by_number(count, grid, own.size, list(own.seed))
    return clump_factor(waves / _not_nothing(float(waves.std())), grid, own.size, own.clustering, measured=True)


# For the next problems, too: a brush changes a density, and not what it is multiplied by.
_coarse_factor_again = lru_cache(maxsize=MOST_KEPT)(_coarse_factor)


def _grid(domain: Domain, shape: Sequence[int]) -> Grid:
    """What the pixels of an image of a shape are that lies over a domain."""
    return Grid([length / many for length, many in zip(domain.size[::-1], shape, strict=True)], domain.periodic)


def waves_by_number(shape: Sequence[int], grid: Grid, size: float, seed: list[int]) -> np.ndarray:
    """Return a random field of waves as long as clumps are apart, shape ``[height, width]``; of any standard deviation.

    How strong a wave is, and its phase, follow from how often it goes into the domain. So a little more or less of ``size``, as an
    edit makes it that changes how many bodies there are, shifts all waves' weights a little, and clumps stay where they are.

    Args:
        shape: Of the field.
        grid: What its pixels are.
        size: Diameter of a clump [m].
        seed: From which the waves follow.
    """
    band = _band(shape, grid, size)
    row, column = np.flatnonzero(band.any(axis=1)), np.flatnonzero(band.any(axis=0))
    # Of waves that wrap the second half of the rows goes the other way.
    times = np.where(row <= shape[0] // 2, row, row - shape[0]) if grid.wraps else row
    number = (times[:, None] + NUMBERS // 2) * NUMBERS + column
    # Normally distributed (Box and Muller, 1958).
    radius = np.sqrt(-2.0 * np.log1p(-random_shares(number, [*seed, 0])))
    angle = (2.0 * math.pi) * random_shares(number, [*seed, 1])
    strength = radius * np.cos(angle) if not grid.wraps else radius * np.exp(1j * angle)
    if grid.wraps:
        # Those across alone stand twice in the spectrum, and add up to one.
        strength[:, column == 0] *= math.sqrt(2.0)
    spectrum = np.zeros(band.shape, strength.dtype)
    spectrum[np.ix_(row, column)] = strength
    spectrum *= band
    return np.fft.irfft2(spectrum, shape) if grid.wraps else from_cosines(spectrum)


def waves_of_noise(noise: np.ndarray, grid: Grid, size: float) -> np.ndarray:
    """Return of noise the waves as long as clumps are apart, of its shape; of standard deviation 1 on average.

    Parts of a larger field agree where their noise does.

    Args:
        noise: Random numbers of which none depends on another, of mean 0 and standard deviation 1, shape ``[height, width]``.
        grid: What the pixels are.
        size: Diameter of a clump [m].
    """
    band = _band(noise.shape, grid, size)
    return filter_waves(noise, band, grid.wraps) / _not_nothing(math.sqrt(float((band**2).mean())))


def clump_factor(waves: np.ndarray, grid: Grid, size: float, clustering: float, *, measured: bool) -> np.ndarray:
    """Return what a density is multiplied by so that it has clumps, shape ``[height, width]``.

    Args:
        waves: Where it is dense: a random field of that shape, of mean 0 and standard deviation 1.
        grid: What the pixels are.
        size: Diameter of a clump [m].
        clustering: How strong clumps are.
        measured: Whether the mean of what comes of the waves is measured; otherwise it is what it is on average, so that parts of a
            larger field agree.
    """
    factor = np.exp(CONTRAST * clustering * np.clip(waves, -HIGHEST, HIGHEST))
    factor /= factor.mean() if measured else _mean_factor(CONTRAST * clustering)
    low, high = LOWEST_WAVES
    # In place, as all of this: grids may have millions of pixels.
    wave = _wave_numbers(waves.shape, grid, size)
    kept = np.clip((wave - low) / (high - low), 0.0, 1.0, out=wave)
    kept *= kept * (3.0 - 2.0 * kept)
    for _ in range(min(TIMES, max(FEWEST_TIMES, PIXELS_IN_ALL // factor.size))):
        # What is cut off below has long waves again, though fewer.
        factor = 1.0 + filter_waves(np.maximum(factor, LEAST_FACTOR) - 1.0, kept, grid.wraps)
    return np.maximum(factor, 0.5 * LEAST_FACTOR)


def _wave_numbers(shape: Sequence[int], grid: Grid, size: float) -> np.ndarray:
    """Wave numbers of a transform's waves, over that of clumps."""
    (rows, columns), (pixel, wraps) = shape, grid
    if wraps:
        wave = np.hypot(np.fft.fftfreq(rows, pixel[0])[:, None], np.fft.rfftfreq(columns, pixel[1])[None, :])
    else:
        # What does not wrap goes on as in mirrors, and is made of cosines: clumps at an edge are whole ones.
        along_y, along_x = (0.5 * np.arange(many) / (many * step) for many, step in zip(shape, pixel, strict=True))
        wave = np.hypot(along_y[:, None], along_x[None, :])
    wave *= WAVELENGTH * size
    return wave


def _band(shape: Sequence[int], grid: Grid, size: float) -> np.ndarray:
    """How strong a transform's waves are: those about as long as clumps are apart, and none that are far from it."""
    away = np.abs(_wave_numbers(shape, grid, size) - 1.0) / BAND
    band = np.where(away < WIDTHS_OF_BAND, np.exp(-0.5 * away**2), 0.0)
    band[0, 0] = 0.0
    return band


def _not_nothing(deviation: float) -> float:
    """Standard deviation to divide by: where the domain is smaller than a clump there is next to nothing."""
    return max(deviation, 1e-9)


def _mean_factor(contrast: float) -> float:
    """Mean of what a density is multiplied by, where waves are normally distributed but for their peaks."""
    step = 1e-3
    wave = np.arange(-8.0, 8.0, step)
    weight = np.exp(-0.5 * wave**2) * (step / math.sqrt(2.0 * math.pi))
    return float((weight * np.exp(contrast * np.clip(wave, -HIGHEST, HIGHEST))).sum())


def _length_of_transform(least: int) -> int:
    """Pixels along a side: so many; of many the next number that is fast."""
    return max(least, 4) if least <= LONG_SIDE else fast_length(least)
