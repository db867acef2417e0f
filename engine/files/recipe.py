"""Recipes: TOML files that describe a problem, version 1.

    version = 1
    seed = 7                       # default 0
    avoid_overlap = false          # default; true: footprints push each other apart
    [domain]
    size = [40.0, 30.0]            # metres, x and y
    boundary = "open"              # default; or "periodic"
    [balance]
    class_separation = 0.5         # default
    size_emphasis = 2.0            # default; or a list, one for each larger size
    non_overlap = [[1, 0], [0, 1]] # one row per class: 1 = keep apart, 0 = may overlap; default: all keep apart
    [[class]]
    name = "pine"
    density = "pine.png"           # beside the recipe, white = many; or a number for a uniform density
    invert = false                 # default
    density_correction = false     # default; true: densities are covered shares, and dark ones come out dark
    unsharp = { amount = 1.0, radius = 2.0 }   # default: none
    color = [0.0, 0.6, 0.3]        # of a halftone's ink: red, green and blue 0..1; default: black
    count = 300                    # of all sizes, which then have shares; or "cover"; default: every size has a count
    [[class.size]]
    name = "large"
    area = 3.0                     # footprint, m²; or a range [0.5, 2.0]
    count = 120                    # or share = 0.25 where the class has the count
    distribution = "linear"        # default, of a range; or "uniform", or a list of areas
    [class.size.line]              # only for long bodies
    length = 2.0                   # metres; or an image beside the recipe, black = length_range[0], white = length_range[1]
    direction = "density"          # default; "none", radians, or an image beside the recipe
    direction_kind = "angle"       # default, of an image: grey 0..1 is half a turn; or "vector": red and green are x and y
    # width, charges, middle_charge, turn_weights, stretch_weights, straightness, tensor_scales: see Line in problem.py

Instead of classes, a colour image may give them: one class per ink (see :mod:`~esh.engine.problem.color_separation`).

    [image]
    file = "photo.png"
    model = "CMYK"                 # default; CMY, CMY-RG-K, CMY-RB-K, CMY-RGB-K; or a list of inks and its non_overlap matrix
    area = 0.01                    # of a dot, m²; or [[image.size]] tables with name, area and share

Messages name keys by their place, counted from 1: ``class[2].size[1].count`` is the count of the first size of the
second class.
"""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..errors import InputFileError, ProblemError
from ..problem import validation
from ..problem.color_separation import MODELS, Ink, InkModel, halftone_problem
from ..problem.direction_field import direction_from_angle_image, direction_from_rg
from ..problem.ink_models import DEFAULT_MODEL
from ..problem.problem import Balance, BodyClass, Domain, Line, Problem, Size, Unsharp
from ..problem.validation import show
from .image_files import read_color, read_density

__all__ = ["ParsedRecipe", "parse_recipe", "read_recipe", "recipe_colors", "recipe_densities"]

VERSION = 1
# Directions that are no names of images.
WORDS = ("density", "none")
# Far above any recipe (a class takes 200 bytes), far below what a device or a film given by mistake would hold.
MOST_BYTES = 2**24
Value = TypeVar("Value")


@dataclass(frozen=True)
class ParsedRecipe:
    """A recipe as TOML has it, not checked yet; whoever asks it several things parses the file once."""

    path: Path
    entries: dict[str, Any]


def parse_recipe(path: str | Path) -> ParsedRecipe:
    """Read a TOML file; raises InputFileError where it cannot be read as one."""
    return ParsedRecipe(Path(path), _read_toml(Path(path)))


