"""Values on a grid: their cosine transforms, filters by the length of their waves, and values between them."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

__all__ = ["fast_length", "filter_waves", "from_cosines", "linear_places", "stretched", "to_cosines"]

# Rows that are transformed at once: threads take them one after the other, and what comes of each does not depend on the others.
ROWS_AT_ONCE = 128


def filter_waves(values: np.ndarray, kept: np.ndarray, wraps: bool) -> np.ndarray:
    """Values on a grid ``[rows, columns]`` times a function of their waves; they wrap, or go on as in mirrors.

    ``kept`` is that function as the transform has its waves: of ``rfft2`` where they wrap, else of :func:`to_cosines`.
    """
    if wraps:
        return np.fft.irfft2(np.fft.rfft2(values) * kept, values.shape)
    spectrum = to_cosines(values)
    spectrum *= kept
    return from_cosines(spectrum)


def to_cosines(values: np.ndarray, threads: int = 1) -> np.ndarray:
    """Discrete cosine transform of a grid along both axes (type II), of its shape; the same for any number of threads."""
    return _by_rows(_cosines, _by_rows(_cosines, values, threads).T, threads).T


def from_cosines(spectrum: np.ndarray, threads: int = 1) -> np.ndarray:
    """What :func:`to_cosines` made a spectrum of."""
    return _by_rows(_from_cosines, _by_rows(_from_cosines, spectrum, threads).T, threads).T


def fast_length(least: int) -> int:
    """The next number whose prime factors are 2, 3 and 5."""
    powers = (2**two * 3**three * 5**five for two in range(14) for three in range(9) for five in range(6))
    return min(number for number in powers if number >= least)


def linear_places(many: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Which of the middles of ``many`` pixels is before that of each of ``count``, from -1 on, and the way on from it, in pixels.

    Both have the shape ``[count]``.
    """
    place = (np.arange(count) + 0.5) * (many / count) - 0.5
    low = np.floor(place).astype(np.int64)
    return low, place - low


def stretched(values: np.ndarray, count: int, wraps: bool) -> np.ndarray:
    """Values ``[many, columns]`` at ``count`` places along the rows, linearly between middles; they wrap, or go on as they end."""
    many = len(values)
    low, share = linear_places(many, count)
    below, above = (low % many, (low + 1) % many) if wraps else (np.maximum(low, 0), np.minimum(low + 1, many - 1))
    return (1.0 - share)[:, None] * values[below] + share[:, None] * values[above]


def _by_rows(transform: Callable[[np.ndarray], np.ndarray], values: np.ndarray, threads: int) -> np.ndarray:
    """Transform rows, several threads some each; one alone, too, takes no more at once than its cache holds."""
    if len(values) <= ROWS_AT_ONCE:
        return transform(values)
    result = np.empty(values.shape)

    def make(first: int) -> None:
        result[first : first + ROWS_AT_ONCE] = transform(np.ascontiguousarray(values[first : first + ROWS_AT_ONCE]))

    starts = range(0, len(values), ROWS_AT_ONCE)
    if threads < 2:
        for first in starts:
            make(first)
        return result
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(make, starts):
            pass
    return result


def _cosines(values: np.ndarray) -> np.ndarray:
    """Cosine transform along the last axis, by one Fourier transform of the same length (Makhoul 1980, A fast cosine transform)."""
    many = values.shape[-1]
    waves = np.fft.rfft(np.concatenate([values[:, ::2], values[:, 1::2][:, ::-1]], axis=-1)) * _turns(many)
    result = np.empty(values.shape)
    result[:, : many // 2 + 1] = waves.real
    result[:, many // 2 + 1 :] = -waves.imag[:, 1 : (many + 1) // 2][:, ::-1]
    return result


def _from_cosines(spectrum: np.ndarray) -> np.ndarray:
    """What :func:`_cosines` made a spectrum of."""
    many = spectrum.shape[-1]
    waves = np.empty((len(spectrum), many // 2 + 1), np.complex128)
    waves.real = spectrum[:, : many // 2 + 1]
    waves.imag[:, 0] = 0.0
    waves.imag[:, 1:] = -spectrum[:, : (many - 1) // 2 : -1]
    waves *= np.conj(_turns(many))
    values = np.fft.irfft(waves, many)
    result = np.empty_like(values)
    result[:, ::2], result[:, 1::2] = values[:, : (many + 1) // 2], values[:, (many + 1) // 2 :][:, ::-1]
    return result


def _turns(many: int) -> np.ndarray:
    return np.exp(-0.5j * np.pi * np.arange(many // 2 + 1) / many)
