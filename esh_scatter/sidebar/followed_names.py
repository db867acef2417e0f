"""Classes that are named after what they place are called as that is as soon as the sidebar shows them, and so are groups in layers.

Blender draws the sidebar anew when something was renamed, also by undo and redo; while it draws, nothing may be changed.
"""

from __future__ import annotations

import bpy

from ..properties.names import follow_names, outnamed
from ..properties.renamed_on_mesh import follow_renamed, has_to_follow
from ..properties.scatter import ESH_PG_scatter
from ..solving.redrawing import redraw_sidebars

__all__ = ["detach", "follow_names_later"]


def follow_names_later(scatter: ESH_PG_scatter) -> None:
    """Have classes follow the names of what they place in a moment, and layers those of what they read, if any has to."""
    if not scatter.id_data.is_editable or bpy.app.timers.is_registered(_follow):
        return
    if outnamed(scatter) or has_to_follow(scatter):
        bpy.app.timers.register(_follow)


def detach() -> None:
    """Follow nothing any more."""
    if bpy.app.timers.is_registered(_follow):
        bpy.app.timers.unregister(_follow)


def _follow() -> None:
    for scene in bpy.data.scenes:
        for scatter in scene.esh_scatter.scatters if scene.is_editable else ():
            follow_names(scatter)
            follow_renamed(scatter)
    redraw_sidebars()
