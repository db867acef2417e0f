"""Which parts of a surface are one sheet, for the report: those that bodies are placed on as on one."""

from __future__ import annotations

import math

import numpy as np

from ..device.launcher import Launcher
from ..problem.surface import Surface
from ..surface.parts import joined_parts
from ..surface.relations import Relations

__all__ = ["sheets_of"]


def sheets_of(surface: Surface, count: int, launcher: Launcher) -> tuple[np.ndarray, Relations]:
    """Return a number for every triangle, shape ``[t]``, and which of these stand on one another.

    Bodies on triangles of other numbers do not overlap, however near.

    Args:
        surface: The surface.
        count: Number of bodies, whose mean spacing says how near borders are that meet.
        launcher: Where to run.
    """
    if surface.part.max() == surface.part.min():
        return surface.part, Relations()
    parts = joined_parts(launcher, surface, math.sqrt(surface.area / count))
    return parts.label, parts.relations
