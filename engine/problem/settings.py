"""Settings, each described once: what it means, its unit and range, and how a value that was given is checked.

A setting is a field of a frozen dataclass whose metadata is a :class:`Setting`. From these descriptions come the checks and the
docstrings of the dataclasses, the arguments of ``scatter``, the keys of recipes, and the properties of Blender's sidebar.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, NamedTuple, TypeVar

from ..errors import ProblemError
from .given_values import as_float, nearest_name, perhaps_meant, show
from .validation import check_switch

__all__ = [
    "Choice",
    "Described",
    "Setting",
    "Settings",
    "as_given",
    "belongs_to",
    "described",
    "explained",
    "same_setting",
    "setting",
    "settings_of",
    "settle",
    "takes",
    "values_of",
    "with_changes",
]

Check = Callable[[Any, str], Any]
Kind = Literal["switch", "whole", "number", "numbers", "choice", "text", "group", "other"]
Class = TypeVar("Class", bound=type)
Group = TypeVar("Group")
Function = TypeVar("Function", bound=Callable[..., Any])

# Width of the lines of generated docstrings.
LINE = 120
# What is called for one purpose, with settings that are easily given to another of them. The first ones are named first.
TOGETHER = {
    "problem": (
        "Problem",
        "solve",
        "BodyClass",
        "Size",
        "Domain",
        "Balance",
        "Unsharp",
        "Line",
        "LookAt",
        "Footprints",
    ),
    "scatter": ("scatter", "ScatterClass", "ScatterSize", "Amount", "Unsharp", "Line", "LookAt", "ScatterObstacle"),
}
# What each of them takes. A problem can be described before anything is loaded that solves it.
_taken: dict[str, tuple[str, ...]] = {"solve": ("problem", "device", "max_steps", "progress", "profile")}


class Choice(NamedTuple):
    """One of the values that a setting can have.

    Attributes:
        value: As scripts and recipes write it.
        label: As the sidebar shows it.
        help: What it means, for the sidebar.
        identifier: As the sidebar's property names it.
    """

    value: str
    label: str
    help: str
    identifier: str


@dataclass(frozen=True)
class Setting:
    """What there is to say about a setting, beside its name, its type and its default, which are those of the field.

    Attributes:
        help: What it does, for everyone: one or two short sentences, without the last full stop.
        more: What scripts need to know beside that: types, shapes, references.
        label: What the sidebar calls it; its name, if empty.
        unit: ``"m"``, ``"m²"``, ``"1/m²"``, ``"rad"``, ``"share"`` (a number from 0 to 1) or ``""``.
        low: Smallest value.
        high: Largest value.
        soft_low: Smallest value that a slider reaches.
        soft_high: Largest value that a slider reaches.
        choices: The words that it can be.
        text: Whether it is any text, such as a name.
        of: The dataclass that it is an instance of, where it is a group of settings of its own.
        check: Returns the value as it is kept, and raises :class:`~esh.ProblemError` for one that has no meaning; gets the value
            and the name that messages call it by. None follows from the range, the choices and the type of the default.
    """

    help: str
    more: str = ""
    label: str = ""
    unit: str = ""
    low: float | None = None
    high: float | None = None
    soft_low: float | None = None
    soft_high: float | None = None
    choices: tuple[Choice, ...] = ()
    text: bool = False
    of: type | None = None
    check: Check | None = None


class Described(NamedTuple):
    """A setting and the field that it describes.

    Attributes:
        name: Of the field.
        default: Of the field; ``dataclasses.MISSING`` where it must be given.
        setting: The description.
    """

    name: str
    default: Any
    setting: Setting

    @property
    def kind(self) -> Kind:
        """What kind of value it is; ``"other"`` is what no front end can handle by itself."""
        default = self.default
        if self.setting.of is not None:
            return "group"
        if self.setting.choices:
            return "choice"
        if self.setting.text:
            return "text"
        if isinstance(default, bool):
            return "switch"
        if isinstance(default, int):
            return "whole"
        if isinstance(default, float):
            return "number"
        if isinstance(default, tuple) and default and all(isinstance(entry, float) for entry in default):
            return "numbers"
        return "other"

    @property
    def required(self) -> bool:
        """Whether it has no default."""
        return self.default is dataclasses.MISSING

    @property
    def label(self) -> str:
        """What the sidebar calls it."""
        return self.setting.label or self.name.replace("_", " ").title()

    def checked(self, value: object, key: str) -> Any:
        """Return a value as it is kept; raise ProblemError, which calls it ``key``, if it has no meaning."""
        if value is None and self.default is None:
            return None
        if self.setting.check is not None:
            return self.setting.check(value, key)
        if self.setting.of is not None:
            return _check_group(value, key, self.setting.of, self.default is None)
        if self.kind == "choice":
            return _check_choice(value, key, self.setting.choices)
        if self.kind == "text":
            return _check_text(value, key)
        if self.kind == "switch":
            return check_switch(value, key)
        if self.kind == "numbers":
            return _check_numbers(value, key, self.setting, len(self.default))
        return _check_number(value, key, self.setting, whole=self.kind == "whole")


def setting(help: str, **more: Any) -> dict[str, Setting]:
    """Describe a field: ``dataclasses.field(default=0.5, metadata=setting("What it does", low=0.0, high=1.0))``.

    Args:
        help: See :class:`Setting`.
        more: Its other attributes.
    """
    return {"setting": Setting(help, **more)}


def same_setting(cls: type, name: str, **changes: Any) -> dict[str, Setting]:
    """Describe a field as the one of this name in another class is, less what differs."""
    return {"setting": dataclasses.replace(settings_of(cls)[name].setting, **changes)}


@cache
def settings_of(cls: Any) -> Mapping[str, Described]:
    """Return the settings of a dataclass by name, in the order in which its constructor takes them."""
    found = {}
    for entry in sorted(dataclasses.fields(cls), key=lambda entry: entry.kw_only is True):
        description = entry.metadata.get("setting")
        if description is not None:
            default = entry.default if entry.default_factory is dataclasses.MISSING else entry.default_factory()
            found[entry.name] = Described(entry.name, default, description)
            assert description.check or found[entry.name].kind != "other", f"{cls.__name__}.{entry.name} needs a check"
    return found


def values_of(source: object, cls: Any) -> dict[str, Any]:
    """Return the settings of ``cls`` by name as an instance of it, or of a class derived from it, has them."""
    return {name: getattr(source, name) for name in settings_of(cls)}


def belongs_to(
    *purposes: str, named: bool = True, instead: Mapping[str, str] | None = None
) -> Callable[[Function], Function]:
    """Have a function or class, and those that are called for the same purposes, say where a setting belongs that they do not know.

    Args:
        purposes: Keys of ``TOGETHER``.
        named: Whether others name it; otherwise it only names others.
        instead: What says the same here as settings of others that it does not know, by their names, as ends of sentences.
    """

    def remember(called: Function) -> Function:
        name = called.__name__
        taken = tuple(inspect.signature(called).parameters)
        for purpose in purposes:
            assert named == (name in TOGETHER[purpose]), f"{name} belongs to {purpose}, and TOGETHER says otherwise"
        if named:
            assert _taken.get(name, taken) == taken, f"{name} takes something else than is said ahead"
            _taken[name] = taken
        made: Any = called.__init__ if isinstance(called, type) else called  # type: ignore[misc]
        if made.__code__.co_flags & inspect.CO_VARKEYWORDS:
            # Then it looks at names itself.
            return called

        @functools.wraps(made)
        def checked(*values: Any, **given: Any) -> Any:
            for key in given:
                if key not in taken and (place := (instead or {}).get(key) or _place_of(key, purposes)):
                    raise TypeError(f"`{key}` is not a setting of {name}; {place}")
            return made(*values, **given)

        if not isinstance(called, type):
            return checked  # type: ignore[return-value]
        called.__init__ = checked  # type: ignore[misc]
        return called

    return remember


def _place_of(name: str, purposes: Sequence[str]) -> str:
    """Return what a setting belongs to, as the end of a sentence; empty where nothing has it."""
    names = dict.fromkeys(one for purpose in purposes for one in TOGETHER[purpose])
    found = [one for one in names if name in _taken.get(one, ())]
    return f"it belongs to {' or '.join(found[:2])}: {found[0]}(..., {name}=...)" if found else ""


def with_changes(settings: Group, changes: Mapping[str, Any], also: Sequence[str] = (), purpose: str = "") -> Group:
    """Return the same settings but for some by name.

    Args:
        settings: An instance of a described dataclass.
        changes: Others by name.
        also: What else may be said by name where ``changes`` are from.
        purpose: What that is called for: a key of ``TOGETHER``. A setting of something else is told where it belongs.

    Raises:
        ProblemError: A name that is none of them, or a value without meaning.
    """
    cls: Any = type(settings)
    known = settings_of(cls)
    for name in changes:
        if name not in known:
            place = _place_of(name, [purpose]) if purpose else ""
            raise ProblemError(f"`{name}` is not a known setting; {place or nearest_name(name, (*known, *also))}")
    return dataclasses.replace(settings, **changes)  # type: ignore[type-var]


def settle(instance: object, **values: object) -> None:
    """Set attributes of a frozen instance that is still being made."""
    for name, value in values.items():
        object.__setattr__(instance, name, value)


class Settings:
    """Base of described dataclasses: checks every setting when an instance is made."""

    def __post_init__(self) -> None:
        cls: Any = type(self)
        # A name first: the messages about all others hold it.
        for one in sorted(settings_of(cls).values(), key=lambda one: one.name != "name"):
            settle(self, **{one.name: one.checked(getattr(self, one.name), self._key(one.name))})

    def _key(self, name: str) -> str:
        """Return how messages call a setting."""
        return f"`{name}`"


def described(cls: Class) -> Class:
    """Write the descriptions of a dataclass's settings into its docstring, before the errors that it raises."""
    text, raises, errors = inspect.cleandoc(cls.__doc__ or "").partition("\n\nRaises:")
    cls.__doc__ = f"{text}\n\nArgs:\n{explained(settings_of(cls), 4)}{raises}{errors}\n"
    return cls


