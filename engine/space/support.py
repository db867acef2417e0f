"""Density images on the device, and ways between their empty pixels and the support: where the density is above zero."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from . import kernels_images, kernels_support

__all__ = ["depth_in_support", "images_for_kernels", "nearest_in_support", "vectors_to_support"]

# Of an image that a thread takes at least.
COLUMNS = 16
# Rows of pixels whose ways are looked at together.
ROWS = 16


def images_for_kernels(
    launcher: Launcher,
    images: Sequence[np.ndarray],
    size: tuple[float, float],
    *,
    to_support: bool = True,
    step: float = 0.0,
) -> kernels_images.Images:
    """Put the density images of all classes on the device, if asked with the vectors to the support.

    Args:
        launcher: Where to.
        images: One per class, shape ``[height, width]``; what several classes share is there once.
        size: Extent of the domain, in the unit that the vectors are to have.
        to_support: Whether anybody wants to leave empty pixels.
        step: Distance of the points of a line that are looked at, in that unit; 0 for its charges only.
    """
    distinct = list({id(image): image for image in images}.values())
    index = np.array([[id(image) for image in distinct].index(id(image)) for image in images])
    first = np.concatenate([[0], np.cumsum([image.size for image in distinct])])
    result = kernels_images.Images()
    result.step = step
    result.pixel = launcher.array(np.concatenate([image.ravel() for image in distinct]), float)
    result.to_support = launcher.zeros(int(first[-1]) if to_support else 1, wp.vec2)
    # Densities differ more often than where they are above zero: behind one obstacle, all of them are so in the same pixels.
    known: dict[tuple[tuple[int, ...], bytes], int] = {}
    for image, start in zip(distinct, first[:-1].tolist(), strict=True):
        if not to_support:
            break
        supported = image > 0.0
        if not supported.all():
            key = image.shape, np.packbits(supported).tobytes()
            ways, at = result.to_support, known.setdefault(key, start)
            if at == start:
                ways, at = vectors_to_support(launcher, image, size), 0
            wp.copy(result.to_support, ways, dest_offset=start, src_offset=at, count=image.size)
    result.start = launcher.array(first[:-1][index].astype(np.int32), wp.int32)
    result.height = launcher.array(np.array([image.shape[0] for image in images], np.int32), wp.int32)
    result.width = launcher.array(np.array([image.shape[1] for image in images], np.int32), wp.int32)
    return result


def vectors_to_support(launcher: Launcher, image: np.ndarray, size: tuple[float, float]) -> wp.array:
    """Return the vector from every pixel's center to that of the nearest in the support, ``wp.vec2``, shape ``[height * width]``.

    x to the right, y up; 0 in the support, and everywhere where there is none.
    """
    height, width = image.shape
    pixel_size = wp.vec2d(size[0] / width, size[1] / height)
    pixels = launcher.array(image.ravel(), float)
    nearest = launcher.empty(image.size, wp.int32)
    # Columns beside each other share lines of the cache.
    launcher.launch(kernels_support.find_nearest_rows, width, [height, width, pixels], [nearest], grain=COLUMNS)
    vector = launcher.empty(image.size, wp.vec2)
    launcher.launch(kernels_support.find_vectors, height, [width, pixel_size, nearest], [vector], grain=1)
    return vector


def nearest_in_support(
    launcher: Launcher, image: np.ndarray, size: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the flat index of the pixel of the support that is nearest to each, and how far it is; both of the image's shape."""
    height, width = image.shape
    way = vectors_to_support(launcher, image, size).numpy().reshape(height, width, 2)
    nearest, away = np.empty(image.shape, int), np.empty(image.shape, way.dtype)
    # A few rows at a time, which stay in the processor's cache.
    for first in range(0, height, ROWS):
        some = slice(first, first + ROWS)
        right, up = way[some, :, 0], way[some, :, 1]
        row = np.arange(height)[some, None] - np.rint(up / (size[1] / height)).astype(int)
        column = np.arange(width) + np.rint(right / (size[0] / width)).astype(int)
        nearest[some] = np.clip(row, 0, height - 1) * width + np.clip(column, 0, width - 1)
        np.hypot(right, up, out=away[some])
    return nearest, away


def depth_in_support(launcher: Launcher, image: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """Return the distance from every pixel's center to that of the nearest empty one, in the unit of ``size``, shape as the image's.

    It is 0 in empty pixels, and infinite where there are none.
    """
    empty = image <= 0.0
    if not empty.any():
        return np.full(image.shape, math.inf)
    return np.hypot(*vectors_to_support(launcher, empty.astype(np.float32), size).numpy().T).reshape(image.shape)
