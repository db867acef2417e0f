"""Properties of the sidebar made from the settings' descriptions, and settings made from the properties.

A number, a switch or a choice is a property of the same name. A group of settings that may be left out, ``unsharp`` for example, is
a switch ``use_unsharp`` and the properties ``unsharp_amount`` and so on. What is more than that, an image for example, the sidebar
has in a form of its own, by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import MISSING
from typing import Any, NamedTuple, TypeVar

import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty, IntProperty, StringProperty
from bpy.types import PropertyGroup

from ...engine.problem.settings import Described, Setting, settings_of

__all__ = [
    "Shown",
    "identifier_of",
    "property_of",
    "shown_settings",
    "value_of",
    "values_from",
    "with_properties",
]

Group = TypeVar("Group", bound=type)

# Blender's word for a unit.
_UNITS = {"m": {"unit": "LENGTH"}, "m²": {"unit": "AREA"}, "rad": {"subtype": "ANGLE"}, "share": {"subtype": "FACTOR"}}


class Shown(NamedTuple):
    """A property of the sidebar that stands for a setting.

    Attributes:
        name: Of the property.
        setting: The setting.
        switch: The property that says whether it counts, or an empty text.
    """

    name: str
    setting: Described
    switch: str = ""

    @property
    def slider(self) -> bool:
        """Whether it is drawn as a slider from end to end."""
        return self.setting.setting.unit == "share"


def shown_settings(cls: Any, by_hand: Collection[str] = (), prefix: str = "") -> Iterator[Shown]:
    """Yield the properties that stand for the settings of a class, but for those that the sidebar has by hand.

    A group that has settings of several classes tells them apart by a ``prefix`` of the properties.
    """
    for name, one in settings_of(cls).items():
        if name in by_hand:
            continue
        assert one.kind != "other", f"{cls.__name__}.{name} needs a form of its own in the sidebar"
        if one.kind == "group":
            assert not prefix, "groups of settings have no prefix yet"
            switch = f"use_{name}"
            yield Shown(switch, one)
            for inner in shown_settings(one.setting.of):
                yield Shown(f"{name}_{inner.name}", inner.setting, inner.switch or switch)
        else:
            yield Shown(prefix + name, one)


def with_properties(
    cls: Any, by_hand: Collection[str] = (), prefix: str = "", /, **changes: Mapping[str, Any]
) -> Callable[[Group], Group]:
    """Give a property group the properties of a class's settings.

    Args:
        cls: A described dataclass.
        by_hand: Its settings that the group has in a form of its own.
        prefix: Of the properties.
        changes: By name of a property, what Blender is to be told of it instead: ``unsharp_radius={"default": 20.0}``.
    """

    def add(group: Group) -> Group:
        for shown in shown_settings(cls, by_hand, prefix):
            assert shown.name not in group.__annotations__, f"{group.__name__}.{shown.name} is there twice"
            group.__annotations__[shown.name] = property_of(shown.setting, **changes.get(shown.name, {}))
        return group

    return add


def property_of(one: Described, **changes: Any) -> Any:
    """Return the property that stands for a setting; ``changes`` are told to Blender in place of what follows from it."""
    described = one.setting
    told: dict[str, Any] = {"name": one.label, "description": described.help, **_UNITS.get(described.unit, {})}
    limits = {
        "min": described.low,
        "max": described.high,
        "soft_min": described.soft_low,
        "soft_max": described.soft_high,
    }
    told |= {key: limit for key, limit in limits.items() if limit is not None}
    if one.kind == "group":
        return BoolProperty(**{"name": one.label, "description": described.help, "default": False, **changes})
    if one.default is not None and one.default is not MISSING:
        told["default"] = one.default
    if one.kind == "choice":
        told = {key: told[key] for key in ("name", "description")}
        told["items"] = [(c.identifier, c.label, c.help[:1].upper() + c.help[1:]) for c in described.choices]
        told["default"] = next(c.identifier for c in described.choices if c.value == one.default)
        return EnumProperty(**{**told, **changes})
    if one.kind == "text":
        return StringProperty(**{**told, **changes})
    if one.kind == "switch":
        return BoolProperty(**{**told, **changes})
    if one.kind == "numbers":
        return FloatVectorProperty(**{"size": len(one.default), **told, **changes})
    whole = isinstance(changes.get("default", one.default), int)
    if whole:
        told = {key: int(value) if key in limits else value for key, value in told.items()}
    return (IntProperty if whole else FloatProperty)(**{**told, **changes})


def values_from(group: PropertyGroup, cls: Any, by_hand: Collection[str] = (), prefix: str = "") -> dict[str, Any]:
    """Return the settings of ``cls`` by name as the properties of a group have them, but for those it has by hand."""
    return {
        name: _value_from(group, one, prefix + name) for name, one in settings_of(cls).items() if name not in by_hand
    }


def _value_from(group: PropertyGroup, one: Described, name: str) -> Any:
    if one.kind == "group":
        of: Any = one.setting.of
        if not getattr(group, f"use_{name}"):
            return None
        return of(**{inner: _value_from(group, own, f"{name}_{inner}") for inner, own in settings_of(of).items()})
    value = getattr(group, name)
    if one.kind == "choice":
        return value_of(one, value)
    if one.kind == "number":
        return _as_meant(value, one.setting)
    return tuple(value) if one.kind == "numbers" else value


def value_of(one: Described, identifier: str) -> Any:
    """Return the value of a choice that Blender knows by an identifier."""
    return next(choice.value for choice in one.setting.choices if choice.identifier == identifier)


def identifier_of(one: Described, value: Any) -> str:
    """Return by which identifier Blender knows a value of a choice."""
    return next(choice.identifier for choice in one.setting.choices if choice.value == value)


def _as_meant(value: float, setting: Setting) -> float:
    """Return the limit that a value stands for: Blender's numbers have seven digits, so that its pi is above pi."""
    limits = (limit for limit in (setting.low, setting.high) if limit is not None)
    return next((limit for limit in limits if value == np.float32(limit)), value)
