"""Has viewports or their sidebars drawn anew: now, or in a moment."""

from __future__ import annotations

import bpy

__all__ = ["redraw_later", "redraw_sidebars", "redraw_viewports"]

# Seconds after which what may be old is drawn again.
_MOMENT = 1.0


def redraw_viewports() -> None:
    """Have every 3D viewport drawn anew, with its sidebar."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def redraw_sidebars() -> None:
    """Have every 3D viewport's sidebar drawn anew."""
    areas = [area for window in bpy.context.window_manager.windows for area in window.screen.areas]
    for area in areas:
        for region in area.regions if area.type == "VIEW_3D" else ():
            if region.type == "UI":
                region.tag_redraw()


def redraw_later() -> None:
    """Have the sidebars drawn anew in a moment: what they show may be old by then."""
    if not bpy.app.background and not bpy.app.timers.is_registered(redraw_sidebars):
        bpy.app.timers.register(redraw_sidebars, first_interval=_MOMENT)
