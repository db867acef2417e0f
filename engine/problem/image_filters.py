"""Filters of density images: Gaussian blur, unsharp masking, luminance."""

from __future__ import annotations

import math

import numpy as np

__all__ = ["LUMINANCE", "gaussian_blur", "local_range", "luminance", "unsharp_mask"]

# Red, green and blue of Rec. 709, the primaries of sRGB and of Blender's default color space.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

# Standard deviations after which the Gaussian is cut, where it is summed directly.
TRUNCATE = 4.0
# Below this many pixels on either side a direct sum is the faster way. It is also the only right one for narrow Gaussians, whose
# samples have another spectrum than the Gaussian itself.
LONGEST_DIRECT_REACH = 12
# A sharpened value goes at most this share of the way to the smallest or the largest one around it, so far around over the radius of
# the sharpening. That is what makes edges steeper. At the foot of an edge it makes the halo: there what is around differs little, and
# what is a few times as far around differs much. So all of the way is gone where the first range is at least the second of these
# shares of the other, and none where it is less than the first. Measured two pixels on the bright side of the strongest hundredth of
# the edges of nine photographs, with a radius of 2 and an amount of 1.5: densities there fall by up to 0.02, as far as 0.035 without
# regard to what is farther around, by 0.07 to 0.1 without limits; edges are as steep as without that regard.
SHARE_OF_RANGE, RANGE_OVER_RADIUS = 0.6, 0.34
FARTHER_AROUND, FOOT_OF_EDGE = 3, (0.3, 0.8)
# Bytes of the rows that are blurred at once: with their intermediate results they stay in a processor's cache.
BLOCK_BYTES = 1 << 20
# exp(-0.5 * x²) is below 1e-300 beyond, and x² must not overflow.
LARGEST_EXPONENT = 37.0


def luminance(color: np.ndarray) -> np.ndarray:
    """Weighted sum of red, green and blue, shape ``[...]``, of colors of shape ``[..., 3 or more]``."""
    return color[..., :3] @ LUMINANCE.astype(np.float32)


def gaussian_blur(image: np.ndarray, sigma: float) -> np.ndarray:
    """Convolve with a Gaussian; the image is reflected at its borders, so that a constant stays one.

    Args:
        image: Shape ``[height, width]``.
        sigma: Standard deviation [pixels], > 0; far beyond the image's extent the result is the mean.

    Returns:
        Blurred image, float64. What the image holds is neither lost nor added to: the mean stays the same.
    """
    image = np.asarray(image, dtype=np.float64)
    # Along x, and along y as x of the transposed image.
    return np.ascontiguousarray(_blur_rows(_blur_rows(image, sigma).T, sigma).T)


def unsharp_mask(image: np.ndarray, amount: float, radius: float, overshoot: float = 0.0) -> tuple[np.ndarray, float]:
    """Enhance edges: ``image + amount * (image - blurred)``, within the range of what is nearby, clipped at 0.

    Args:
        image: Density, shape ``[height, width]``.
        amount: Strength.
        radius: Standard deviation of the blur [pixels].
        overshoot: Share that is kept of what lies beyond that range, 0..1: the halos beside edges.

    Returns:
        The sharpened density, float64, and the share of its pixels that would have been negative.
    """
    image = np.asarray(image, dtype=np.float64)
    sharpened = image + amount * (image - gaussian_blur(image, radius))
    if overshoot < 1.0:
        low, high = _limits(image, max(1, round(RANGE_OVER_RADIUS * min(radius, max(image.shape)))))
        within = np.clip(sharpened, low, high)
        sharpened = within + overshoot * (sharpened - within)
    # What only rounding puts below zero is no loss.
    negative = sharpened < -1e-9 * max(float(image.max()), 1e-300)
    return np.maximum(sharpened, 0.0), float(negative.mean())


