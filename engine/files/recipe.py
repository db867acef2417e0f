"""Recipes: TOML files that describe a problem, version 1.

    version = 1
    seed = 7                       # default 0
    avoid_overlap = false          # default; true: footprints push each other apart
    regularity = 0.6               # default; 1: nearly a lattice, 0: organic
    [domain]
    size = [40.0, 30.0]            # meters, x and y
    boundary = "open"              # default; or "natural", "mirror", "periodic"
    inset = false                  # default; true: footprints lie inside as a whole
    [balance]
    class_separation = 0.5         # default
    size_emphasis = 2.0            # default; or a list, one for each larger size
    rare_emphasis = 1.0            # default; 0: classes of few bodies are treated as all others
    non_overlap = [[1, 0], [0, 1]] # pairs of classes: 0 = each as if the other were not there; default: all 1
    [[class]]
    name = "pine"
    density = "pine.png"           # beside the recipe, white = many; or a number for a uniform density
    invert = false                 # default
    density_correction = false     # default; true: densities are covered shares, and dark ones come out dark
    unsharp = { amount = 1.0, radius = 2.0 }   # default: none
    clustering = 0.0               # default; 1: nearly all stand in clumps; clump_size = 4.0, in meters
    look_at = { point = [30.0, 0.0, 0.0], spread = 0.0, front = "-y" }   # default: none
    color = [0.0, 0.6, 0.3]        # of a halftone's ink: red, green and blue 0..1; default: black
    count = 300                    # of all sizes, which then have shares; or "cover"; default: every size has a count
    [[class.size]]
    name = "large"
    area = 3.0                     # footprint, m²; or a range [0.5, 2.0]
    count = 120                    # or share = 0.25 where the class has the count
    distribution = "linear"        # default, of a range; or "uniform", or a list of areas
    footprint = { rectangle = [2.0, 0.3] }   # outline; or { polygon = [[x, y], ...] }, { disc = radius } or
                                   # { capsule = [length, width] }, or a list of such; default: a disc of the area
    turn = "free"                  # default, of a footprint: as it fits; or "random", or radians
    scale_jitter = 0.0             # default: bodies are scaled by a factor within 1 ± this
    tilt = 0.0                     # default: bodies lean over by a random angle of at most this, in radians
    room = 1.0                     # default: factor on the footprint for keeping apart; or gap = 0.1, in meters
    [class.size.line]              # only for long bodies
    length = 2.0                   # meters; or an image beside the recipe, black = length_range[0], white = length_range[1]
    direction = "density"          # default; "none", radians, or an image beside the recipe
    direction_kind = "angle"       # default, of an image: gray 0..1 is half a turn; or "vector": red and green are x and y
    # width, charges, middle_charge, turn_weights, stretch_weights, straightness, tensor_scales: see Line in engine/problem/line.py

Instead of classes, a color image may give them: one class per ink (see :mod:`~esh.engine.problem.color_separation`).

    [image]
    file = "photo.png"
    model = "CMYK"                 # default; CMY, CMY-RG-K, CMY-RB-K, CMY-RGB-K; or a list of inks and its non_overlap matrix
    area = 0.01                    # of a dot, m²; or [[image.size]] tables with name, area and share

Instead of a rectangle, a surface:

    [surface]
    mesh = "rock.obj"              # OBJ, PLY, STL, GLB; or a list of files: meshes that touch are one surface
    [[class]]
    density = { attribute = "moss" }   # of the vertices; or { image = "moss.png" }, through the UV map; or
                                       # { image = "moss.png", mapping = "triplanar", size = 2.0 }, meters

What is there already, and what bodies keep off, both any number of times:

    include_fixed = false          # at the top; default: counts are of new bodies; true: they include fixed ones
    [[fixed]]
    file = "before.csv"            # or .npz, as placements are written; class and size, if given here, hold for all of the file
    [[fixed]]
    class = "pine"                 # default: the first
    size = "large"                 # default: the first of the class
    position = [[3.0, 4.0], [8.0, 2.5]]   # meters
    angle = 0.0                    # default; a number, or one for each; so are length, area and id
    [[obstacle]]
    polygon = [[0, 0], [4, 0], [4, 3]]    # corners in meters; or disc = [x, y, radius]; or an image beside the recipe, white =
    image = "lake.png"                    # obstacle (invert = true: black)
    margin = 0.5                   # meters; default 0

Messages name keys by their place, counted from 1: ``class[2].size[1].count`` is the count of the first size of the
second class.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputFileError, ProblemError
from ..problem import validation
from ..problem.balance import Balance
from ..problem.body_class import BodyClass, Unsharp
from ..problem.color_separation import MODELS, Ink, InkModel, halftone_problem
from ..problem.domain import Domain
from ..problem.fixed_bodies import FixedBodies
from ..problem.given_values import as_float, as_whole, show
from ..problem.ink_models import DEFAULT_MODEL
from ..problem.line import Line
from ..problem.look_at import LookAt
from ..problem.obstacles import Obstacle
from ..problem.problem import Problem, ProblemSettings
from ..problem.size import Size
from ..problem.surface import Surface
from .image_files import read_color
from .recipe_keys import WORDS, keys_of, read_group, read_settings
from .recipe_scene import files_of_tables, read_fixed, read_obstacles
from .recipe_surface import check_lies_on_surface, read_surface, surface_files
from .recipe_table import RecipeTable, read_toml

__all__ = ["ParsedRecipe", "parse_recipe", "read_recipe", "recipe_colors", "recipe_densities"]

VERSION = 1
AT_TOP = "at the top, before the first table"
AS_TABLE = "in the recipe itself, as a table of its own"
# Where keys stand, for messages about one that stands elsewhere: those of the first places are more likely meant. What stands after a
# table's header is that table's.
PLACES: dict[str, tuple[str, ...]] = {
    AT_TOP: (
        "version",
        *keys_of(ProblemSettings),
    ),
    AS_TABLE: ("domain", "surface", "balance", "class", "image", "fixed", "obstacle"),
    "under [[class]]": (*("size" if key == "sizes" else key for key in keys_of(BodyClass)), "color"),
    "under [[class.size]]": keys_of(Size),
    "under [domain]": keys_of(Domain),
    "under [balance]": keys_of(Balance),
    "under [class.size.line]": keys_of(Line),
    "under [surface]": ("mesh",),
    "under [image]": ("file", "model", "inks", "non_overlap", "area", "size", "density_correction"),
    "under [[fixed]]": ("file", *keys_of(FixedBodies)),
    "under [[obstacle]]": keys_of(Obstacle),
    "under [class.unsharp]": keys_of(Unsharp),
    "under [class.look_at]": keys_of(LookAt),
    "in the command, as an option": ("device", "max_steps"),
}


@dataclass(frozen=True)
class ParsedRecipe:
    """A recipe as TOML has it, not checked yet; whoever asks it several things parses the file once."""

    path: Path
    entries: dict[str, Any]


def parse_recipe(path: str | Path) -> ParsedRecipe:
    """Read a TOML file; raises InputFileError where it cannot be read as one."""
    if not isinstance(path, (str, os.PathLike)):
        raise InputFileError(f"`path` must be the path of a recipe; got {show(path)}")
    return ParsedRecipe(Path(path), read_toml(Path(path)))


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
    recipe = RecipeTable(parsed.path, "", "", parsed.entries, PLACES)
    # The version comes first: a recipe of another one may well have other keys.
    if "version" not in recipe.entries:
        raise recipe.error("version", f"is missing: write `version = {VERSION}` at the top of the recipe")
    recipe.take("version", _check_version)
    recipe.check_keys(*PLACES[AT_TOP], *PLACES[AS_TABLE])
    settings = read_settings(recipe, ProblemSettings)
    if seed is not None:
        settings["seed"] = validation.check_seed(seed)
    domain: Domain | Surface
    if "surface" in recipe.entries:
        for other in ("domain", "image"):
            if other in recipe.entries:
                raise recipe.error(
                    other, "cannot be combined with [surface]: bodies lie in a rectangle or on a surface"
                )
        domain = read_surface(recipe.table("surface"))
    else:
        domain = read_group(recipe.table("domain"), Domain)
    scene: dict[str, Any] = {"fixed": read_fixed(recipe), "obstacles": read_obstacles(recipe)}

    table = recipe.table("balance", optional=True)
    table.check_keys(*PLACES["under [balance]"])
    balance = read_settings(table, Balance)

    if "image" in recipe.entries:
        if "class" in recipe.entries:
            raise recipe.error("image", "cannot be combined with [[class]]: the image's inks are the classes")
        if "non_overlap" in balance:
            raise table.error("non_overlap", "cannot be combined with [image]: the ink model has its own")
        table = recipe.table("image")
        assert isinstance(domain, Domain)
        rectangle = domain
        problem = table.build(lambda: _read_image(table, rectangle, balance))
        return recipe.build(lambda: replace(problem, **settings, **scene))
    tables = recipe.tables("class")
    for table in tables if isinstance(domain, Surface) else ():
        check_lies_on_surface(table)
    classes = [_read_class(table) for table in tables]
    recipe.check_unique("class", [body_class.name for body_class in classes])
    return recipe.build(lambda: Problem(domain, classes, Balance(**balance), **settings, **scene))


def recipe_colors(path: str | Path | ParsedRecipe, problem: Problem) -> list[tuple[float, float, float]] | None:
    """Return the colors that a halftone of a recipe is printed in, one per class; None where it names none.

    Those of an [image] are its inks'; classes without a color are black beside those that have one.

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
    """Return the files that a recipe names, in its order; it need not be free of mistakes.

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
            names.append(size.get("slope") if isinstance(size, dict) else None)
            line = size.get("line") if isinstance(size, dict) else None
            if isinstance(line, dict):
                direction = line.get("direction")
                if isinstance(direction, dict):
                    direction = direction.get("curve")
                names += [line.get("length"), direction if direction not in WORDS else None]
    image = recipe.get("image")
    names.append(image.get("file") if isinstance(image, dict) else None)
    names += files_of_tables(recipe)
    names += surface_files(recipe)
    return [parsed.path.parent / name for name in names if isinstance(name, str)]


def _read_class(table: RecipeTable) -> BodyClass:
    table.name_it("class")
    table.check_keys(*PLACES["under [[class]]"])
    table.take_optional("color", _check_color)
    values = read_settings(table, BodyClass, leave=("sizes",))
    sizes = [_read_size(size, "count" in table.entries) for size in table.tables("size")]
    table.check_unique("size", [size.name for size in sizes])
    return table.build(lambda: BodyClass(sizes=sizes, **values))


def _read_size(table: RecipeTable, of_shares: bool) -> Size:
    table.name_it("size")
    table.check_keys(*PLACES["under [[class.size]]"])
    if of_shares and "count" in table.entries:
        raise table.error(
            "count", "cannot be combined with a `count` of the class: give a `share` of the class instead"
        )
    if not {"area", "footprint"} & table.entries.keys():
        raise table.error("area", "is missing")
    values = read_settings(table, Size)
    if not of_shares and not {"count", "share"} & values.keys():
        raise table.error("count", "is missing")
    return table.build(lambda: Size(**values))


def _read_image(table: RecipeTable, domain: Domain, balance: dict[str, Any]) -> Problem:
    table.check_keys(*PLACES["under [image]"])
    image = table.read("file", lambda path: read_color(path, reduced=True))
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
        density_correction=table.take("density_correction", validation.check_switch, False),
        **balance,
    )


def _check_version(value: object, key: str) -> int:
    version = as_whole(value, VERSION, VERSION)
    if version is None:
        raise ProblemError(f"{key} must be {VERSION}, the only version; got {show(value)}")
    return version


def _check_color(value: object, key: str) -> tuple[float, float, float]:
    entries = value if isinstance(value, list) else []
    parts = [as_float(entry) for entry in entries]
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
