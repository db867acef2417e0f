"""Recipes whose densities may be larger than memory: those in files that can be read in parts are not read as a whole."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import InputFileError, ProblemError
from ..problem.body_class import PlacingSettings
from ..problem.problem import Problem
from .recipe import ParsedRecipe, parse_recipe, read_recipe, recipe_densities
from .window_images import GEOTIFF, WINDOWED, Georeference, WindowImage, open_window_image, read_world_file

__all__ = ["WindowedRecipe", "read_windowed_recipe"]

# Keys that look at a density as a whole, beside a count of "cover".
WHOLE = ("unsharp", "density_correction")


@dataclass(frozen=True, eq=False)
class WindowedRecipe:
    """What a recipe describes.

    Attributes:
        problem: Its problem; classes whose densities are read by window have a uniform one in it, and none has clumps.
        windowed: Densities that are read by window, by the index of their class.
        clumps: Strength and diameter [m] of clumps, by the index of their class; a diameter of 0 is to be chosen.
        georeference: Where the domain lies, where a density's file says it, and the rows and columns of that.
    """

    problem: Problem
    windowed: dict[int, WindowImage]
    clumps: dict[int, tuple[float, float]]
    georeference: tuple[Georeference, tuple[int, int]] | None


def read_windowed_recipe(path: str | Path | ParsedRecipe, *, seed: int | None) -> WindowedRecipe:
    """Read a recipe; see :func:`~.recipe.read_recipe`.

    Densities that are ``.npy`` or GeoTIFF files are opened and not read, unless the class needs to know all of one: for sharpening,
    a covered share, a count of ``"cover"`` or lines along its edges.

    Clumps are left to whoever reads densities by window: they are too many for one image.

    Raises:
        InputFileError: As there, or a GeoTIFF of such a class.
    """
    parsed = path if isinstance(path, ParsedRecipe) else parse_recipe(path)
    tables = parsed.entries.get("class")
    tables = tables if isinstance(tables, list) else []
    changed: list[Any] = []
    windowed: dict[int, WindowImage] = {}
    tables, clumps = _without_clumps(tables)
    for number, table in enumerate(tables):
        name = table.get("density") if isinstance(table, dict) else None
        ending = Path(name).suffix.lower() if isinstance(name, str) else ""
        if not isinstance(name, str) or ending not in WINDOWED:
            changed.append(table)
            continue
        whole = [key for key in WHOLE if table.get(key) not in (None, False)]
        whole += ["count"] if table.get("count") == "cover" else []
        whole += ["size"] if any(_follows_edges(size) for size in _tables(table.get("size"))) else []
        if whole and ending in GEOTIFF:
            raise InputFileError(
                f"{parsed.path}: `class[{number + 1}].{whole[0]}` must not be given for a GeoTIFF, which is never read as a whole; "
                "use a .npy or .png file"
            )
        if whole or not isinstance(table.get("invert", False), bool):
            changed.append(table)
            continue
        windowed[number] = open_window_image(parsed.path.parent / name, table.get("invert", False))
        changed.append({key: value for key, value in table.items() if key != "invert"} | {"density": 1.0})
    entries = parsed.entries | ({"class": changed} if tables else {})
    problem = read_recipe(replace(parsed, entries=entries), seed=seed)
    return WindowedRecipe(problem, windowed, clumps, _georeference(parsed, problem, windowed))


def _without_clumps(tables: list[Any]) -> tuple[list[Any], dict[int, tuple[float, float]]]:
    """Tables of classes without their clumps, and these; what has no meaning is left for the reader to name."""
    keys = ("clustering", "clump_size")
    changed, clumps = [], {}
    for number, table in enumerate(tables):
        if isinstance(table, dict) and "clustering" in table:
            with contextlib.suppress(ProblemError):
                asked = PlacingSettings(**{key: table[key] for key in keys if key in table})
                if asked.clustering > 0.0:
                    clumps[number] = asked.clustering, asked.clump_size
                table = {key: value for key, value in table.items() if key not in keys}
        changed.append(table)
    return changed, clumps


def _tables(value: Any) -> list[dict[str, Any]]:
    return [entry for entry in value if isinstance(entry, dict)] if isinstance(value, list) else []


def _follows_edges(size: dict[str, Any]) -> bool:
    """Whether bodies are lines along the edges of the density, which are measured against its strongest one."""
    line = size.get("line")
    return isinstance(line, dict) and line.get("direction", "density") == "density"


def _georeference(
    parsed: ParsedRecipe, problem: Problem, windowed: dict[int, WindowImage]
) -> tuple[Georeference, tuple[int, int]] | None:
    for image in windowed.values():
        if image.georeference is not None:
            return image.georeference, image.shape
    tables = parsed.entries.get("class")
    if not isinstance(tables, list):
        return None
    known = {path.resolve() for path in recipe_densities(parsed)}
    for number, table in enumerate(tables):
        name = table.get("density") if isinstance(table, dict) else None
        path = parsed.path.parent / name if isinstance(name, str) else None
        if number in windowed or path is None or path.resolve() not in known:
            continue
        asked = problem.classes[number].asked
        if asked is None or callable(asked.density) or not hasattr(asked.density, "shape"):
            continue
        shape = (int(asked.density.shape[0]), int(asked.density.shape[1]))
        place = read_world_file(path, shape)
        if place is not None:
            return place, shape
    return None