def takes(cls: Any) -> Callable[[Function], Function]:
    """Say of a function, or a class, that has ``**changes`` which those are: the settings of ``cls``, in signature and docstring."""

    def describe(function: Function) -> Function:
        signature = inspect.signature(function)
        given = [one for one in signature.parameters.values() if one.kind is not one.VAR_KEYWORD]
        types = {entry.name: entry.type for entry in dataclasses.fields(cls)}
        own = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=one.default, annotation=types[name])
            for name, one in settings_of(cls).items()
        ]
        first_by_name = next(i for i, one in enumerate(given) if one.kind is one.KEYWORD_ONLY)
        parameters = [*given[:first_by_name], *own, *given[first_by_name:]]
        function.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
        text = inspect.cleandoc(function.__doc__ or "").splitlines()
        for number, line in enumerate(text):
            if line.startswith("    changes: "):
                text[number + 1 : number + 1] = explained(settings_of(cls), 4).splitlines()
        function.__doc__ = "\n".join(text)
        return function

    return describe


def explained(settings: Mapping[str, Described], indent: int) -> str:
    """Return a docstring's lines on settings, indented by so many spaces."""
    return "\n".join(
        textwrap.fill(
            f"{name}: {_sentences(one)}",
            LINE,
            initial_indent=" " * indent,
            subsequent_indent=" " * (indent + 4),
            break_long_words=False,
            break_on_hyphens=False,
        )
        for name, one in settings.items()
    )


