"""Whether a target bends, and is another mesh in renders than in the viewport."""

from __future__ import annotations

import bpy

__all__ = ["bends_alone_in_renders"]

# Modifiers that divide faces, to one level in the viewport and to another one in renders; and those that do not bend a mesh.
_DIVIDES = ("SUBSURF", "MULTIRES")
_STIFF = (*_DIVIDES, "ARRAY", "BEVEL", "DECIMATE", "MIRROR", "SOLIDIFY", "TRIANGULATE", "UV_PROJECT", "UV_WARP", "WELD")


def bends_alone_in_renders(target: bpy.types.Object) -> bool:
    """Tell whether a target bends in renders without what stands on it: there it has more vertices, or fewer."""
    if target.type != "MESH":
        return False
    differs = any(
        (m.show_viewport and m.levels) != (m.show_render and m.render_levels)
        for m in target.modifiers
        if m.type in _DIVIDES
    )
    bends = target.data.shape_keys is not None or any(m.show_render and m.type not in _STIFF for m in target.modifiers)
    return differs and bends
