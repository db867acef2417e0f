"""What keeps the add-on in one language.

Blender translates every word of an interface that it happens to know, in the sense that it knows: a panel in German then says "Punkt"
for "Pin", half of it stays English, and a class that is called "Plane" becomes another one in one place and not in the other.
"""

import bpy

__all__ = ["CONTEXT", "keep_in_english"]

# Blender translates by contexts, and has no words for this one. Texts that are drawn without one say `translate=False`.
CONTEXT = "ESH Scatter"


def keep_in_english(cls: type) -> None:
    """Have names and tooltips of a class, and of its properties, stay as they are written; before it is registered."""
    if issubclass(cls, bpy.types.Panel | bpy.types.Menu | bpy.types.Operator):
        cls.bl_translation_context = CONTEXT  # type: ignore[attr-defined]
    for base in cls.__mro__:
        for told in getattr(base, "__annotations__", {}).values():
            # Blender keeps what a property is to be until its class is registered.
            keywords = getattr(told, "keywords", None)
            if isinstance(keywords, dict):
                keywords["translation_context"] = CONTEXT
