"""Buttons that end a run: as if it had not been, or with what it has placed so far."""

# Blender shows an operator's docstring as its tooltip and ends it with a period of its own.
# ruff: noqa: D415

import bpy

from ..solving import running

__all__ = ["CLASSES"]


class ESH_OT_stop(bpy.types.Operator):
    """Stop the run. The scene stays as it is"""

    bl_idname = "esh.stop"
    bl_label = "Stop Scattering"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        """Only while something runs."""
        return running.session is not None

    def execute(self, _context: bpy.types.Context) -> set[str]:
        """Stop."""
        running.stop("Stopped. Nothing was changed")
        return {"FINISHED"}


class ESH_OT_keep(bpy.types.Operator):
    """End the run now, and keep the objects where they are"""

    bl_idname = "esh.keep"
    bl_label = "Keep"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        """Only once there is something to keep."""
        session = running.session
        return session is not None and session.run.progress is not None and not session.keeps

    def execute(self, _context: bpy.types.Context) -> set[str]:
        """Keep it."""
        running.keep()
        return {"FINISHED"}


CLASSES = (ESH_OT_keep, ESH_OT_stop)
