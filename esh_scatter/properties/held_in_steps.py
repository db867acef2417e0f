"""Undo of settings that are changed in Edit Mode, whose steps hold nothing of the file but what is edited."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

import bpy

from ..targets.modes import hold_file_in_step

__all__ = ["hold_in_steps"]

# How many buttons are at work, one of them called by the other; what they change is held once they are done.
_at_work = 0


def hold_in_steps(cls: type) -> None:
    """Have undo know in Edit Mode, too, what a button does, or that a setting has changed; before the class is registered."""
    if issubclass(cls, bpy.types.Operator):
        if "UNDO" in getattr(cls, "bl_options", ()):
            cls.execute = _once(cls.execute, _button)  # type: ignore[attr-defined]
    elif issubclass(cls, bpy.types.PropertyGroup):
        for base in cls.__mro__:
            for told in getattr(base, "__annotations__", {}).values():
                # Blender keeps what a property is to be until its class is registered.
                if getattr(told, "function", bpy.props.CollectionProperty) is not bpy.props.CollectionProperty:
                    told.keywords["update"] = _once(told.keywords.get("update"), _setting)


def _once(function: Callable[..., Any] | None, change: Callable[..., Any]) -> Callable[..., Any]:
    """Return a changed function; one that was changed before, when the class was registered the last time, as it is."""
    if function is not None and hasattr(function, "holds_in_steps"):
        return function
    changed = change(function)
    changed.holds_in_steps = True
    return changed


def _button(execute: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(execute)
    def held(self: bpy.types.Operator, context: bpy.types.Context) -> Any:
        global _at_work
        _at_work += 1
        try:
            return execute(self, context)
        finally:
            _at_work -= 1
            _hold()

    return held


def _setting(update: Callable[..., Any] | None) -> Callable[..., Any]:
    def held(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
        if update is not None:
            update(self, context)
        _hold()

    return held


def _hold() -> None:
    if not _at_work:
        hold_file_in_step()