def _limits(image: np.ndarray, reach: int) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest value that a pixel may have when it is sharpened; see :data:`SHARE_OF_RANGE`."""
    low, high = local_range(image, reach)
    lowest, highest = local_range(image, FARTHER_AROUND * reach)
    varies = highest > lowest
    on_edge = np.divide(high - low, highest - lowest, out=np.zeros_like(image), where=varies)
    none, whole = FOOT_OF_EDGE
    share = np.clip((on_edge - none) / (whole - none), 0.0, 1.0)
    share *= SHARE_OF_RANGE * share * (3.0 - 2.0 * share)
    return image + share * (low - image), image + share * (high - image)


def local_range(image: np.ndarray, reach: int) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest value in the square around every pixel that reaches so many pixels beyond it; images of its shape."""
    return tuple(  # type: ignore[return-value]
        _extreme_of_rows(_extreme_of_rows(image, reach, extreme).T, reach, extreme).T
        for extreme in (np.minimum, np.maximum)
    )


def _extreme_of_rows(image: np.ndarray, reach: int, extreme: np.ufunc) -> np.ndarray:
    """Smallest or largest value in a window along the second axis."""
    count = image.shape[1]
    reach = min(reach, count - 1)
    result = np.pad(image, ((0, 0), (reach, reach)), mode="edge")
    # Windows twice as wide from two that overlap, until they are as wide as they are to be.
    width = 1
    while width < 2 * reach + 1:
        step = min(width, 2 * reach + 1 - width)
        result = extreme(result[:, : result.shape[1] - step], result[:, step:])
        width += step
    return result


def _blur_rows(image: np.ndarray, sigma: float) -> np.ndarray:
    """Blur along the second axis: ... c b a | a b c ... x y z | z y x ..."""
    count = image.shape[1]
    # The smaller is taken first: a huge sigma times a number is infinite, and has no ceiling.
    reach = math.ceil(TRUNCATE * min(sigma, LONGEST_DIRECT_REACH))
    direct = reach <= LONGEST_DIRECT_REACH
    result = np.empty(image.shape)
    rows_at_once = max(1, BLOCK_BYTES // (8 * count))
    for first in range(0, len(image), rows_at_once):
        rows = slice(first, first + rows_at_once)
        if direct:
            result[rows] = _blur_directly(image[rows], sigma, reach)
        else:
            result[rows] = _blur_by_spectrum(image[rows], sigma)
    return result


def _blur_directly(image: np.ndarray, sigma: float, reach: int) -> np.ndarray:
    count = image.shape[1]
    distance = np.minimum(np.arange(reach + 1) / max(sigma, 1e-100), LARGEST_EXPONENT)
    weight = np.exp(-0.5 * distance**2)
    weight /= weight[0] + 2.0 * weight[1:].sum()
    column = np.mod(np.arange(-reach, count + reach), 2 * count)
    padded = image[:, np.minimum(column, 2 * count - 1 - column)]
    result = weight[0] * padded[:, reach : reach + count]
    for k in range(1, reach + 1):
        both = padded[:, reach - k : reach - k + count] + padded[:, reach + k : reach + k + count]
        both *= weight[k]
        result += both
    return result


def _blur_by_spectrum(image: np.ndarray, sigma: float) -> np.ndarray:
    """Reflecting borders make every row periodic, twice as long; there a Gaussian that is not cut damps each frequency."""
    count = image.shape[1]
    spectrum = np.fft.rfft(np.concatenate([image, image[:, ::-1]], axis=1), axis=1)
    angle = 2.0 * np.pi * np.fft.rfftfreq(2 * count)
    # Divided first: a huge sigma times a number is infinite.
    damping = np.where(angle > LARGEST_EXPONENT / sigma, LARGEST_EXPONENT, angle * min(sigma, 1e100))
    spectrum *= np.exp(-0.5 * damping**2)
    return np.fft.irfft(spectrum, 2 * count, axis=1)[:, :count]
