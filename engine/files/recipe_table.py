"""The tables of a recipe: they hand out checked values, and name them in messages."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, TypeVar

from ..errors import InputFileError, ProblemError
from ..problem.given_values import nearest_name, show
from .input_file import check_is_file, reason_of

__all__ = ["RecipeTable", "read_toml"]

# Far above any recipe (a class takes 200 bytes), far below what a device or a film given by mistake would hold.
MOST_BYTES = 2**24
A_RECIPE = "a recipe is a TOML file"

Value = TypeVar("Value")


def read_toml(path: Path) -> dict[str, Any]:
    """Return what a recipe holds.

    Raises:
        InputFileError: It cannot be read, or is not TOML.
    """
    # Opening a pipe would wait for whoever writes into it.
    check_is_file(path, A_RECIPE)
    try:
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise InputFileError(f"{path} cannot be read ({reason_of(error)}); {A_RECIPE}") from None
    if len(data) > MOST_BYTES:
        raise InputFileError(f"{path} is larger than {MOST_BYTES // 2**20} MB; a recipe is a short TOML file")
    try:
        # Some editors put a byte order mark in front, which TOML does not know.
        return tomllib.loads(data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputFileError(f"{path} is not UTF-8 text (byte {error.start + 1}); {A_RECIPE}") from None
    except (ValueError, RecursionError) as error:  # TOMLDecodeError, whole numbers of thousands of digits, deep nesting
        reason = " ".join(str(error).split())
        raise InputFileError(f"{path} is not TOML: {reason}") from None


def check_file(value: object, key: str) -> str:
    """Return the name of a file."""
    if not isinstance(value, str) or not value.strip():
        raise ProblemError(f"{key} must be the name of an image file; got {show(value)}")
    return value


class RecipeTable:
    """One table of a recipe: hands out checked values, and names them in messages.

    Args:
        path: The recipe.
        place: What stands before its keys in messages: ``"class[1]."``; nothing at the top.
        names: What it and the tables around it call themselves.
        entries: Its keys and values.
        places: Where keys stand in a recipe, as the end of "it belongs ...", and which; those named first are more likely meant.
    """

    def __init__(
        self,
        path: Path,
        place: str,
        names: str,
        entries: dict[str, Any],
        places: Mapping[str, Collection[str]] | None = None,
    ) -> None:
        self.path, self.place, self.names, self.entries, self.places = path, place, names, entries, places or {}

    def key(self, name: str) -> str:
        """Return how messages name a key of this table."""
        return f"`{self.place}{name}`" + (f" ({self.names})" if self.names else "")

    def error(self, name: str, predicate: str) -> InputFileError:
        """Return the error whose subject is a key of this table."""
        return InputFileError(f"{self.path}: {self.key(name)} {predicate}")

    def name_it(self, kind: str) -> None:
        """Let messages call this table by its own name too, if it has one that can be shown."""
        name = self.entries.get("name")
        if isinstance(name, str) and name.strip():
            self.names = ", ".join(part for part in (self.names, f"{kind} {show(name)}") if part)

    def check_keys(self, *known: str, inline: bool = False) -> None:
        """Refuse a key that this table does not have, and say where it belongs, or which one was probably meant.

        A table that stands ``inline`` was not begun by mistake: what it holds was meant for it.
        """
        for name in self.entries:
            if name in known:
                continue
            found = [] if inline else [place for place, keys in self.places.items() if name in keys][:2]
            if found:
                raise self.error(name, f"is not a known key here; it belongs {' or '.join(found)}")
            raise self.error(show(name).strip('"'), f"is not a known key; {nearest_name(name, known)}")

    def take(self, name: str, check: Callable[[Any, str], Value], default: Any = None) -> Value:
        """Return the checked value of a key, or ``default`` where the key is missing and there is one."""
        if name not in self.entries:
            if default is None:
                raise self.error(name, "is missing")
            return default
        try:
            return check(self.entries[name], self.key(name))
        except ProblemError as error:
            raise InputFileError(f"{self.path}: {error}") from None

    def take_optional(self, name: str, check: Callable[[Any, str], Value]) -> Value | None:
        """Return the checked value of a key, or None where the key is missing."""
        return self.take(name, check) if name in self.entries else None

    def build(self, make: Callable[[], Value]) -> Value:
        """Return what ``make`` makes; what it finds wrong of several values together names the recipe too."""
        try:
            return make()
        except ProblemError as error:
            raise InputFileError(f"{self.path}: {self._placed(str(error))}") from None

    def _placed(self, said: str) -> str:
        """Return a sentence about values of this table with the place that this has, once."""
        own = f"`{self._header('').rstrip('.').rpartition('.')[2]}."
        if self.place and said.startswith(own):
            return said.replace(own, f"`{self.place}")
        return f"`{self.place.rstrip('.')}`: {said}" if self.place else said

    def read(self, name: str, reader: Callable[[Path], Value]) -> Value:
        """Return what ``reader`` makes of the file beside the recipe that a key names."""
        file = self.take(name, check_file)
        try:
            return reader(self.path.parent / file)
        except InputFileError as error:
            raise self.error(name, f"cannot be used: {error}") from None

    def table(self, name: str, *, optional: bool = False) -> RecipeTable:
        """Return a table inside this one, an empty one where it is missing and need not be there."""
        header = f"[{self._header(name)}]"
        if name not in self.entries and not optional:
            raise self.error(name, f"is missing: write a table {header}")
        entries = self.entries.get(name, {})
        if not isinstance(entries, dict):
            raise self.error(name, f"must be one table, under a line {header}; got {show(entries)}")
        return RecipeTable(self.path, f"{self.place}{name}.", self.names, entries, self.places)

    def tables(self, name: str) -> list[RecipeTable]:
        """Return the tables of a list inside this one; at least one."""
        header = f"[[{self._header(name)}]]"
        entries = self.entries.get(name, [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            raise self.error(name, f"must be tables, each under a line {header}; got {show(entries)}")
        if not entries:
            raise self.error(name, f"is missing: write at least one table {header}")
        return [
            RecipeTable(self.path, f"{self.place}{name}[{number}].", self.names, entry, self.places)
            for number, entry in enumerate(entries, start=1)
        ]

    def _header(self, name: str) -> str:
        """Return what stands in the brackets above a table inside this one: the place without its numbers."""
        return re.sub(r"\[\d+\]", "", self.place) + name

    def check_unique(self, kind: str, names: list[str]) -> None:
        """Refuse a name that two tables of a list inside this one have."""
        for number, name in enumerate(names, start=1):
            first = names.index(name) + 1
            if first < number:
                raise self.error(f"{kind}[{number}].name", f'must differ from that of {kind}[{first}]; got "{name}"')
