"""The keys of a recipe: which setting each stands for, how it is read and how it is written.

Most settings are plain: a key of the same name, whose value the setting's own check looks at. Those that are more, such as images,
are in the table ``SPECIAL``.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import ProblemError
from ..problem import validation
from ..problem.body_class import BodyClass
from ..problem.direction_field import direction_from_angle_image, direction_from_rg
from ..problem.fixed_bodies import FixedBodies
from ..problem.footprints import Footprints
from ..problem.given_values import show
from ..problem.line import Line
from ..problem.obstacles import Obstacle
from ..problem.settings import settings_of
from ..problem.size import Size
from ..problem.surface_density import SurfaceDensity
from ..problem.surface_directions import SurfaceDirection
from .image_files import read_array, read_color, read_density
from .recipe_footprints import FOOTPRINT_KEYS, OUTLINES, check_footprint, written_outlines
from .recipe_surface import read_surface_density, read_surface_direction
from .recipe_table import RecipeTable

__all__ = ["WORDS", "NameArray", "keys_of", "plain_value", "read_group", "read_settings", "written_settings"]

# Directions that are no names of images.
WORDS = ("density", "none", "slope")
# Gets what an array is, "density" for example, and the array; returns the name of its file beside the recipe.
NameArray = Callable[[str, np.ndarray], str]


class Key(NamedTuple):
    """How a setting that is more than a plain value stands in a recipe.

    Attributes:
        names: The keys that it takes, its own first.
        read: Returns its value, from the table that holds it.
        write: Returns the keys and values to write for it.
    """

    names: tuple[str, ...]
    read: Callable[[RecipeTable], Any]
    write: Callable[[Any, NameArray], dict[str, Any]]


def keys_of(cls: Any) -> tuple[str, ...]:
    """Return the keys that the settings of a class stand under."""
    names: list[str] = []
    for name in settings_of(cls):
        special = SPECIAL.get((cls, name))
        names.extend(special.names if special else [name])
    return tuple(names)


def read_settings(table: RecipeTable, cls: Any, *, leave: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the settings of a class that a table gives, by name; those that it does not give keep their defaults.

    Args:
        table: The table of the recipe.
        cls: A described dataclass of the room :mod:`~esh.engine.problem`.
        leave: Settings that are read elsewhere.

    Raises:
        InputFileError: A value without meaning, or a missing one without a default.
    """
    values: dict[str, Any] = {}
    for name, one in settings_of(cls).items():
        special = SPECIAL.get((cls, name))
        given = any(key in table.entries for key in (special.names if special else (name,)))
        if name in leave or not (given or one.required or (cls, name) in DEMANDED):
            continue
        if special is not None:
            values[name] = special.read(table)
        elif one.setting.of is not None:
            values[name] = read_group(table.table(name), one.setting.of)
        else:
            values[name] = table.take(name, one.checked)
    return values


def read_group(table: RecipeTable, cls: Any) -> Any:
    """Return what a table of its own describes; it has no keys but those of this class."""
    table.check_keys(*keys_of(cls))
    values = read_settings(table, cls)
    return table.build(lambda: cls(**values))


