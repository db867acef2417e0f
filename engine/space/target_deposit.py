"""Target densities on the nodes of a mesh, on the device: what the charges of a perfect placement would deposit there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from ..device.launcher import GRAIN, Launcher
from . import kernels_density
from .density import FOLD, Band, order_of_axes, overlap_bands, spline_bands
from .mesh_layout import MeshLayout
from .part import Part

__all__ = ["deposit_images", "integrate_boxes", "mix_images"]


def deposit_images(launcher: Launcher, images: Sequence[np.ndarray], layout: MeshLayout) -> wp.array:
    """Deposit images with cubic B-splines, exactly for piecewise constant pixels.

    Args:
        launcher: Where to run.
        images: Densities, each of shape ``[height, width]``, row 0 at the top; one that is there several times is worked on once.
        layout: The mesh.

    Returns:
        Share of every image's integral at every node, flat, one image after the other.
    """
    result = launcher.empty(len(images) * layout.node_count, float)
    fold = FOLD if layout.space.periodic else 0
    nodes = layout.node_count
    done: dict[int, int] = {}
    for index, image in enumerate(images):
        if id(image) in done:
            wp.copy(result, result, dest_offset=index * nodes, src_offset=done[id(image)] * nodes, count=nodes)
            continue
        done[id(image)] = index
        bands = spline_bands(
            image.shape,
            layout.whole.size,
            layout.shape,
            layout.spacing,
            layout.margin,
            layout.space.periodic,
            layout.origin,
        )
        target = wp.array(
            ptr=result.ptr + 4 * index * nodes,
            shape=(nodes,),
            dtype=float,
            device=launcher.device,
        )
        _apply_bands(launcher, image, bands, fold, layout.shape, target)
    return result


def integrate_boxes(
    launcher: Launcher, image: np.ndarray, shape: tuple[int, int], part: Part | None = None
) -> wp.array:
    """Share of an image's integral in every cell of a grid of this ``shape``, flat; see :func:`.density.box_integrals`."""
    result = launcher.empty(shape[0] * shape[1], float)
    _apply_bands(launcher, image, overlap_bands(image.shape, shape, part), 0, shape, result)
    return result


def _apply_bands(
    launcher: Launcher, image: np.ndarray, bands: list[Band], fold: int, shape: tuple[int, int], result: wp.array
) -> None:
    """Weigh an image's rows and columns into ``result``, of ``shape``; its total is 1."""
    # The weights turn it upside down and divide it, so that no pixel is copied.
    total = float(image.sum(dtype=np.float64))
    bands = [_from_top(bands[0], image.shape[0]), bands[1]]
    source = launcher.array(image.ravel(), float)
    order = order_of_axes(image.shape, shape)
    between = (shape[0], image.shape[1]) if order[0] == 0 else (image.shape[0], shape[1])
    halfway = launcher.empty(between[0] * between[1], float)
    steps = ((source, image.shape, halfway, between, total), (halfway, between, result, shape, 1.0))
    for along, (given, given_shape, made, made_shape, divisor) in zip(order, steps, strict=True):
        first, weight = bands[along]
        band = kernels_density.Band()
        band.first = launcher.array(first.astype(np.int32), wp.int32)
        band.weight = launcher.array((weight / divisor).ravel().astype(np.float32), float)
        band.reach, band.fold = weight.shape[1], fold
        _apply_band(launcher, band, along, (given, given_shape), (made, made_shape))


def _from_top(band: Band, pixels: int) -> Band:
    """A band for pixels that are counted from the other end."""
    first, weight = band
    return pixels - first - weight.shape[1], weight[:, ::-1]


def _apply_band(
    launcher: Launcher,
    band: kernels_density.Band,
    along: int,
    given: tuple[wp.array, tuple[int, ...]],
    made: tuple[wp.array, tuple[int, ...]],
) -> None:
    """Weigh an image along one axis; ``given`` and ``made`` are pixels, flat, and their rows and columns."""
    (source, (source_rows, source_columns)), (result, (rows, columns)) = given, made
    if launcher.device.is_cuda or along == 1:
        at_once = 1 if launcher.device.is_cuda else columns
        inputs = [at_once, source, source_rows, source_columns, band, along, rows, columns]
        count = rows * columns // at_once
        launcher.launch(kernels_density.apply_band, count, inputs, [result], grain=max(1, GRAIN // at_once))
    else:
        inputs = [source, source_rows, band, rows, columns]
        launcher.launch(kernels_density.add_rows, rows, inputs, [result], grain=max(1, GRAIN // columns))


def mix_images(launcher: Launcher, deposited: wp.array, weight: np.ndarray, node_count: int) -> wp.array:
    """Sums of deposited images with the weights of every row, shape ``[rows, images]``; flat, one row after the other."""
    rows, images = weight.shape
    result = launcher.empty(rows * node_count, float)
    launcher.launch(
        kernels_density.mix_images,
        rows * node_count,
        [deposited, launcher.array(weight.ravel().astype(np.float32), float), images, node_count],
        [result],
    )
    return result
