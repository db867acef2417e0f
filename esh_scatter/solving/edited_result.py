"""What Live knows of a result whose points are edited: whether there is a reason to leave Edit Mode for a moment, which takes time."""

from __future__ import annotations

import time

import bpy

from ..result.edited_points import can_leave_edit_mode, checksum_of_edited
from . import strokes
from .new_result import Scatter

__all__ = ["EditedResult", "may_be_left"]


def may_be_left(context: bpy.types.Context, result: bpy.types.Object) -> bool:
    """Tell whether a result is in Edit Mode, which can be left for a moment."""
    return can_leave_edit_mode(context, result) and not strokes.edits_points()


class EditedResult:
    """The settings, and where the points were, when a result in Edit Mode was looked at last."""

    def __init__(self) -> None:
        self._seen: tuple[str, tuple[int, int]] | None = None
        self._seen_at = 0.0

    def forget(self) -> None:
        """Look at it anew: it is no longer edited, or was changed in a way that Edit Mode does not tell."""
        self._seen = None

    def note(self, scatter: Scatter, result: bpy.types.Object) -> None:
        """Settings and points are known as they are now."""
        self._seen, self._seen_at = (scatter.fingerprint(), checksum_of_edited(result)), time.monotonic()

    def note_points(self, result: bpy.types.Object) -> None:
        """Points were written, and are known as they are now."""
        if self._seen is not None:
            self._seen = self._seen[0], checksum_of_edited(result)

    def has_its_points(self, result: bpy.types.Object) -> bool:
        """Tell whether points are where they were."""
        return self._seen is not None and self._seen[1] == checksum_of_edited(result)

    def has_changed(self, scatter: Scatter, result: bpy.types.Object, last_sign: float) -> bool:
        """Tell whether settings are others, or points elsewhere.

        Args:
            scatter: Whose result it is.
            result: In Edit Mode.
            last_sign: When Blender last said that points may have moved; to look at them takes time.
        """
        if self._seen is None:
            return True
        if last_sign >= self._seen_at:
            self._seen_at = time.monotonic()
            if not self.has_its_points(result):
                return True
        return self._seen[0] != scatter.fingerprint()
