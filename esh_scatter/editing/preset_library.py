"""The presets as assets: a library that the asset browser shows, written by the Blender that shows it, so that this one reads it."""

from __future__ import annotations

import json
import uuid
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...engine.errors import InputFileError
from .assets import PRESET
from .preset_files import built_in_presets, read_preset

__all__ = ["LIBRARY", "library_folder", "show_library", "write_library"]

# What the library is called in the preferences.
LIBRARY = "ESH Scatter"
FILE, CATALOGS, CATALOG = "presets.blend", "blender_assets.cats.txt", "Scatter Presets"
# Numbers that are the same wherever the library is written.
_NAMESPACE = uuid.UUID("8f7f4fd4-6f0e-4b5a-9a0d-4b1f4be6d0a5")


def library_folder() -> Path:
    """Return the folder of the library: the extension's own, which updates leave alone; made where it is missing.

    Raises:
        InputFileError: It cannot be made.
    """
    package = __package__.rpartition(".esh_scatter.")[0]
    try:
        if package.startswith("bl_ext."):
            return Path(bpy.utils.extension_path_user(package, path="presets", create=True))
        return Path(bpy.utils.user_resource("DATAFILES", path="esh_scatter/presets", create=True))
    except (OSError, ValueError) as error:
        raise InputFileError(f"the folder of the presets must be one that can be made; {error}") from None


def write_library(folder: Path) -> Path:
    """Write all presets that come along into a library of assets, with their pictures; returns the file.

    A preset is a node group that does nothing, and holds the preset's text: dragged onto a mesh, it is taken for what it stands for.

    Raises:
        InputFileError: It cannot be written.
    """
    catalog = uuid.uuid5(_NAMESPACE, CATALOG)
    presets = built_in_presets()
    # Groups of these names in the open file would give them others.
    renamed = {one: one.name for one in bpy.data.node_groups if one.name in presets.values() and one.library is None}
    for one, name in renamed.items():
        one.name = f"{name} (kept)"
    made: list[bpy.types.NodeTree] = []
    try:
        for path, name in presets.items():
            made.append(_asset_of(Path(path), name, str(catalog)))
        file = folder / FILE
        bpy.data.libraries.write(str(file), set(made), fake_user=True, compress=True)
        simple = CATALOG.replace(" ", "-")
        text = f"# This is an Asset Catalog Definition file for Blender.\n\nVERSION 1\n\n{catalog}:{CATALOG}:{simple}\n"
        (folder / CATALOGS).write_text(text, encoding="utf-8")
    except (OSError, RuntimeError) as error:
        raise InputFileError(f'"{folder}" must be a folder that can be written to; {error}') from None
    finally:
        for group in made:
            bpy.data.node_groups.remove(group)
        for one, name in renamed.items():
            one.name = name
    return file


def show_library(folder: Path) -> Any:
    """Have the preferences know the library, and return it there; one that they know already stays as it is."""
    libraries = bpy.context.preferences.filepaths.asset_libraries
    for library in libraries:
        if library.path and Path(bpy.path.abspath(library.path)).resolve() == folder.resolve():
            return library
    library = libraries.new(name=LIBRARY, directory=str(folder))
    # What is dragged in is gone again as soon as it was taken for what it stands for.
    library.import_method = "APPEND"
    return library


def _asset_of(path: Path, name: str, catalog: str) -> bpy.types.NodeTree:
    preset = read_preset(path)
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    group.is_modifier = True
    for side in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=side, socket_type="NodeSocketGeometry")
    given, taken = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    group.links.new(given.outputs[0], taken.inputs[0])
    group[PRESET] = json.dumps(preset)
    group.asset_mark()
    told = group.asset_data
    told.description, told.author, told.catalog_id = str(preset.get("about", "")), "ESH Scatter", catalog
    told.tags.new("scatter")
    picture = path.with_suffix(".jpg")
    if picture.exists():
        _give_picture(group, picture)
    return group


def _give_picture(group: bpy.types.NodeTree, path: Path) -> None:
    image = bpy.data.images.load(str(path))
    try:
        pixels = np.empty(4 * image.size[0] * image.size[1], np.float32)
        image.pixels.foreach_get(pixels)
        preview = group.preview_ensure()
        preview.image_size = image.size[:]
        preview.image_pixels_float.foreach_set(pixels)
    finally:
        bpy.data.images.remove(image)
