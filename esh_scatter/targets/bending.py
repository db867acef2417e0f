"""Whether a target bends, and is another mesh in renders than in the viewport."""

from __future__ import annotations

import bpy

from .subdivision import DIVIDES, FURTHER, levels

__all__ = ["bends_alone_in_renders"]

# Modifiers that do not bend a mesh.
_STIFF = (*DIVIDES, "ARRAY", "BEVEL", "DECIMATE", "MIRROR", "SOLIDIFY", "TRIANGULATE", "UV_PROJECT", "UV_WARP", "WELD")


def bends_alone_in_renders(target: bpy.types.Object, render: bpy.types.RenderSettings, placed_at: int | None) -> bool:
    """Tell whether a target bends in renders without what stands on it: there it has more vertices, or fewer.

    Args:
        target: What objects stand on.
        render: Of the scene.
        placed_at: To which level it was subdivided when that was placed, which knows finer ones; None where it does not.
    """
    if target.type != "MESH":
        return False
    found = levels(target, render)
    apart = [one for one in found if one[0] != one[1]]
    if not apart:
        return False
    bends = target.data.shape_keys is not None or any(m.show_render and m.type not in _STIFF for m in target.modifiers)
    # Only the last one that divides may do so to another level than then.
    known = placed_at is not None and apart == found[-1:] and placed_at <= found[-1][1] <= placed_at + FURTHER
    return bends and not known