def _sentences(one: Described) -> str:
    description = one.setting
    unit = f" [{description.unit}]" if description.unit not in ("", "share") else ""
    choices = ", ".join(f'``"{choice.value}"`` ({choice.help})' for choice in description.choices)
    parts = [f"{description.help}{unit}", choices, description.more.rstrip(".")]
    return ". ".join(part for part in parts if part) + "."


def as_given(value: Any, _key: str) -> Any:
    """Check nothing: the value is looked at where it is used."""
    return value


def _check_group(value: object, key: str, of: type, optional: bool) -> object:
    if isinstance(value, of):
        return value
    name = of.__name__
    article = "an" if name[0] in "AEIOU" else "a"
    raise ProblemError(f"{key} must be {article} {name}{', or None' if optional else ''}; got {show(value)}")


def _check_choice(value: object, key: str, choices: tuple[Choice, ...]) -> str:
    words = [choice.value for choice in choices]
    if not isinstance(value, str) or value not in words:
        accepted = ", ".join(f'"{word}"' for word in words[:-1]) + f' or "{words[-1]}"'
        raise ProblemError(f"{key} must be {accepted}; got {show(value)}{perhaps_meant(value, words)}")
    return value


def _check_text(value: object, key: str) -> str:
    if not isinstance(value, str):
        raise ProblemError(f"{key} must be text; got {show(value)}")
    return value


def _check_numbers(value: object, key: str, description: Setting, count: int) -> tuple[float, ...]:
    entries = tuple(value) if isinstance(value, list | tuple) else ()
    if len(entries) != count:
        raise ProblemError(f"{key} must be {count} numbers; got {show(value)}")
    return tuple(_check_number(entry, key, description, whole=False) for entry in entries)


def _check_number(value: object, key: str, description: Setting, *, whole: bool) -> float | int:
    low = -math.inf if description.low is None else description.low
    high = math.inf if description.high is None else description.high
    number = as_float(value)
    if number is not None and math.isfinite(number) and low <= number <= high and not (whole and number % 1.0):
        return int(value) if whole else number  # type: ignore[call-overload]
    span = f" between {low:g} and {high:g}" if math.isfinite(high - low) else ", and finite"
    if math.isfinite(low) and not math.isfinite(high):
        span = f" of {low:g} or more, and finite"
    raise ProblemError(f"{key} must be a {'whole ' if whole else ''}number{span}; got {show(value)}")
