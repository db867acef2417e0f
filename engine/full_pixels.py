"""Density images on the device, and the way from their empty pixels back to full ones."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import warp as wp

from . import kernels_update

__all__ = ["images_for_kernels", "way_to_full_pixels"]


def images_for_kernels(
    images: Sequence[np.ndarray], size: tuple[float, float], device: wp.Device
) -> kernels_update.Images:
    """Put the density images of all classes on the device, with the way out of their empty pixels.

    Args:
        images: One per class, shape ``[height, width]``.
        size: Extent of the domain, in the unit that the ways are to have.
        device: Where to.
    """
    starts = np.concatenate([[0], np.cumsum([image.size for image in images])[:-1]])
    result = kernels_update.Images()
    result.pixel = wp.array(np.concatenate([image.ravel() for image in images]), dtype=float, device=device)
    result.way = wp.array(
        np.concatenate([way_to_full_pixels(image, size).reshape(-1, 2) for image in images]),
        dtype=wp.vec2,
        device=device,
    )
    result.start = wp.array(starts, dtype=wp.int32, device=device)
    result.height = wp.array([image.shape[0] for image in images], dtype=wp.int32, device=device)
    result.width = wp.array([image.shape[1] for image in images], dtype=wp.int32, device=device)
    return result


def way_to_full_pixels(image: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """Return the vector from every empty pixel's centre to that of a nearest full one, shape ``[height, width, 2]``, float32.

    By jump flooding (Rong and Tan, Jump Flooding in GPU, 2006): x to the right, y up; 0 on full pixels. Now and then a pixel is
    told of a full one that is not quite the nearest.
    """
    height, width = image.shape
    result = np.zeros((height, width, 2), dtype=np.float32)
    full = image > 0.0
    if full.all():
        return result
    pixel_x, pixel_y = size[0] / width, size[1] / height
    row, column = np.indices((height, width), dtype=np.int32)
    # Row and column of the nearest full pixel found so far; far away where none is.
    far = np.int32(1 << 20)
    nearest_row, nearest_column = np.where(full, row, far), np.where(full, column, far)
    distance = np.where(full, 0.0, np.inf)
    step = 1 << max(0, math.ceil(math.log2(max(height, width))) - 1)
    # Two more rounds of single steps mend most of what the jumps overlooked.
    steps = [step >> k for k in range(step.bit_length())] + [1, 1]
    for jump in steps:
        for down in (-jump, 0, jump):
            for right in (-jump, 0, jump):
                if down == right == 0:
                    continue
                here, there = _shifted(height, down), _shifted(width, right)
                to = (here[0], there[0])
                candidate_row, candidate_column = nearest_row[here[1], there[1]], nearest_column[here[1], there[1]]
                d = ((candidate_row - row[to]) * pixel_y) ** 2 + ((candidate_column - column[to]) * pixel_x) ** 2
                better = (candidate_row < far) & (d < distance[to])
                nearest_row[to] = np.where(better, candidate_row, nearest_row[to])
                nearest_column[to] = np.where(better, candidate_column, nearest_column[to])
                distance[to] = np.where(better, d, distance[to])
    result[..., 0] = (nearest_column - column) * pixel_x
    result[..., 1] = -(nearest_row - row) * pixel_y
    return result


def _shifted(count: int, by: int) -> tuple[slice, slice]:
    """Slices of the elements that have a partner ``by`` further on, and of these partners."""
    by = max(-count, min(count, by))
    return slice(max(0, -by), count - max(0, by)), slice(max(0, by), count - max(0, -by))