def read_recipe(path: str | Path | ParsedRecipe, *, seed: int | None = None) -> Problem:
    """Read the problem that a recipe describes, and the density images that it names.

    Args:
        path: The TOML file, or what :func:`parse_recipe` made of it; density images are looked for beside it.
        seed: Used instead of the recipe's.

    Raises:
        InputFileError: The recipe or an image cannot be read, or a key is missing, unknown or has no meaning.
        ProblemError: A ``seed`` that is not a whole number >= 0.
    """
    parsed = _parsed(path)
    recipe = _Table(parsed.path, "", "", parsed.entries)
    # The version comes first: a recipe of another one may well have other keys.
    recipe.take("version", _check_version)
    recipe.check_keys("version", "seed", "avoid_overlap", "domain", "balance", "class", "image")
    own_seed = recipe.take("seed", validation.check_seed, 0)
    own_seed = own_seed if seed is None else validation.check_seed(seed)
    avoid_overlap = recipe.take("avoid_overlap", validation.check_switch, False)

    table = recipe.table("domain")
    table.check_keys("size", "boundary")
    size = table.take("size", validation.check_domain_size)
    domain = Domain(size, table.take("boundary", validation.check_boundary, "open"))

    table = recipe.table("balance", optional=True)
    table.check_keys("class_separation", "size_emphasis", "non_overlap")
    class_separation = table.take("class_separation", validation.check_class_separation, 0.5)
    size_emphasis = table.take("size_emphasis", validation.check_size_emphasis, 2.0)
    non_overlap = table.take_optional("non_overlap", validation.check_non_overlap)

    if "image" in recipe.entries:
        if "class" in recipe.entries:
            raise recipe.error("image", "cannot be combined with [[class]]: the image's inks are the classes")
        if non_overlap is not None:
            raise table.error("non_overlap", "cannot be combined with [image]: the ink model has its own")
        table = recipe.table("image")
        problem = table.build(lambda: _read_image(table, domain, class_separation, size_emphasis, own_seed))
        return replace(problem, avoid_overlap=avoid_overlap)
    classes = [_read_class(table) for table in recipe.tables("class")]
    recipe.check_unique("class", [body_class.name for body_class in classes])
    return recipe.build(
        lambda: Problem(domain, classes, Balance(class_separation, size_emphasis, non_overlap), own_seed, avoid_overlap)
    )


def recipe_colors(path: str | Path | ParsedRecipe, problem: Problem) -> list[tuple[float, float, float]] | None:
    """Return the colours that a halftone of a recipe is printed in, one per class; None where it names none.

    Those of an [image] are its inks'; classes without a colour are black beside those that have one.

    Args:
        path: A recipe that has been read without complaint, or what :func:`parse_recipe` made of it.
        problem: What :func:`read_recipe` made of it.
    """
    recipe = _parsed(path).entries
    image = recipe.get("image")
    if not isinstance(image, dict):
        colors = [table.get("color") for table in recipe["class"]]
        return [_check_color(c or [0, 0, 0], "`color`") for c in colors] if any(colors) else None
    inks = (
        [Ink(ink["name"], ink["cmy"]) for ink in image["inks"]]
        if "inks" in image
        else MODELS[image.get("model", DEFAULT_MODEL)].inks
    )
    color = {ink.name: ink.rgb for ink in inks}
    return [color[body_class.name] for body_class in problem.classes]


def recipe_densities(path: str | Path | ParsedRecipe) -> list[Path]:
    """Return the density files that a recipe names, in its order; it need not be free of mistakes.

    Raises:
        InputFileError: The recipe cannot be read as TOML.
    """
    parsed = _parsed(path)
    recipe = parsed.entries
    classes = recipe.get("class")
    tables = [table for table in classes if isinstance(table, dict)] if isinstance(classes, list) else []
    names = [table.get("density") for table in tables]
    for table in tables:
        sizes = table.get("size")
        for size in sizes if isinstance(sizes, list) else []:
            line = size.get("line") if isinstance(size, dict) else None
            if isinstance(line, dict):
                names += [line.get("length"), line.get("direction") if line.get("direction") not in WORDS else None]
    image = recipe.get("image")
    names.append(image.get("file") if isinstance(image, dict) else None)
    return [parsed.path.parent / name for name in names if isinstance(name, str)]


def _read_class(table: _Table) -> BodyClass:
    table.name_it("class")
    table.check_keys("name", "density", "invert", "size", "count", "density_correction", "unsharp", "color")
    name = table.take("name", validation.check_name)
    density = table.take("density", _check_density)
    invert = table.take("invert", validation.check_switch, False)
    table.take_optional("color", _check_color)
    count = table.take_optional("count", validation.check_class_count)
    correction = table.take("density_correction", validation.check_switch, False)
    unsharp = None
    if "unsharp" in table.entries:
        entries = table.table("unsharp")
        entries.check_keys("amount", "radius")
        amount = entries.take("amount", validation.check_at_least_zero, 1.0)
        unsharp = Unsharp(amount, entries.take("radius", validation.check_positive, 2.0))
    sizes = [_read_size(size, count is not None) for size in table.tables("size")]
    table.check_unique("size", [size.name for size in sizes])
    image: Any = density
    if isinstance(density, str):
        image = table.read("density", lambda path: read_density(path, invert))
    elif invert:
        raise table.error("invert", f"is only for a `density` that is an image; `density` is {show(density)}")
    return table.build(
        lambda: BodyClass(name, sizes, image, count=count, density_correction=correction, unsharp=unsharp)
    )


