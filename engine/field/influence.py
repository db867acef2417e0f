"""Influence functions: transforms of the kernel K = -log r, smoothed, as the optimum for meshes with cubic B-splines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from ..space.mesh_layout import MeshLayout
from ..transforms.convolution import Convolution
from . import kernels_influence
from .splitting import split_variance

__all__ = ["convolution_of", "far_influence", "product_influence", "rest_influences"]

# That a launcher keeps; each has room for the transforms of its meshes. An edit needs four.
MOST_CONVOLUTIONS = 6


def convolution_of(launcher: Launcher, layout: MeshLayout, count: int) -> Convolution:
    """The convolution of so many meshes of a layout, which the next field like it uses again."""
    return launcher.kept(
        ("convolution", layout.shape, layout.padded, count),
        lambda: Convolution(launcher, layout.shape, layout.padded, count),
        MOST_CONVOLUTIONS,
    )


def far_influence(convolution: Convolution, layout: MeshLayout, cutoff: float) -> wp.array:
    """Influence function of the split's far part; see :mod:`.splitting`.

    In the open plane K has no transform of its own; that of its samples on the padded mesh, which no pair of nodes of the unpadded
    one reaches around, convolves exactly.
    """
    launcher = convolution.launcher
    if layout.space.periodic:
        influence = launcher.zeros(convolution.influence_size, float)
        waves = _waves_of(convolution, layout, 1.0 / layout.node_area)
        # The mean potential has no force.
        launcher.launch(
            kernels_influence.transform_of_far_part, waves.count_x * waves.count_y, [waves, cutoff], [influence]
        )
        return influence
    rows, columns = layout.padded
    quarter = launcher.empty((rows // 2 + 1) * columns, float)
    # A constant potential has no force. Of a kernel whose mean is near 0 little is lost to rounding.
    constant = math.log(0.4 * max(rows, columns) * layout.spacing[0])
    potential = kernels_influence.Potential(*kernels_influence.POTENTIAL)
    launcher.launch(
        kernels_influence.sample_far_part,
        len(quarter),
        [columns, layout.spacing[0], cutoff, constant, potential],
        [quarter],
    )
    influence = convolution.influence_of(quarter)
    waves = _waves_of(convolution, layout, 1.0)
    launcher.launch(kernels_influence.multiply_window, waves.count_x * waves.count_y, [waves], [influence])
    return influence


def rest_influences(
    convolution: Convolution, layout: MeshLayout, variances: Sequence[float], cutoff: float
) -> list[wp.array]:
    """Influence functions of K blurred by Gaussians of these ``variances``, less the split's far part.

    For a periodic domain, or a mesh that this kernel does not reach round.
    """
    launcher = convolution.launcher
    # Those that were made before, which the launcher may let go of meanwhile.
    known = {v: launcher.known(("rest influence", layout, v, cutoff)) for v in dict.fromkeys(variances)}
    new = [v for v, influence in known.items() if influence is None]
    if new:
        waves = _waves_of(convolution, layout, 1.0 / layout.node_area)
        made = [launcher.zeros(convolution.influence_size, float) for _ in new]
        at_zero = math.pi * (split_variance(cutoff) - np.array(new))
        launcher.launch(
            kernels_influence.transform_of_blurred_rests,
            waves.count_x * waves.count_y,
            [
                waves,
                launcher.array(np.array(new), wp.float64),
                launcher.array(at_zero, wp.float64),
                cutoff,
                convolution.influence_size,
            ],
            [launcher.array(np.array([influence.ptr for influence in made], np.uint64), wp.uint64)],
        )
        for v, influence in zip(new, made, strict=True):
            known[v] = launcher.shared(("rest influence", layout, v, cutoff), partial(_itself, influence))
    return [known[v] for v in variances]


def _itself(influence: wp.array) -> wp.array:
    return influence


def product_influence(convolution: Convolution, along_y: np.ndarray, along_x: np.ndarray) -> wp.array:
    """Influence function that is the product of one along y, shape ``[padded rows // 2 + 1]``, and one along x, as long or shorter."""
    launcher = convolution.launcher
    waves = _waves(convolution, along_y, along_x)
    influence = launcher.zeros(convolution.influence_size, float)
    launcher.launch(kernels_influence.product_of_windows, waves.count_x * waves.count_y, [waves], [influence])
    return influence


def _waves_of(convolution: Convolution, layout: MeshLayout, scale: float) -> kernels_influence.Waves:
    window_y, window_x = layout.windows()
    waves = _waves(convolution, window_y * scale, window_x)
    waves.step_y, waves.step_x = (
        2.0 * math.pi / count / spacing for count, spacing in zip(layout.padded, layout.spacing[::-1], strict=True)
    )
    return waves


def _waves(convolution: Convolution, window_y: np.ndarray, window_x: np.ndarray) -> kernels_influence.Waves:
    launcher = convolution.launcher
    waves = kernels_influence.Waves()
    waves.count_y, waves.count_x = convolution.influence_rows, convolution.influence_columns
    waves.stride_y, waves.stride_x = convolution.influence_strides
    waves.period_y = convolution.padded[0]
    waves.window_x = launcher.array(window_x.astype(np.float64), wp.float64)
    waves.window_y = launcher.array(window_y.astype(np.float64), wp.float64)
    return waves
