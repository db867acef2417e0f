"""What is there before anything is placed: the tables [[fixed]] and [[obstacle]] of a recipe."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..problem.fixed_bodies import FixedBodies, Origin
from ..problem.fixed_table import FixedTable
from ..problem.obstacles import Obstacle
from ..problem.problem import Problem
from ..problem.settings import settings_of, settle
from .fixed_files import read_fixed_bodies
from .recipe_keys import NameArray, keys_of, read_group, read_settings, written_settings
from .recipe_table import RecipeTable

__all__ = ["files_of_tables", "read_fixed", "read_obstacles", "written_fixed", "written_obstacles"]


def read_fixed(recipe: RecipeTable) -> list[FixedBodies]:
    """Return the bodies of all tables [[fixed]]; none where there is no such table."""
    return [_read_fixed(table) for table in recipe.tables("fixed")] if "fixed" in recipe.entries else []


def read_obstacles(recipe: RecipeTable) -> list[Obstacle]:
    """Return the obstacles of all tables [[obstacle]]; none where there is no such table."""
    return [read_group(table, Obstacle) for table in recipe.tables("obstacle")] if "obstacle" in recipe.entries else []


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
    return [written_settings(obstacle, Obstacle, name_array) for obstacle in problem.obstacles]


def _read_fixed(table: RecipeTable) -> FixedBodies:
    keys = keys_of(FixedBodies)
    table.check_keys("file", *keys)
    given = [name for name in ("file", "position") if name in table.entries]
    if len(given) != 1:
        raise table.error(
            "position", "or `file` must be given: one of the two" if not given else "cannot be combined with `file`"
        )
    if given == ["position"]:
        values = read_settings(table, FixedBodies)
        bodies = table.build(lambda: FixedBodies(**values))
        # There may be several such tables, and each lists many bodies.
        settle(bodies, origin=Origin(f"`{table.place.removesuffix('.')}`"))
        return bodies
    labels = read_settings(table, FixedBodies, leave=tuple(settings_of(FixedBodies).keys() - {"body_class", "size"}))
    for name in keys:
        if name in table.entries and name not in ("class", "size"):
            raise table.error(name, "is only for bodies that the recipe lists by `position`; the `file` has its own")
    return table.read("file", lambda path: read_fixed_bodies(path, **labels))
