"""Values on a grid: their cosine transforms, and filters by the length of their waves."""

from __future__ import annotations

import numpy as np

__all__ = ["filter_waves", "from_cosines", "to_cosines"]


def filter_waves(values: np.ndarray, kept: np.ndarray, wraps: bool) -> np.ndarray:
    """Values on a grid times a function of their waves; they wrap, or go on as in mirrors."""
    if wraps:
        return np.fft.irfft2(np.fft.rfft2(values) * kept, values.shape)
    spectrum = to_cosines(values)
    spectrum *= kept
    return from_cosines(spectrum)


def to_cosines(values: np.ndarray) -> np.ndarray:
    """Discrete cosine transform of a grid along both axes (type II)."""
    return _cosines(_cosines(values).T).T


def from_cosines(spectrum: np.ndarray) -> np.ndarray:
    """What :func:`to_cosines` made a spectrum of."""
    return _from_cosines(_from_cosines(spectrum).T).T


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
