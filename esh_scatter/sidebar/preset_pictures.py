"""The pictures of the presets, as icons, and one to choose a preset by; read from their files when they are shown first."""

from __future__ import annotations

from pathlib import Path

import bpy
import bpy.utils.previews
from bpy.props import EnumProperty

from ..editing.preset_files import built_in_presets
from ..properties.in_english import CONTEXT

__all__ = ["attach", "detach", "draw_pictures", "picture_of"]

# How large pictures are among which one is chosen, in units of lines.
CHOICE_SCALE = 5.0

_pictures: bpy.utils.previews.ImagePreviewCollection | None = None
# Blender does not keep the texts of choices that are made while it draws.
_choices: list[tuple[str, str, str, int, int]] = []


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


def draw_pictures(layout: bpy.types.UILayout, scale: float) -> None:
    """Draw a picture that opens all of them, each of which is a button that applies its preset."""
    column = layout.column()
    column.enabled = bpy.ops.esh.preset_apply.poll()
    column.template_icon_view(
        bpy.context.window_manager, "esh_scatter_preset", show_labels=True, scale=scale, scale_popup=CHOICE_SCALE
    )


def _presets(_owner: object, _context: object) -> list[tuple[str, str, str, int, int]]:
    """Return the presets that come along, as Blender takes choices."""
    if not _choices:
        presets = built_in_presets().items()
        _choices.extend((path, name, "", picture_of(path), number) for number, (path, name) in enumerate(presets))
    return _choices


def _chosen(owner: bpy.types.WindowManager, _context: object) -> None:
    """Apply the preset whose picture was clicked, as one step of the undo history."""
    if bpy.ops.esh.preset_apply.poll():
        bpy.ops.esh.preset_apply("EXEC_DEFAULT", True, filepath=owner.esh_scatter_preset)


def attach() -> None:
    """Add what is chosen by its picture."""
    bpy.types.WindowManager.esh_scatter_preset = EnumProperty(
        name="Preset",
        description="Add a scatter with the settings of a preset on the active mesh. Click the picture to see all presets",
        items=_presets,
        options={"SKIP_SAVE"},
        translation_context=CONTEXT,
        update=_chosen,
    )


def detach() -> None:
    """Let go of them."""
    global _pictures
    if hasattr(bpy.types.WindowManager, "esh_scatter_preset"):
        del bpy.types.WindowManager.esh_scatter_preset
    _choices.clear()
    if _pictures is not None:
        bpy.utils.previews.remove(_pictures)
        _pictures = None
