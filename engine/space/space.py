"""The space that bodies are in, as kernels take it."""

from __future__ import annotations

import warp as wp

from . import kernels_space

__all__ = ["space_for_kernels"]


def space_for_kernels(size: tuple[float, float], periodic: bool) -> kernels_space.Space:
    """A rectangle from (0, 0) to ``size``; see :class:`.kernels_space.Space`."""
    space = kernels_space.Space()
    space.size = wp.vec2(*size)
    space.periodic = int(periodic)
    return space
