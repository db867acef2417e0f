"""Filters of density images: Gaussian blur, unsharp masking."""

from __future__ import annotations

import math

import numpy as np

__all__ = ["gaussian_blur", "unsharp_mask"]

# Standard deviations after which the Gaussian is cut.
TRUNCATE = 4.0


def gaussian_blur(image: np.ndarray, sigma: float) -> np.ndarray:
    """Convolve with a Gaussian; the image is reflected at its borders, so that a constant stays one.

    Args:
        image: Shape ``[height, width]``.
        sigma: Standard deviation [pixels], > 0; beyond the image's extent it is the mean.

    Returns:
        Blurred image, float64.
    """
    result = np.asarray(image, dtype=np.float64)
    for axis in (0, 1):
        result = _blur_rows(result.swapaxes(0, axis), sigma).swapaxes(0, axis)
    return result


def unsharp_mask(image: np.ndarray, amount: float, radius: float) -> tuple[np.ndarray, float]:
    """Enhance edges: ``image + amount * (image - blurred)``, clipped at 0.

    Args:
        image: Density, shape ``[height, width]``.
        amount: Strength.
        radius: Standard deviation of the blur [pixels].

    Returns:
        The sharpened density, float64, and the share of its pixels that would have been negative.
    """
    image = np.asarray(image, dtype=np.float64)
    sharpened = image + amount * (image - gaussian_blur(image, radius))
    # What only rounding puts below zero is no loss.
    negative = sharpened < -1e-9 * max(float(image.max()), 1e-300)
    return np.maximum(sharpened, 0.0), float(negative.mean())


def _blur_rows(image: np.ndarray, sigma: float) -> np.ndarray:
    """Blur along the first axis, through the cosine transform that reflecting borders amount to, or directly if it is short."""
    count = len(image)
    reach = min(math.ceil(TRUNCATE * sigma), 8 * count)
    weight = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    weight /= weight.sum()
    index = np.arange(-reach, count + reach)
    # ... c b a | a b c ... x y z | z y x ...
    index = np.mod(index, 2 * count)
    index = np.where(index >= count, 2 * count - 1 - index, index)
    if reach <= 24:
        padded = image[index]
        return sum(w * padded[k : k + count] for k, w in enumerate(weight))
    mirrored = np.concatenate([image, image[::-1]])
    kernel = np.zeros(2 * count)
    np.add.at(kernel, np.arange(-reach, reach + 1) % (2 * count), weight)
    spectrum = np.fft.rfft(mirrored, axis=0) * np.fft.rfft(kernel)[:, None]
    return np.fft.irfft(spectrum, 2 * count, axis=0)[:count]
