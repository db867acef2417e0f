"""What a recipe says of surfaces: the meshes that bodies are placed on, and densities on them."""

from __future__ import annotations

from typing import Any

from ..errors import InputFileError, ProblemError
from ..problem import validation
from ..problem.surface import Surface, SurfaceMesh
from ..problem.surface_density import SurfaceAttribute, SurfaceDensity, SurfaceImage, SurfaceTriplanar
from ..problem.surface_directions import SurfaceVectors
from ..problem.validation import show
from .image_files import read_density
from .mesh_files import read_meshes
from .recipe_table import RecipeTable

__all__ = ["read_surface", "read_surface_density", "read_surface_direction", "surface_files"]

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


def read_surface_density(table: RecipeTable) -> SurfaceDensity:
    """Return the density on a surface that a table ``density = { ... }`` describes."""
    if "attribute" in table.entries:
        table.check_keys("attribute")
        return SurfaceAttribute(table.take("attribute", validation.check_name))
    table.check_keys("image", "mapping", "size", "invert")
    invert = table.take("invert", validation.check_switch, False)
    image = table.read("image", lambda path: read_density(path, invert))
    mapping = table.take("mapping", _check_mapping, "uv")
    if mapping == "triplanar":
        size = table.take("size", validation.check_length)
        return table.build(lambda: SurfaceTriplanar(image, size))
    if "size" in table.entries:
        raise table.error("size", 'is only for a `mapping` of "triplanar"')
    return table.build(lambda: SurfaceImage(image))


def read_surface_direction(table: RecipeTable) -> SurfaceVectors:
    """Return the direction on a surface that a table ``direction = { attribute = ... }`` describes."""
    table.check_keys("attribute")
    return SurfaceVectors(table.take("attribute", validation.check_name))


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
