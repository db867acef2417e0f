"""Presets as JSON: read, checked and written. Knows nothing of Blender, and runs nothing that is in a file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...engine.errors import InputFileError
from ...engine.problem.given_values import show

__all__ = ["BUILT_IN", "SHAPES", "built_in_presets", "name_of_preset", "parse_preset", "read_preset", "write_preset"]

BUILT_IN = Path(__file__).parents[1] / "presets"
FORMAT, VERSION = "esh-scatter-preset", 1
# A preset is a page of text; what is larger is none.
LARGEST_FILE = 4_000_000
MOST_CLASSES = 256
# What stands in for an object that nobody has chosen yet.
SHAPES = ("ball", "box", "cone", "disc", "dome", "person", "rod")

_KEYS = {"format", "version", "name", "about", "settings", "classes"}
_CLASS_KEYS = {"name", "color", "count", "cover", "stand_in", "settings", "layers", "sizes", "may_overlap"}


def built_in_presets() -> dict[str, str]:
    """Return the names of the presets that come along, by their files, in alphabetical order."""
    named = {str(path): name_of_preset(path) for path in BUILT_IN.glob("*.json")}
    return dict(sorted(named.items(), key=lambda one: one[1]))


def name_of_preset(path: Path) -> str:
    """Return what a preset's file is called in menus, without reading it."""
    return path.stem.replace("_", " ").title()


def read_preset(path: str | Path) -> dict[str, Any]:
    """Read a preset and check its form; what its values mean is checked where they are used.

    Raises:
        InputFileError: The file cannot be read, or is no preset.
    """
    path = Path(path)
    try:
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise InputFileError(f'"{path}" must be a preset; its {size:,} bytes are more than one has')
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputFileError(f'"{path}" must be a file that can be read; {error.strerror}') from None
    except ValueError:
        raise InputFileError(_no_preset(path)) from None
    return parse_preset(text, str(path))


def parse_preset(text: str, path: str) -> dict[str, Any]:
    """Return a preset from its text, and check its form; ``path`` is what sentences call it.

    Raises:
        InputFileError: It is no preset.
    """
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        line = f" ({error})" if isinstance(error, json.JSONDecodeError) and FORMAT in text else ""
        raise InputFileError(f"{_no_preset(path)}{line}") from None
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise InputFileError(_no_preset(path))
    if found.get("version") != VERSION:
        raise InputFileError(f'"{path}" must be of version {VERSION}; got {show(found.get("version"))}')
    _check_keys(found, _KEYS, path)
    classes = found.get("classes")
    if not isinstance(classes, list) or not 1 <= len(classes) <= MOST_CLASSES:
        raise InputFileError(f'`classes` of "{path}" must be a list of 1 to {MOST_CLASSES}; got {show(classes)}')
    _check_values(found.get("settings", {}), f'`settings` of "{path}"')
    for number, one in enumerate(classes, start=1):
        _check_class(one, f'class {number} of "{path}"')
    return found


def write_preset(path: str | Path, preset: Mapping[str, Any]) -> None:
    """Write a preset.

    Raises:
        InputFileError: The file cannot be written.
    """
    text = json.dumps({"format": FORMAT, "version": VERSION, **preset}, indent=2, allow_nan=False)
    try:
        Path(path).write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise InputFileError(f'"{path}" must be a file that can be written; {error.strerror}') from None


def _no_preset(path: str | Path) -> str:
    return f'"{path}" must be a preset of ESH Scatter: a file that Export Preset has written'


def _check_class(one: object, where: str) -> None:
    if not isinstance(one, dict) or not isinstance(one.get("name"), str) or not one["name"].strip():
        raise InputFileError(f"{where} must be an object with a name; got {show(one)}")
    _check_keys(one, _CLASS_KEYS, where)
    for key in ("count", "cover"):
        value = one.get(key, 1)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < math.inf:
            raise InputFileError(f"`{key}` of {where} must be a number above 0; got {show(value)}")
    _check_numbers(one.get("color", [0, 0, 0]), 3, f"`color` of {where}")
    stand_in = one.get("stand_in", {})
    if not isinstance(stand_in, dict) or stand_in.get("shape", "ball") not in SHAPES:
        raise InputFileError(
            f"`stand_in` of {where} must have a shape, one of {', '.join(SHAPES)}; got {show(stand_in)}"
        )
    proportions = stand_in.get("proportions", [1, 1, 1])
    _check_numbers(proportions, 3, f"`proportions` of {where}")
    if min(proportions) <= 0:
        raise InputFileError(f"`proportions` of {where} must be above 0; got {show(proportions)}")
    _check_values(one.get("settings", {}), f"`settings` of {where}")
    for key in ("layers", "sizes"):
        entries = one.get(key, [])
        if not isinstance(entries, list):
            raise InputFileError(f"`{key}` of {where} must be a list; got {show(entries)}")
        for entry in entries:
            _check_values(entry, f"`{key}` of {where}")
    others = one.get("may_overlap", [])
    if not isinstance(others, list) or not all(isinstance(name, str) for name in others):
        raise InputFileError(f"`may_overlap` of {where} must be a list of names; got {show(others)}")


def _check_values(values: object, where: str) -> None:
    """Check that something is names and plain values: numbers, words, switches, and lists of numbers."""
    if not isinstance(values, dict):
        raise InputFileError(f"{where} must be an object of names and values; got {show(values)}")
    for name, value in values.items():
        entries = value if isinstance(value, list) else [value]
        for entry in entries:
            inner = entry if isinstance(entry, list) else [entry]
            plain = all(isinstance(part, bool | str | int | float) for part in inner)
            if not plain or any(isinstance(part, float) and not math.isfinite(part) for part in inner):
                raise InputFileError(f"`{name}` in {where} must be a number, text, true or false; got {show(value)}")


def _check_numbers(values: object, count: int, where: str) -> None:
    entries = values if isinstance(values, list) else []
    good = all(isinstance(one, int | float) and not isinstance(one, bool) and math.isfinite(one) for one in entries)
    if len(entries) != count or not good:
        raise InputFileError(f"{where} must be {count} numbers; got {show(values)}")


def _check_keys(found: Mapping[str, Any], known: set[str], where: str) -> None:
    unknown = sorted(set(found) - known)
    if unknown:
        raise InputFileError(f'{where} must have no key "{unknown[0]}"; it may have {", ".join(sorted(known))}')