def _read_size(table: _Table, of_shares: bool) -> Size:
    table.name_it("size")
    table.check_keys("name", "area", "count", "share", "distribution", "line")
    name = table.take("name", validation.check_name)
    if of_shares and "count" in table.entries:
        raise table.error(
            "count", "cannot be combined with a `count` of the class: give a `share` of the class instead"
        )
    return table.build(
        lambda: Size(
            name=name,
            area=table.take("area", validation.check_area_or_range),
            count=None if of_shares or "share" in table.entries else table.take("count", validation.check_count),
            share=table.take_optional("share", validation.check_share),
            distribution=table.take("distribution", validation.check_distribution, "linear"),
            line=_read_line(table.table("line")) if "line" in table.entries else None,
        )
    )


def _read_line(table: _Table) -> Line:
    table.check_keys(
        "length",
        "length_range",
        "direction",
        "direction_kind",
        "width",
        "charges",
        "middle_charge",
        "turn_weights",
        "stretch_weights",
        "straightness",
        "tensor_scales",
    )
    length: Any = table.take("length", _check_length)
    if isinstance(length, str):
        low, high = table.take("length_range", _check_length_range)
        grey = table.read("length", lambda path: read_color(path)).mean(axis=2)
        length = low + (high - low) * grey
    elif "length_range" in table.entries:
        raise table.error("length_range", f"is only for a `length` that is an image; `length` is {show(length)}")
    direction: Any = table.take("direction", _check_direction, "density")
    kind = table.take("direction_kind", _check_direction_kind, "angle")
    if isinstance(direction, str) and direction not in WORDS:
        image = table.read("direction", lambda path: read_color(path))
        angles = direction_from_angle_image(image.mean(axis=2))
        direction = table.take("direction", lambda _, key: _vectors(image, key)) if kind == "vector" else angles
    elif "direction_kind" in table.entries:
        raise table.error(
            "direction_kind", f"is only for a `direction` that is an image; `direction` is {show(direction)}"
        )
    default = Line(1.0)
    return table.build(
        lambda: Line(
            length,
            direction,
            width=table.take_optional("width", validation.check_length),
            charges=table.take("charges", validation.check_charges, default.charges),
            middle_charge=table.take("middle_charge", validation.check_positive, default.middle_charge),
            turn_weights=table.take("turn_weights", validation.check_weights, default.turn_weights),
            stretch_weights=table.take("stretch_weights", validation.check_weights, default.stretch_weights),
            straightness=table.take_optional("straightness", validation.check_fraction),
            tensor_scales=table.take("tensor_scales", validation.check_scales, default.tensor_scales),
        )
    )


