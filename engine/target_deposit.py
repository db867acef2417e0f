"""Target densities on the nodes of a mesh, on the device: what the charges of a perfect placement would deposit there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from . import kernels_density
from .density import FOLD, spline_bands
from .device import Launcher
from .mesh_layout import MeshLayout

__all__ = ["deposit_images", "mix_images"]


def deposit_images(launcher: Launcher, images: Sequence[np.ndarray], layout: MeshLayout) -> wp.array:
    """Deposit images with cubic B-splines, exactly for piecewise constant pixels.

    Args:
        launcher: Where to run.
        images: Densities, each of shape ``[height, width]``, row 0 at the top.
        layout: The mesh.

    Returns:
        Share of every image's integral at every node, flat, one image after the other.
    """
    device = launcher.device
    rows, columns = layout.shape
    result = wp.empty(len(images) * layout.node_count, dtype=float, device=device)
    fold = FOLD if layout.periodic else 0
    for index, image in enumerate(images):
        height, width = image.shape
        upright = np.asarray(image[::-1], dtype=np.float64)
        source = wp.array((upright / upright.sum()).astype(np.float32).ravel(), dtype=float, device=device)
        bands = spline_bands(image.shape, layout.size, layout.shape, layout.spacing, layout.margin, layout.periodic)
        on_rows = wp.empty(rows * width, dtype=float, device=device)
        target = wp.array(
            ptr=result.ptr + 4 * index * layout.node_count, shape=(layout.node_count,), dtype=float, device=device
        )
        for along, (band, given, shape, made, made_shape) in enumerate(
            (
                (bands[0], source, (height, width), on_rows, (rows, width)),
                (bands[1], on_rows, (rows, width), target, (rows, columns)),
            )
        ):
            first, weight = band
            launcher.launch(
                kernels_density.apply_band,
                made_shape[0] * made_shape[1],
                [
                    given,
                    *shape,
                    wp.array(first, dtype=wp.int32, device=device),
                    wp.array(weight.ravel(), dtype=float, device=device),
                    weight.shape[1],
                    fold,
                    along,
                    *made_shape,
                ],
                [made],
            )
    return result


def mix_images(launcher: Launcher, deposited: wp.array, weight: np.ndarray, node_count: int) -> wp.array:
    """Sums of deposited images with the weights of every row, shape ``[rows, images]``; flat, one row after the other."""
    device = launcher.device
    rows, images = weight.shape
    result = wp.empty(rows * node_count, dtype=float, device=device)
    launcher.launch(
        kernels_density.mix_images,
        rows * node_count,
        [deposited, wp.array(weight.ravel(), dtype=float, device=device), images, node_count],
        [result],
    )
    return result
