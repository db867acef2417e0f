"""Meshes from files: OBJ, PLY, STL, GLB and whatever else trimesh reads, as surfaces for bodies."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputFileError, ProblemError
from ..problem.surface import SurfaceMesh
from .gltf_meshes import with_materials
from .input_file import check_is_file
from .ply_meshes import color_shares, read_ply_mesh
from .text_polygons import obj_without_concave_polygons, off_without_concave_polygons

__all__ = ["ACCEPTED", "read_meshes"]

ACCEPTED = (".obj", ".ply", ".stl", ".glb", ".gltf", ".off")
# What colors of vertices are called where the file has no name for them.
COLOR = "color"


def read_meshes(path: str | Path) -> list[SurfaceMesh]:
    """Read the meshes of a file, where its scene puts them.

    Attributes are those of the vertices: of a PLY file each further property by its name, colors as ``color``, 0..1. A UV map is
    kept where there is one.

    Raises:
        InputFileError: The file does not exist, is of another format, or holds no triangles.
    """
    path = Path(path)
    if path.suffix.lower() not in ACCEPTED:
        raise InputFileError(f"{path} must end in {', '.join(ACCEPTED)}; got the ending {path.suffix!r}")
    check_is_file(path, f"a mesh is a file in one of the formats {', '.join(ACCEPTED)}")
    try:
        meshes = _meshes_of(path)
    except ProblemError as error:
        raise InputFileError(f"{path}: {error}") from None
    except IndexError:
        raise InputFileError(
            f"{path} cannot be read as a mesh: a face has a corner that is none of the file's vertices"
        ) from None
    except Exception as error:  # whatever the readers of trimesh stumble over
        raise InputFileError(
            f"{path} cannot be read as a mesh: {' '.join(str(error).split()) or 'no reason given'}"
        ) from None
    if not meshes:
        raise InputFileError(f"{path} must hold at least one triangle; it has none")
    return meshes


def _meshes_of(path: Path) -> list[SurfaceMesh]:
    """Meshes of a file, none where it has no triangles."""
    if path.suffix.lower() == ".ply":
        mesh = read_ply_mesh(path)
        return [] if mesh is None else [mesh]
    import trimesh

    scene = _scene_of(path)
    for geometry in scene.geometry.values():
        _keep_colors(geometry)
    parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh) and len(part.faces)]
    names = [path.stem if len(parts) == 1 else f"{path.stem} {number}" for number in range(1, len(parts) + 1)]
    return [_surface_mesh(part, name) for part, name in zip(parts, names, strict=True)]


def _scene_of(path: Path) -> Any:
    """What a file holds, as trimesh reads it."""
    import trimesh

    kind = path.suffix.lower().lstrip(".")
    changed: io.IOBase | None = None
    without_concave = {"obj": obj_without_concave_polygons, "off": off_without_concave_polygons}.get(kind)
    if without_concave is not None and (text := without_concave(path.read_text(errors="replace"))) is not None:
        changed = io.StringIO(text)
    if kind in ("glb", "gltf") and (content := with_materials(path.read_bytes())) is not None:
        changed = io.BytesIO(content)
    if changed is None:
        return trimesh.load_scene(path, process=False)
    # Materials and buffers lie beside it.
    resolver = trimesh.resolvers.FilePathResolver(str(path))
    return trimesh.load_scene(changed, file_type=kind, resolver=resolver, process=False)


def _keep_colors(geometry: Any) -> None:
    """Make colors of vertices an attribute where there is a material, too: copies of it lose them."""
    colors = getattr(getattr(geometry, "visual", None), "vertex_attributes", {}).get(COLOR)
    if colors is not None and np.ndim(colors) == 2 and _is_numbers(colors, len(geometry.vertices)):
        geometry.vertex_attributes.setdefault(COLOR, color_shares(np.asarray(colors)[:, :3]))


def _surface_mesh(part: Any, name: str) -> SurfaceMesh:
    count = len(part.vertices)
    attributes = {
        key: np.asarray(values) for key, values in part.vertex_attributes.items() if _is_numbers(values, count)
    }
    visual = part.visual
    if getattr(visual, "kind", None) == "vertex":
        attributes.setdefault(COLOR, np.asarray(visual.vertex_colors)[:, :3] / 255.0)
    uv = getattr(visual, "uv", None)
    uv = None if uv is None or len(uv) != count else np.asarray(uv, dtype=np.float64)[:, :2]
    return SurfaceMesh(np.asarray(part.vertices), np.asarray(part.faces), name, attributes, uv)


def _is_numbers(values: Any, count: int) -> bool:
    array = np.asarray(values)
    return array.dtype.kind in "iufb" and array.ndim in (1, 2) and len(array) == count
