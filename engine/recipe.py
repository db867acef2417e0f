"""Recipes: TOML files that describe a problem, version 1.

    version = 1
    seed = 7                       # default 0
    [domain]
    size = [40.0, 30.0]            # metres, x and y
    boundary = "open"              # default; or "periodic"
    [balance]
    class_separation = 0.5         # default
    size_emphasis = 2.0            # default
    [[class]]
    name = "pine"
    density = "pine.png"           # beside the recipe, white = many; or a number for a uniform density
    invert = false                 # default
    [[class.size]]
    name = "large"
    area = 3.0                     # footprint, m²
    count = 120

Messages name keys by their place, counted from 1: ``class[2].size[1].count`` is the count of the first size of the
second class.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from . import checks
from .checks import show
from .errors import InputFileError, ProblemError
from .image_files import read_density
from .problem import Balance, BodyClass, Domain, Problem, Size

__all__ = ["read_recipe", "recipe_densities"]

VERSION = 1
# Far above any recipe (a class takes 200 bytes), far below what a device or a film given by mistake would hold.
MOST_BYTES = 2**24
Value = TypeVar("Value")


def read_recipe(path: str | Path, *, seed: int | None = None) -> Problem:
    """Read the problem that a recipe describes, and the density images that it names.

    Args:
        path: The TOML file; density images are looked for beside it.
        seed: Used instead of the recipe's.

    Raises:
        InputFileError: The recipe or an image cannot be read, or a key is missing, unknown or has no meaning.
        ProblemError: A ``seed`` that is not a whole number >= 0.
    """
    path = Path(path)
    recipe = _Table(path, "", "", _read_toml(path))
    # The version comes first: a recipe of another one may well have other keys.
    recipe.take("version", _check_version)
    recipe.check_keys("version", "seed", "domain", "balance", "class")
    own_seed = recipe.take("seed", checks.check_seed, 0)

    table = recipe.table("domain")
    table.check_keys("size", "boundary")
    size = table.take("size", checks.check_domain_size)
    domain = Domain(size, table.take("boundary", checks.check_boundary, "open"))

    table = recipe.table("balance", optional=True)
    table.check_keys("class_separation", "size_emphasis")
    balance = Balance(
        class_separation=table.take("class_separation", checks.check_class_separation, 0.5),
        size_emphasis=table.take("size_emphasis", checks.check_size_emphasis, 2.0),
    )

    classes = [_read_class(table) for table in recipe.tables("class")]
    recipe.check_unique("class", [body_class.name for body_class in classes])
    return Problem(domain, classes, balance, own_seed if seed is None else checks.check_seed(seed))


def recipe_densities(path: str | Path) -> list[Path]:
    """Return the density files that a recipe names, in its order; it need not be free of mistakes.

    Raises:
        InputFileError: The recipe cannot be read as TOML.
    """
    path = Path(path)
    classes = _read_toml(path).get("class")
    tables = [table for table in classes if isinstance(table, dict)] if isinstance(classes, list) else []
    return [path.parent / table["density"] for table in tables if isinstance(table.get("density"), str)]


def _read_class(table: _Table) -> BodyClass:
    table.name_it("class")
    table.check_keys("name", "density", "invert", "size")
    name = table.take("name", checks.check_name)
    density = table.take("density", _check_density)
    invert = table.take("invert", _check_switch, False)
    sizes = [_read_size(size) for size in table.tables("size")]
    table.check_unique("size", [size.name for size in sizes])
    if not isinstance(density, str):
        if invert:
            raise table.error("invert", f"is for density images; got true beside a `density` of {show(density)}")
        return BodyClass(name, sizes, density)
    try:
        return BodyClass(name, sizes, read_density(table.path.parent / density, invert))
    except InputFileError as error:
        raise table.error("density", f"cannot be used: {error}") from None


def _read_size(table: _Table) -> Size:
    table.name_it("size")
    table.check_keys("name", "area", "count")
    return Size(
        name=table.take("name", checks.check_name),
        area=table.take("area", checks.check_area),
        count=table.take("count", checks.check_count),
    )


def _check_version(value: object, key: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value != VERSION:
        raise ProblemError(f"{key} must be {VERSION}, the only one there is; got {show(value)}")
    return value


def _check_density(value: object, key: str) -> str | float:
    if isinstance(value, str) and value.strip():
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ProblemError(f"{key} must be the name of an image file or a number above 0; got {show(value)}")
    return float(checks.check_density(value, key)[0, 0])


def _check_switch(value: object, key: str) -> bool:
    if not isinstance(value, bool):
        raise ProblemError(f"{key} must be true or false; got {show(value)}")
    return value


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        if path.is_dir():
            raise InputFileError(f"{path} is a folder; a recipe is a TOML file")
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
    except FileNotFoundError:
        raise InputFileError(f"{path} does not exist; a recipe is a TOML file") from None
    except (OSError, ValueError) as error:  # ValueError: a name that no file can have
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise InputFileError(f"{path} cannot be read ({reason}); a recipe is a TOML file") from None
    if len(data) > MOST_BYTES:
        raise InputFileError(f"{path} is larger than {MOST_BYTES // 2**20} MB; a recipe is a short TOML file")
    try:
        # Some editors put a byte order mark in front, which TOML does not know.
        return tomllib.loads(data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputFileError(f"{path} is not UTF-8 text (byte {error.start + 1}); a recipe is a TOML file") from None
    except (ValueError, RecursionError) as error:  # TOMLDecodeError, whole numbers of thousands of digits, deep nesting
        reason = " ".join(str(error).split())
        raise InputFileError(f"{path} is not TOML: {reason}") from None


class _Table:
    """One table of a recipe: hands out checked values, and names them in messages."""

    def __init__(self, path: Path, place: str, names: str, entries: dict[str, Any]) -> None:
        self.path, self.place, self.names, self.entries = path, place, names, entries

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

    def check_keys(self, *known: str) -> None:
        """Refuse a key that this table does not have, and say which one was probably meant."""
        for name in self.entries:
            if name not in known:
                nearest = difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.5)
                meant = f"did you mean `{nearest[0]}`" if nearest else f"known are {', '.join(known)}"
                raise self.error(show(name).strip('"'), f"is not a known key; {meant}")

    def take(self, name: str, check: Callable[[Any, str], Value], default: Value | None = None) -> Value:
        """Return the checked value of a key, or ``default`` where the key is missing and there is one."""
        if name not in self.entries:
            if default is None:
                raise self.error(name, "is missing")
            return default
        try:
            return check(self.entries[name], self.key(name))
        except ProblemError as error:
            raise InputFileError(f"{self.path}: {error}") from None

    def table(self, name: str, *, optional: bool = False) -> _Table:
        """Return a table inside this one, an empty one where it is missing and need not be there."""
        if name not in self.entries and not optional:
            raise self.error(name, f"is missing: write a table [{name}]")
        entries = self.entries.get(name, {})
        if not isinstance(entries, dict):
            raise self.error(name, f"must be one table, under a line [{name}]; got {show(entries)}")
        return _Table(self.path, f"{self.place}{name}.", "", entries)

    def tables(self, name: str) -> list[_Table]:
        """Return the tables of a list inside this one; at least one."""
        header = f"[[{'class.' if self.place else ''}{name}]]"
        entries = self.entries.get(name, [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            raise self.error(name, f"must be tables, each under a line {header}; got {show(entries)}")
        if not entries:
            raise self.error(name, f"is missing: write at least one table {header}")
        return [
            _Table(self.path, f"{self.place}{name}[{number}].", self.names, entry)
            for number, entry in enumerate(entries, start=1)
        ]

    def check_unique(self, kind: str, names: list[str]) -> None:
        """Refuse a name that two tables of a list inside this one have."""
        for number, name in enumerate(names, start=1):
            first = names.index(name) + 1
            if first < number:
                raise self.error(
                    f"{kind}[{number}].name", f'must be another than that of {kind}[{first}]; got "{name}"'
                )
