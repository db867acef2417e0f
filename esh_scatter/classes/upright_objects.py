"""Which objects stand upright on slopes, as trees do, and which lie on them: by how high and how wide they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
import numpy as np

from ...engine.errors import ProblemError
from .object_outline import outline_of, read_source

if TYPE_CHECKING:
    from ...engine.surface.mesh_outline import Outline
    from ...engine.surface.triangle_mesh import TriangleMesh

__all__ = ["align_of", "align_where", "is_upright"]


def is_upright(mesh: TriangleMesh, outline: Outline) -> bool:
    """Tell whether something is taller than it is wide, as a tree is and a plank is not."""
    # Cards with grass on them stand, however wide they are.
    return outline.is_around or float(np.ptp(mesh.position[:, 2])) > max(outline.length, outline.width)


def align_where(upright: bool) -> float:
    """Return how much objects follow the slope: trees stand upright; what lies, lies on it."""
    return 0.0 if upright else 1.0


def align_of(item: bpy.types.Object | bpy.types.Collection, context: bpy.types.Context) -> float | None:
    """Return how much an object, or a collection as one, follows the slope; None where it takes no ground."""
    try:
        mesh = read_source(item, context, "`area`")
        return align_where(is_upright(mesh, outline_of(mesh, "`area`")))
    except ProblemError:
        return None
