"""Entries of Blender's lists."""

from typing import Any

__all__ = ["entry_at"]


def entry_at(entries: Any, index: int) -> Any:
    """Return the entry that is selected in a list, or None."""
    return entries[index] if 0 <= index < len(entries) else None
