"""Running a kernel on NumPy arrays, and asking where a mesh of them is near."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from typing import Any

import numpy as np
import warp as wp

from ..device.devices import resolve_device
from ..device.launcher import Launcher

__all__ = ["launch_on_cpu", "mesh_on_cpu"]


def launch_on_cpu(kernel: wp.Kernel, count: int, inputs: Sequence[Any], outputs: Sequence[np.ndarray]) -> None:
    """Run ``kernel`` for the elements ``0 .. count - 1``, on all cores; it reads and writes the arrays' own memory."""
    with closing(Launcher(resolve_device("cpu"))) as launcher:
        launcher.launch(kernel, count, inputs, outputs)


def mesh_on_cpu(corner: np.ndarray, *, winding: bool = False) -> wp.Mesh:
    """Make a mesh of triangles ``[t, 3, 3]``; with ``winding`` it can be asked what lies inside."""
    vertex = np.ascontiguousarray(corner, np.float32).reshape(-1, 3)
    return wp.Mesh(
        wp.array(vertex, dtype=wp.vec3, device="cpu"),
        wp.array(np.arange(len(vertex), dtype=np.int32), dtype=wp.int32, device="cpu"),
        support_winding_number=winding,
    )
