"""Assets to place: those that are selected in the asset browser, brought into the file once each."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import bpy

from ...engine.errors import InputFileError, ProblemError
from ..targets.target import is_result, members_of

__all__ = ["PRESET", "Asset", "asset_of_library", "assets_from_text", "bring_in", "selected_assets", "text_of_assets"]

# Custom property of a node group: the preset that it stands for, as JSON.
PRESET = "esh_preset"
# And of what was brought in from a file: which asset it is, so that it is brought in once.
ORIGIN = "esh_asset"
# What can be placed, by Blender's word for it: where a file has it.
PLACED = {"OBJECT": "objects", "COLLECTION": "collections"}
# How Blender writes where in a library one of these is: the file, unless it is the open one, what it is, and its name.
_IN_LIBRARY = re.compile(r"(?:(?P<file>.+\.blend)/)?(?P<kind>Object|Collection)/(?P<name>.+)")
# What presets are.
NODE_GROUPS = "node_groups"


class Asset(NamedTuple):
    """An asset.

    Attributes:
        kind: Blender's word for what it is: ``OBJECT``.
        name: What it is called in its file.
        file: The file; empty for the one that is open.
    """

    kind: str
    name: str
    file: str

    @property
    def where(self) -> str:
        """Under which name a file lists such things."""
        return PLACED.get(self.kind, NODE_GROUPS)


def selected_assets(context: bpy.types.Context) -> list[Asset]:
    """Return the selected assets that are something for a scatter: objects, collections, and node groups, which presets are."""
    found = []
    for one in getattr(context, "selected_assets", None) or ():
        if one.id_type in (*PLACED, "NODETREE"):
            name = one.name if one.local_id is None else one.local_id.name
            found.append(Asset(one.id_type, name, "" if one.local_id is not None else one.full_library_path))
    return found


def asset_of_library(kind: str, library: str, identifier: str) -> Asset:
    """Return an asset as Blender's shelves refer to it.

    Args:
        kind: Blender's word for the kind of library: ``LOCAL`` for the open file, ``ESSENTIALS`` for what comes with Blender.
        library: Name of the library in the preferences; empty for others.
        identifier: Where in it the asset is: ``trees/oaks.blend/Object/Oak``.

    Raises:
        ProblemError: It is neither an object nor a collection.
        InputFileError: No library has it.
    """
    found = _IN_LIBRARY.fullmatch(identifier.replace("\\", "/"))
    if found is None:
        raise ProblemError(f'an asset must be an object or a collection to be placed; got "{identifier}"')
    file = found["file"] or ""
    if file and kind != "LOCAL":
        folders = [Path(bpy.utils.system_resource("DATAFILES", path="assets"))] if kind == "ESSENTIALS" else []
        named = bpy.context.preferences.filepaths.asset_libraries
        folders += [Path(bpy.path.abspath(one.path)) for one in named if one.path and library in ("", one.name)]
        path = next((folder / file for folder in folders if (folder / file).is_file()), None)
        if path is None:
            raise InputFileError(f'no asset library has the file "{file}" any more')
        file = str(path)
    return Asset(found["kind"].upper(), found["name"], file)


def text_of_assets(assets: Sequence[Asset]) -> str:
    """Return assets as an operator keeps them, to find them again when it is tuned."""
    return json.dumps([list(one) for one in assets])


def assets_from_text(text: str) -> list[Asset]:
    """Return what :func:`text_of_assets` was given.

    Raises:
        ProblemError: It is something else.
    """
    try:
        found = [Asset(kind, name, file) for kind, name, file in json.loads(text)]
    except (ValueError, TypeError) as error:
        raise ProblemError(f"`assets` must be a list of kind, name and file as JSON; {error}") from None
    wrong = next((one for one in found if not all(isinstance(part, str) for part in one)), None)
    if wrong is not None:
        raise ProblemError(f"`assets` must be texts: kind, name and file; got {list(wrong)}")
    return found


def bring_in(asset: Asset) -> Any:
    """Return what an asset is, from its file where this one has not got it yet: linked or appended, as its library says.

    What is appended lies in no scene; only its instances show.

    Raises:
        InputFileError: The file cannot be read, or has no such asset.
        ProblemError: There is nothing in it to place.
    """
    lists = getattr(bpy.data, asset.where)
    if not asset.file:
        item = next((one for one in lists if one.name == asset.name and one.library is None), None)
    else:
        item = next((one for one in lists if one.get(ORIGIN) == _origin(asset)), None) or _load(asset)
    if item is None:
        raise InputFileError(f'there is no asset "{asset.name}" in this file any more')
    if asset.kind in PLACED and not any(not is_result(one) for one in members_of(item)):
        raise ProblemError(f'asset "{asset.name}" must have geometry to be placed; it has none')
    return item


def _load(asset: Asset) -> Any:
    """Return an asset from another file; linked ones are known by that file."""
    link = _is_linked(asset.file)
    if link:
        there = [one for one in getattr(bpy.data, asset.where) if one.library is not None and one.name == asset.name]
        for one in there:
            if Path(bpy.path.abspath(one.library.filepath)).resolve() == Path(asset.file).resolve():
                return one
    try:
        with bpy.data.libraries.load(asset.file, link=link) as (offered, wanted):
            if asset.name not in getattr(offered, asset.where):
                raise InputFileError(f'"{asset.file}" must have the asset "{asset.name}"; it has none of that name')
            setattr(wanted, asset.where, [asset.name])
    except OSError as error:
        raise InputFileError(f'"{asset.file}" must be a file that can be read; {error}') from None
    item = getattr(wanted, asset.where)[0]
    if item is not None and not link:
        item[ORIGIN] = _origin(asset)
        if item.asset_data is not None:
            # A copy is no asset of this file.
            item.asset_clear()
    return item


def _origin(asset: Asset) -> str:
    return f"{asset.file}/{asset.where}/{asset.name}"


def _is_linked(file: str) -> bool:
    """Tell whether assets of a file are linked, as the preferences say of the library that it belongs to."""
    for library in bpy.context.preferences.filepaths.asset_libraries:
        folder = Path(bpy.path.abspath(library.path)).resolve() if library.path else None
        if folder is not None and folder in Path(file).resolve().parents:
            return str(library.import_method) == "LINK"
    return False
