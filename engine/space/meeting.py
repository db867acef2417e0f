"""Which bodies keep apart, for kernels."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..device.launcher import Launcher
from .kernels_meeting import Meeting

__all__ = ["meeting_of"]


def meeting_of(launcher: Launcher, class_index: np.ndarray | None, apart: np.ndarray | None) -> Meeting:
    """Return which of some bodies keep apart.

    Args:
        launcher: Where to run.
        class_index: Of every body, shape ``[n]``; asked for where ``apart`` is given.
        apart: Which classes keep apart, shape ``[classes, classes]``, bool; None where all do.
    """
    result = Meeting()
    if apart is None or class_index is None:
        result.of_body, result.apart = launcher.zeros(1, wp.int32), launcher.zeros(1, wp.int32)
        return result
    result.of_body = launcher.array(class_index.astype(np.int32), wp.int32)
    result.apart = launcher.array(apart.astype(np.int32).ravel(), wp.int32)
    result.classes = len(apart)
    return result
