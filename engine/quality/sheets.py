"""Which parts of a surface are one sheet, for the report: those that bodies are placed on as on one."""

from __future__ import annotations

import math

import numpy as np

from ..device.launcher import Launcher
from ..problem.surface import Surface
from ..surface.parts import joined_parts

__all__ = ["sheets_of"]


def sheets_of(surface: Surface, count: int, launcher: Launcher) -> np.ndarray:
    """Return a number for every triangle, shape ``[t]``: bodies on triangles of different numbers do not overlap, however near.

    Args:
        surface: The surface.
        count: Number of bodies, whose mean spacing says how near borders are that meet.
        launcher: Where to run.
    """
    if surface.part.max() == surface.part.min():
        return surface.part
    return joined_parts(launcher, surface, math.sqrt(surface.area / count))[0]
