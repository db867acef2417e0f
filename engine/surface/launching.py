"""Running a kernel on NumPy arrays."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from typing import Any

import numpy as np
import warp as wp

from ..device.devices import resolve_device
from ..device.launcher import Launcher

__all__ = ["launch_on_cpu"]


def launch_on_cpu(kernel: wp.Kernel, count: int, inputs: Sequence[Any], outputs: Sequence[np.ndarray]) -> None:
    """Run ``kernel`` for the elements ``0 .. count - 1``, on all cores; it reads and writes the arrays' own memory."""
    with closing(Launcher(resolve_device("cpu"))) as launcher:
        launcher.launch(kernel, count, inputs, outputs)
