"""The least and the largest of many numbers on a device, of which the host gets those of blocks."""

from __future__ import annotations

import warp as wp

from . import kernels_extremes
from .launcher import Launcher

__all__ = ["extremes"]

# Numbers that one element goes through: enough for a thread of the CPU; a GPU has many more elements at once.
BLOCK_ON_CPU, BLOCK_ON_GPU = 16384, 256


def extremes(launcher: Launcher, values: wp.array) -> tuple[float, float]:
    """Return the least and the largest of some floats, at least one and none of them NaN."""
    block = BLOCK_ON_GPU if launcher.device.is_cuda else BLOCK_ON_CPU
    found = launcher.empty(-(-len(values) // block), wp.vec2)
    launcher.launch(kernels_extremes.find_extremes, len(found), [values, block], [found], grain=1)
    of_blocks = found.numpy()
    return float(of_blocks[:, 0].min()), float(of_blocks[:, 1].max())
