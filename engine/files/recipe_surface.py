"""What a recipe says of surfaces: the meshes that bodies are placed on, and densities on them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputFileError, ProblemError
from ..problem import validation
from ..problem.given_values import show
from ..problem.settings import settings_of
from ..problem.surface import Surface, SurfaceMesh
from ..problem.surface_density import SurfaceAttribute, SurfaceDensity, SurfaceImage, SurfaceTriplanar
from ..problem.surface_directions import AlongCurves, SurfaceDirection, SurfaceVectors
from .csv_files import read_csv
from .image_files import read_density
from .input_file import check_is_file
from .mesh_files import read_meshes
from .recipe_table import RecipeTable

__all__ = ["check_lies_on_surface", "read_surface", "read_surface_density", "read_surface_direction", "surface_files"]

MAPPINGS = ("uv", "triplanar")


def read_surface(table: RecipeTable) -> Surface:
    """Return the surface that a table ``[surface]`` describes."""
    table.check_keys("mesh")
    meshes: list[SurfaceMesh] = []
    for file in table.take("mesh", _check_files):
        try:
            meshes += read_meshes(table.path.parent / file)
        except InputFileError as error:
            raise table.error("mesh", f"cannot be used: {error}") from None
    return table.build(lambda: Surface(meshes))


def check_lies_on_surface(table: RecipeTable) -> None:
    """Raise InputFileError where the density of a table ``[[class]]`` is an image that does not say how it lies on a surface."""
    density = table.entries.get("density")
    if isinstance(density, str):
        name = show(density)
        raise table.error("density", f"must say how the image lies on the surface: {{ image = {name} }}; got {name}")


def read_surface_density(table: RecipeTable) -> SurfaceDensity:
    """Return the density on a surface that a table ``density = { ... }`` describes."""
    table.check_keys("attribute", "image", "mapping", "size", "invert", inline=True)
    if "attribute" in table.entries:
        for key in table.entries:
            if key != "attribute":
                raise table.error(key, "cannot be combined with `attribute`: it is about an image")
        return SurfaceAttribute(table.take("attribute", validation.check_name))
    invert = table.take("invert", validation.check_switch, False)
    image = table.read("image", lambda path: read_density(path, invert))
    mapping = table.take("mapping", _check_mapping, "uv")
    if mapping == "triplanar":
        size = table.take("size", validation.check_length)
        return table.build(lambda: SurfaceTriplanar(image, size))
    if "size" in table.entries:
        raise table.error("size", 'is only for a `mapping` of "triplanar"')
    return table.build(lambda: SurfaceImage(image))


def read_surface_direction(table: RecipeTable) -> SurfaceDirection:
    """Return the direction on a surface that a table ``direction = { ... }`` describes."""
    table.check_keys("attribute", "curve", inline=True)
    given = [name for name in ("attribute", "curve") if name in table.entries]
    if len(given) != 1:
        raise table.error(
            "attribute", "or `curve` must be given: one of the two" if not given else "cannot be combined with `curve`"
        )
    if given == ["attribute"]:
        return SurfaceVectors(table.take("attribute", validation.check_name))
    if isinstance(table.entries["curve"], str):
        return AlongCurves(table.read("curve", _read_curves))
    return AlongCurves(table.take("curve", _check_curves))


def _read_curves(path: Path) -> Sequence[np.ndarray]:
    """Return the curves of a table, shape ``[m, 3]`` each: points one after the other, of several with the numbers of theirs."""
    check_is_file(path, "curves are a .csv file")
    columns, line = read_csv(path, ("x", "y", "z", "curve"))
    if "z" not in columns:
        raise InputFileError(f"{path} must have the columns `x`, `y` and `z`, and may have `curve`")
    for name in ("x", "y", "z", "curve"):
        # An empty cell was read as NaN.
        missing = ~np.isfinite(columns.get(name, np.zeros(len(line))))
        if missing.any():
            at = line[np.argmax(missing)]
            raise InputFileError(
                f"{path} must have a finite number in every line of its column `{name}`; line {at} has none"
            )
    point = np.stack([columns[axis] for axis in "xyz"], axis=1)
    number = columns.get("curve", np.zeros(len(point)))
    try:
        return _check_curves([point[number == one] for one in dict.fromkeys(number.tolist())], str(path))
    except ProblemError as error:
        raise InputFileError(str(error)) from None


def _check_curves(value: object, key: str) -> Sequence[np.ndarray]:
    """Return curves as :class:`.AlongCurves` keeps them; sentences call them ``key``, as the recipe does."""
    curves: Sequence[np.ndarray] = settings_of(AlongCurves)["curves"].checked(value, key)
    return curves


def surface_files(recipe: dict[str, Any]) -> list[object]:
    """Names of the files that surfaces and densities on them take, in a recipe that need not be free of mistakes."""
    surface, classes = recipe.get("surface"), recipe.get("class")
    mesh = surface.get("mesh") if isinstance(surface, dict) else None
    names = list(mesh) if isinstance(mesh, list) else [mesh]
    for table in classes if isinstance(classes, list) else []:
        density = table.get("density") if isinstance(table, dict) else None
        if isinstance(density, dict):
            names.append(density.get("image"))
    return names


def _check_files(value: object, key: str) -> list[str]:
    entries = value if isinstance(value, list) else [value]
    names = [name for name in entries if isinstance(name, str) and name.strip()]
    if not names or len(names) < len(entries):
        raise ProblemError(f"{key} must be the name of a mesh file, or a list of such; got {show(value)}")
    return names


def _check_mapping(value: object, key: str) -> str:
    if not isinstance(value, str) or value not in MAPPINGS:
        raise ProblemError(f'{key} must be "uv" or "triplanar"; got {show(value)}')
    return value
