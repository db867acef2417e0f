"""Lengths and areas as a scene's units tell them; what is said is computed in Blender units, which engine sentences call meters."""

import re

import bpy

from . import words
from .refused import as_sentence

__all__ = ["area_unit", "in_scene_units", "length_text", "sentence"]

# Between these lengths meters are told as such [m].
SHORTEST, LONGEST = 0.01, 1000.0
# Units that a scene may be told in, whatever is long or short [m].
CHOSEN = {
    "KILOMETERS": (1000.0, "km"),
    "CENTIMETERS": (0.01, "cm"),
    "MILLIMETERS": (0.001, "mm"),
    "MILES": (1609.344, "mi"),
    "FEET": (0.3048, "ft"),
    "INCHES": (0.0254, "in"),
}
_NUMBER = r"\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?"
# "0.05 m", "3 m²", "9 by 3 m", "9 x 3 m"; not "5 m/s", nor what is a part of a name: "tree2 m".
_MEASURED = re.compile(rf"(?<![\w.,])({_NUMBER})( by | x )?((?(2){_NUMBER})) m(²?)(?![\w/])")


def length_text(scene: bpy.types.Scene, length: float) -> str:
    """Return a length as the scene's units tell it, with as many digits as are worth reading."""
    units = scene.unit_settings
    if units.system == "NONE":
        return words.meters(length).removesuffix(" m")
    told = length * units.scale_length
    if units.length_unit in CHOSEN:
        factor, sign = CHOSEN[units.length_unit]
        return f"{words.meters(told / factor).removesuffix(' m')} {sign}"
    if units.system == "METRIC" and SHORTEST <= told <= LONGEST:
        return words.meters(told)
    return _told(scene, "LENGTH", told)


def area_unit(scene: bpy.types.Scene) -> str:
    """Return what an area of one Blender unit along each side is called: "m²" where it is one."""
    return "m²" if _is_in_meters(scene) else "unit²"


def in_scene_units(scene: bpy.types.Scene, text: str) -> str:
    """Return a sentence with its lengths and areas in the scene's units."""
    if _is_plain(scene):
        return text

    def told(found: re.Match[str]) -> str:
        one, between, other, square = found.groups()
        numbers = [float(number.replace(",", "")) for number in (one, other) if number]
        return (between or "").join(_area_text(scene, n) if square else length_text(scene, n) for n in numbers)

    return _MEASURED.sub(told, text)


def sentence(error: Exception | str) -> str:
    """Return what an error says as Blender's status line shows it, with lengths in the scene's units."""
    return in_scene_units(bpy.context.scene, as_sentence(error))


def _is_plain(scene: bpy.types.Scene) -> bool:
    """Whether lengths are told as they are computed."""
    return _is_in_meters(scene) and scene.unit_settings.length_unit not in CHOSEN


def _is_in_meters(scene: bpy.types.Scene) -> bool:
    """Whether a Blender unit is a meter."""
    units = scene.unit_settings
    return bool(units.system == "METRIC" and abs(units.scale_length - 1.0) < 1e-6)


def _area_text(scene: bpy.types.Scene, area: float) -> str:
    units = scene.unit_settings
    if units.system == "NONE":
        return f"{area:g} unit²"
    return _told(scene, "AREA", area * units.scale_length**2)


def _told(scene: bpy.types.Scene, kind: str, value: float) -> str:
    text: str = bpy.utils.units.to_string(
        scene.unit_settings.system, kind, value, precision=3, split_unit=False, compatible_unit=False
    )
    return text