def written_settings(instance: Any, cls: Any, name_array: NameArray, *, leave: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return keys and values for the settings of an instance that are not the defaults; a group is a dictionary of its own."""
    keys: dict[str, Any] = {}
    for name, one in settings_of(cls).items():
        value = getattr(instance, name)
        special = SPECIAL.get((cls, name))
        if name in leave or value is None:
            continue
        if special is not None:
            keys.update(special.write(value, name_array))
        elif one.setting.of is not None:
            keys[name] = written_settings(value, one.setting.of, name_array)
        elif one.required or plain_value(value) != plain_value(one.default):
            keys[name] = plain_value(value)
    return keys


def plain_value(value: Any) -> Any:
    """Return a value as numbers, words and lists of them."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [plain_value(entry) for entry in value] if isinstance(value, list | tuple) else value


# Densities


def _read_density(table: RecipeTable) -> np.ndarray | float | SurfaceDensity:
    if isinstance(table.entries.get("density"), dict):
        if "invert" in table.entries:
            raise table.error("invert", "belongs into the table of a `density` that is an `image`")
        return read_surface_density(table.table("density"))
    density = table.take("density", _check_density)
    invert = table.take("invert", validation.check_switch, False)
    if isinstance(density, str):
        return table.read("density", lambda path: read_density(path, invert))
    if invert:
        raise table.error("invert", f"is only for a `density` that is an image; `density` is {show(density)}")
    return density


def _write_density(density: np.ndarray | SurfaceDensity, name_array: NameArray) -> dict[str, Any]:
    if callable(density):
        raise ProblemError(
            "`density` must be a number or an image in a recipe that is written; it is a function of points"
        )
    return {"density": float(density[0, 0]) if density.size == 1 else name_array("density", density)}


# Lines


def _read_length(table: RecipeTable) -> np.ndarray | float:
    length = table.take("length", _check_length)
    if isinstance(length, str):
        if _is_array(length) and "length_range" not in table.entries:
            return table.read("length", read_array)
        low, high = table.take("length_range", _check_length_range)
        return low + (high - low) * table.read("length", lambda path: read_color(path, reduced=True)).mean(axis=2)
    if "length_range" in table.entries:
        raise table.error("length_range", f"is only for a `length` that is an image; `length` is {show(length)}")
    return length


def _write_length(length: np.ndarray | float, name_array: NameArray) -> dict[str, Any]:
    return {"length": name_array("length", length) if isinstance(length, np.ndarray) else length}


def _read_direction(table: RecipeTable) -> str | float | np.ndarray | SurfaceDirection:
    if isinstance(table.entries.get("direction"), dict):
        if "direction_kind" in table.entries:
            raise table.error("direction_kind", "is only for a `direction` that is an image; `direction` is a table")
        return read_surface_direction(table.table("direction"))
    direction = table.take("direction", _check_direction, "density")
    kind = table.take("direction_kind", _check_direction_kind, "angle")
    if not isinstance(direction, str) or direction in WORDS:
        if "direction_kind" in table.entries:
            raise table.error(
                "direction_kind", f"is only for a `direction` that is an image; `direction` is {show(direction)}"
            )
        return direction
    if kind == "radians" or (kind == "vector" and _is_array(direction)):
        array = table.read("direction", read_array)
        if kind == "radians" or array.ndim == 3:
            return table.take("direction", lambda _, key: validation.check_direction(array, key))
    image = table.read("direction", read_color)
    if kind == "vector":
        return table.take("direction", lambda _, key: _vectors(image, key))
    return direction_from_angle_image(image.mean(axis=2))


def _write_direction(direction: str | float | np.ndarray, name_array: NameArray) -> dict[str, Any]:
    if not isinstance(direction, np.ndarray):
        return {} if direction == "density" else {"direction": direction}
    kind = "vector" if direction.ndim == 3 else "radians"
    return {"direction": name_array("direction", direction), "direction_kind": kind}


# Outlines


def _read_footprint(table: RecipeTable) -> Footprints:
    for name in FOOTPRINT_KEYS:
        if name in table.entries and "footprint" not in table.entries:
            raise table.error(name, "is only for a size with a `footprint`")
    outlines, weights = table.take("footprint", check_footprint)
    given = read_settings(table, Footprints, leave=OUTLINES)
    return table.build(lambda: Footprints(outlines, weights, **given))


def _write_footprint(footprints: Footprints, name_array: NameArray) -> dict[str, Any]:
    keys = written_settings(footprints, Footprints, name_array, leave=OUTLINES)
    return {"footprint": written_outlines(footprints), **keys}


def _read_slope(table: RecipeTable) -> np.ndarray:
    table.take("slope", _check_slope)
    return table.read("slope", read_array)


def _write_slope(slope: np.ndarray, name_array: NameArray) -> dict[str, Any]:
    return {"slope": name_array("slope", slope)}


# What is there before anything is placed


def _named(key: str) -> Key:
    """A class or a size, which recipes call by their names."""
    return Key((key,), lambda table: table.take(key, _check_label), lambda name, _: {key: name})


def _check_label(value: object, key: str) -> str:
    if not isinstance(value, str) or not value.strip():
        raise ProblemError(f"{key} must be a name; got {show(value)}")
    return value


def _read_obstacle_image(table: RecipeTable) -> np.ndarray | None:
    invert = table.take("invert", validation.check_switch, False)
    if "image" in table.entries:
        return table.read("image", lambda path: read_density(path, invert))
    if invert:
        raise table.error("invert", "is only for an obstacle that is an `image`")
    return None


def _write_obstacle_image(image: np.ndarray, name_array: NameArray) -> dict[str, Any]:
    return {"image": name_array("obstacle", image)}


def _check_slope(value: object, key: str) -> str:
    if not isinstance(value, str) or not _is_array(value):
        raise ProblemError(f"{key} must be the name of a .npy file of slopes [rows, columns, 2]; got {show(value)}")
    return value


def _is_array(name: str) -> bool:
    return Path(name).suffix.lower() == ".npy"


def _check_density(value: object, key: str) -> str | float:
    if isinstance(value, str) and value.strip():
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ProblemError(f"{key} must be the name of an image file or a number above 0; got {show(value)}")
    return float(validation.check_density(value, key)[0, 0])


def _check_length(value: object, key: str) -> str | float:
    if isinstance(value, str):
        if Path(value).suffix:
            return value
        raise ProblemError(f"{key} must be a number in meters above 0, or the name of an image; got {show(value)}")
    return validation.check_length(value, key)


def _check_length_range(value: object, key: str) -> tuple[float, float]:
    entries = value if isinstance(value, list) else []
    if len(entries) != 2:
        raise ProblemError(f"{key} must be two lengths in meters, of black and of white; got {show(value)}")
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
    if not isinstance(value, str) or value not in ("angle", "vector", "radians"):
        raise ProblemError(f'{key} must be "angle" or "vector", or "radians" for a .npy file; got {show(value)}')
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


SPECIAL: dict[tuple[type, str], Key] = {
    (Size, "footprint"): Key(("footprint", *FOOTPRINT_KEYS), _read_footprint, _write_footprint),
    (Footprints, "slope"): Key(("slope",), _read_slope, _write_slope),
    (BodyClass, "density"): Key(("density", "invert"), _read_density, _write_density),
    (FixedBodies, "body_class"): _named("class"),
    (FixedBodies, "size"): _named("size"),
    (Obstacle, "image"): Key(("image", "invert"), _read_obstacle_image, _write_obstacle_image),
    (Line, "length"): Key(("length", "length_range"), _read_length, _write_length),
    (Line, "direction"): Key(("direction", "direction_kind"), _read_direction, _write_direction),
}
# Recipes have to say what classes follow; in scripts a class may leave it out.
DEMANDED = {(BodyClass, "density")}
