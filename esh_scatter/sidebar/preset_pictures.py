"""The pictures of the presets, as icons; read from their files when they are shown first."""

from __future__ import annotations

from pathlib import Path

import bpy.utils.previews

__all__ = ["detach", "picture_of"]

_pictures: bpy.utils.previews.ImagePreviewCollection | None = None


def picture_of(preset: str | Path) -> int:
    """Return the number of the icon that shows a preset, of its file; 0 where it has no picture."""
    global _pictures
    path = Path(preset).with_suffix(".jpg")
    if not path.exists():
        return 0
    if _pictures is None:
        _pictures = bpy.utils.previews.new()
    key = str(path)
    if key not in _pictures:
        _pictures.load(key, key, "IMAGE")
    return int(_pictures[key].icon_id)


def detach() -> None:
    """Let go of them."""
    global _pictures
    if _pictures is not None:
        bpy.utils.previews.remove(_pictures)
        _pictures = None
