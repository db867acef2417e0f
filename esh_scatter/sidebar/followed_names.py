"""Classes that are named after what they place are called as that is, as soon as the sidebar shows them.

Blender draws the sidebar anew when something was renamed, also by undo and redo; while it draws, nothing may be changed.
"""

from __future__ import annotations

import bpy

from ..properties.names import follow_names, outnamed
from ..properties.scatter import ESH_PG_scatter
from ..solving.redrawing import redraw_sidebars

__all__ = ["detach", "follow_names_later"]


def follow_names_later(scatter: ESH_PG_scatter) -> None:
    """Have classes follow the names of what they place in a moment, if any has to."""
    if scatter.id_data.is_editable and not bpy.app.timers.is_registered(_follow) and outnamed(scatter):
        bpy.app.timers.register(_follow)


def detach() -> None:
    """Follow nothing any more."""
    if bpy.app.timers.is_registered(_follow):
        bpy.app.timers.unregister(_follow)


def _follow() -> None:
    for scene in bpy.data.scenes:
        for scatter in scene.esh_scatter.scatters if scene.is_editable else ():
            follow_names(scatter)
    redraw_sidebars()