def _read_image(
    table: _Table, domain: Domain, class_separation: float, size_emphasis: float | tuple[float, ...], seed: int
) -> Problem:
    table.check_keys("file", "model", "inks", "non_overlap", "area", "size", "density_correction")
    image = table.read("file", read_color)
    model: str | InkModel = table.take("model", _check_model, DEFAULT_MODEL)
    if "inks" in table.entries:
        if "model" in table.entries:
            raise table.error("inks", "cannot be combined with `model`: give one of the two")
        inks = table.take("inks", _check_inks)
        matrix = table.take("non_overlap", validation.check_non_overlap)
        model = InkModel("inks", inks, np.asarray(matrix))
    sizes = [_read_size(size, True) for size in table.tables("size")] if "size" in table.entries else None
    if sizes is not None and "area" in table.entries:
        raise table.error("area", "cannot be combined with [[image.size]], which have areas of their own")
    return halftone_problem(
        image,
        model,
        area=table.take("area", validation.check_area) if sizes is None else 1.0,
        sizes=sizes,
        domain=domain,
        class_separation=class_separation,
        size_emphasis=size_emphasis,
        density_correction=table.take("density_correction", validation.check_switch, False),
        seed=seed,
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
    return float(validation.check_density(value, key)[0, 0])


def _check_file(value: object, key: str) -> str:
    if not isinstance(value, str) or not value.strip():
        raise ProblemError(f"{key} must be the name of an image file; got {show(value)}")
    return value


def _check_length(value: object, key: str) -> str | float:
    if isinstance(value, str):
        if Path(value).suffix:
            return value
        raise ProblemError(f"{key} must be a number in metres above 0, or the name of an image; got {show(value)}")
    return validation.check_length(value, key)


def _check_length_range(value: object, key: str) -> tuple[float, float]:
    entries = value if isinstance(value, list) else []
    if len(entries) != 2:
        raise ProblemError(f"{key} must be two lengths in metres, of black and of white; got {show(value)}")
    low, high = (validation.check_length(entry, key) for entry in entries)
    return low, high


def _check_direction(value: object, key: str) -> str | float:
    if isinstance(value, str) and (value in WORDS or Path(value).suffix):
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ProblemError(
            f'{key} must be "density", "none", an angle in radians or the name of an image; got {show(value)}'
        )
    angle = validation.check_direction(value, key)
    assert isinstance(angle, float)
    return angle


def _check_direction_kind(value: object, key: str) -> str:
    if not isinstance(value, str) or value not in ("angle", "vector"):
        raise ProblemError(f'{key} must be "angle" or "vector"; got {show(value)}')
    return value


def _vectors(image: np.ndarray, key: str) -> np.ndarray:
    if not image[..., :2].any():
        raise ProblemError(
            f"{key} must have a direction somewhere; red and green of its image are 0 everywhere, and 0.5 means none"
        )
    try:
        vectors = direction_from_rg(image)
    except ProblemError as error:
        raise ProblemError(f"{key}: {error}") from None
    validation.check_direction(vectors, key)
    return vectors


def _check_color(value: object, key: str) -> tuple[float, float, float]:
    entries = value if isinstance(value, list) else []
    parts = [validation.as_float(entry) for entry in entries]
    if len(parts) == 3:
        red, green, blue = (-1.0 if part is None else part for part in parts)
        if min(red, green, blue) >= 0.0 and max(red, green, blue) <= 1.0:
            return red, green, blue
    raise ProblemError(f"{key} must be three numbers between 0 and 1, red, green and blue; got {show(value)}")


def _check_model(value: object, key: str) -> str:
    if not isinstance(value, str) or value not in MODELS:
        raise ProblemError(f"{key} must be one of {', '.join(MODELS)}; got {show(value)}")
    return value


def _check_inks(value: object, key: str) -> list[Ink]:
    if not isinstance(value, list) or not all(
        isinstance(entry, dict) and set(entry) == {"name", "cmy"} for entry in value
    ):
        raise ProblemError(f"{key} must be a list of {{ name = ..., cmy = [0, 1, 1] }}; got {show(value)}")
    return [Ink(entry["name"], entry["cmy"]) for entry in value]


def _parsed(path: str | Path | ParsedRecipe) -> ParsedRecipe:
    return path if isinstance(path, ParsedRecipe) else parse_recipe(path)


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        if path.is_dir():
            raise InputFileError(f"{path} is a folder; a recipe is a TOML file")
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
    except InputFileError:  # it is a ValueError, too
        raise
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
                nearest = difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.6)
                meant = f"did you mean `{nearest[0]}`" if nearest else f"known are {', '.join(known)}"
                raise self.error(show(name).strip('"'), f"is not a known key; {meant}")

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
            where = f"`{self.place.rstrip('.')}`: " if self.place else ""
            raise InputFileError(f"{self.path}: {where}{error}") from None

    def read(self, name: str, reader: Callable[[Path], Value]) -> Value:
        """Return what ``reader`` makes of the file beside the recipe that a key names."""
        file = self.take(name, _check_file)
        try:
            return reader(self.path.parent / file)
        except InputFileError as error:
            raise self.error(name, f"cannot be used: {error}") from None

    def table(self, name: str, *, optional: bool = False) -> _Table:
        """Return a table inside this one, an empty one where it is missing and need not be there."""
        header = f"[{self._header(name)}]"
        if name not in self.entries and not optional:
            raise self.error(name, f"is missing: write a table {header}")
        entries = self.entries.get(name, {})
        if not isinstance(entries, dict):
            raise self.error(name, f"must be one table, under a line {header}; got {show(entries)}")
        return _Table(self.path, f"{self.place}{name}.", self.names, entries)

    def tables(self, name: str) -> list[_Table]:
        """Return the tables of a list inside this one; at least one."""
        header = f"[[{self._header(name)}]]"
        entries = self.entries.get(name, [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            raise self.error(name, f"must be tables, each under a line {header}; got {show(entries)}")
        if not entries:
            raise self.error(name, f"is missing: write at least one table {header}")
        return [
            _Table(self.path, f"{self.place}{name}[{number}].", self.names, entry)
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
                raise self.error(
                    f"{kind}[{number}].name", f'must be another than that of {kind}[{first}]; got "{name}"'
                )
