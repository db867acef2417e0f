"""Whether a target bends, and is another mesh in renders than in the viewport."""

from __future__ import annotations

import bpy

from .subdivision import DIVIDES, levels_apart

__all__ = ["bends_alone_in_renders"]

# Modifiers that do not bend a mesh.
_STIFF = (*DIVIDES, "ARRAY", "BEVEL", "DECIMATE", "MIRROR", "SOLIDIFY", "TRIANGULATE", "UV_PROJECT", "UV_WARP", "WELD")


def bends_alone_in_renders(target: bpy.types.Object, render: bpy.types.RenderSettings, level: int | None) -> bool:
    """Tell whether a target bends in renders without what stands on it: there it has more vertices, or fewer.

    Args:
        target: What objects stand on.
        render: Of the scene.
        level: To which level it may be subdivided there, further than in the viewport; None where it may not.
    """
    if target.type != "MESH":
        return False
    apart = levels_apart(target, render)
    bends = target.data.shape_keys is not None or any(m.show_render and m.type not in _STIFF for m in target.modifiers)
    return bends and bool(apart) and [rendered for _, rendered in apart] != [level]
