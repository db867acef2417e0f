"""What is there before anything is placed: the tables [[fixed]] and [[obstacle]] of a recipe."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import ProblemError
from ..problem import validation
from ..problem.fixed_bodies import FixedBodies, FixedTable
from ..problem.obstacles import Obstacle, check_ball, check_disc, check_polygon
from ..problem.problem import Problem
from ..problem.validation import show
from .fixed_files import read_fixed_bodies
from .image_files import read_density
from .recipe_keys import NameArray
from .recipe_table import RecipeTable

__all__ = ["files_of_tables", "read_fixed", "read_obstacles", "written_fixed", "written_obstacles"]


def read_fixed(recipe: RecipeTable) -> list[FixedBodies]:
    """Return the bodies of all tables [[fixed]]; none where there is no such table."""
    return [_read_fixed(table) for table in recipe.tables("fixed")] if "fixed" in recipe.entries else []


def read_obstacles(recipe: RecipeTable) -> list[Obstacle]:
    """Return the obstacles of all tables [[obstacle]]; none where there is no such table."""
    return [_read_obstacle(table) for table in recipe.tables("obstacle")] if "obstacle" in recipe.entries else []


def files_of_tables(recipe: dict[str, Any]) -> list[object]:
    """Return the names of files that these tables name; the recipe need not be free of mistakes."""
    names: list[object] = []
    for header, key in (("fixed", "file"), ("obstacle", "image")):
        tables = recipe.get(header)
        names += [table.get(key) for table in tables if isinstance(table, dict)] if isinstance(tables, list) else []
    return names


def written_fixed(problem: Problem) -> list[dict[str, Any]]:
    """Return keys and values of a table [[fixed]] for every size that has fixed bodies."""
    table: FixedTable = problem.fixed
    tables = []
    for c, body_class in enumerate(problem.classes):
        for s, size in enumerate(body_class.sizes):
            own = (table.class_index == c) & (table.size_index == s)
            if not own.any():
                continue
            keys: dict[str, Any] = {
                "class": body_class.name,
                "size": size.name,
                "position": table.position[own].tolist(),
                "angle": table.angle[own].tolist(),
                "area": table.area[own].tolist(),
            }
            # TOML has a number that is none, but nobody wants to read it.
            if not np.isnan(table.length[own]).any():
                keys["length"] = table.length[own].tolist()
            if table.variant[own].any():
                keys["variant"] = table.variant[own].tolist()
            if not np.isnan(table.scale[own]).any():
                keys["scale"] = table.scale[own].tolist()
            if (table.id[own] >= 0).all():
                keys["id"] = table.id[own].tolist()
            tables.append(keys)
    return tables


def written_obstacles(problem: Problem, name_array: NameArray) -> list[dict[str, Any]]:
    """Return keys and values of the tables [[obstacle]]."""
    tables: list[dict[str, Any]] = []
    for obstacle in problem.obstacles:
        keys: dict[str, Any] = {}
        if obstacle.polygon is not None:
            keys["polygon"] = np.asarray(obstacle.polygon).tolist()
        elif obstacle.disc is not None:
            keys["disc"] = list(obstacle.disc)
        elif obstacle.ball is not None:
            keys["ball"] = list(obstacle.ball)
        elif obstacle.image is not None:
            keys["image"] = name_array("obstacle", obstacle.image)
        if obstacle.margin:
            keys["margin"] = obstacle.margin
        tables.append(keys)
    return tables


def _read_fixed(table: RecipeTable) -> FixedBodies:
    table.check_keys("file", "class", "size", "position", "angle", "length", "area", "id", "variant", "scale")
    given = [name for name in ("file", "position") if name in table.entries]
    if len(given) != 1:
        raise table.error(
            "position", "or `file` must be given: one of the two" if not given else "cannot be combined with `file`"
        )
    body_class = table.take_optional("class", _check_label)
    size = table.take_optional("size", _check_label)
    if given == ["file"]:
        for name in ("angle", "length", "area", "id", "variant", "scale"):
            if name in table.entries:
                raise table.error(
                    name, "is only for bodies that the recipe lists by `position`; the `file` has its own"
                )
        return table.read("file", lambda path: read_fixed_bodies(path, body_class=body_class, size=size))
    return table.build(
        lambda: FixedBodies(
            table.take("position", _check_positions),
            0 if body_class is None else body_class,
            0 if size is None else size,
            table.take("angle", _check_numbers, 0.0),
            table.take_optional("length", _check_numbers),
            table.take_optional("area", _check_numbers),
            table.take_optional("id", _check_ids),
            table.take("variant", _check_numbers, 0),
            table.take_optional("scale", _check_numbers),
        )
    )


def _read_obstacle(table: RecipeTable) -> Obstacle:
    table.check_keys("polygon", "disc", "image", "ball", "invert", "margin")
    image = None
    invert = table.take("invert", validation.check_switch, False)
    if "image" in table.entries:
        image = table.read("image", lambda path: read_density(path, invert))
    elif invert:
        raise table.error("invert", "is only for an obstacle that is an `image`")
    return table.build(
        lambda: Obstacle(
            table.take_optional("polygon", check_polygon),
            table.take_optional("disc", check_disc),
            image,
            table.take("margin", validation.check_at_least_zero, 0.0),
            table.take_optional("ball", check_ball),
        )
    )


def _check_label(value: object, key: str) -> str:
    if not isinstance(value, str) or not value.strip():
        raise ProblemError(f"{key} must be a name; got {show(value)}")
    return value


def _check_positions(value: object, key: str) -> np.ndarray:
    try:
        position = np.array(value, dtype=np.float64)
    except validation.FOREIGN_ERRORS:
        position = np.empty(0)
    if position.ndim != 2 or position.shape[1] not in (2, 3) or isinstance(value, str):
        raise ProblemError(
            f"{key} must be a list of positions, each x and y in meters, and z on a surface; got {show(value)}"
        )
    return position


def _check_numbers(value: object, key: str) -> np.ndarray:
    entries = value if isinstance(value, list) else [value]
    numbers = [validation.as_float(entry) for entry in entries]
    if any(number is None for number in numbers):
        raise ProblemError(f"{key} must be a number, or a list of one for every position; got {show(value)}")
    return np.array(numbers if isinstance(value, list) else numbers[0], dtype=np.float64)


def _check_ids(value: object, key: str) -> np.ndarray:
    if not isinstance(value, list) or not all(
        isinstance(entry, int) and not isinstance(entry, bool) for entry in value
    ):
        raise ProblemError(f"{key} must be a list of whole numbers, one for every position; got {show(value)}")
    return np.array([min(max(entry, -2), 2**40) for entry in value], dtype=np.int64)
