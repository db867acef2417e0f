"""Ink models by name, as plain data: for those who only list them, NumPy stays unloaded."""

from __future__ import annotations

__all__ = ["DEFAULT_MODEL", "INK_MODELS"]

# The letters of a model's inks, and which pairs may overlap: those whose union has the color of no other ink.
INK_MODELS: dict[str, tuple[str, tuple[str, ...]]] = {
    "CMY": ("CMY", ("CM", "CY", "MY")),
    "CMYK": ("CMYK", ("CM", "CY", "MY")),
    "CMY-RG-K": ("CMYRGK", ("CM",)),
    "CMY-RB-K": ("CMYRBK", ("CY",)),
    "CMY-RGB-K": ("CMYRGBK", ()),
}
DEFAULT_MODEL = "CMYK"
