"""One scene of a batch: from a varied recipe to the content of its files."""

from __future__ import annotations

import copy
import hashlib
import io
import os
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import EshError
from ..files.extras import import_extra
from ..files.placement_files import placement_writer
from ..files.recipe import ParsedRecipe, read_recipe
from ..files.report_files import strict_json
from ..problem.problem import Problem
from .variations import varied

__all__ = ["Scene", "input_files", "read_scene", "solved_scene"]


@dataclass(frozen=True)
class Scene:
    """What there is to do.

    Attributes:
        number: From 0, in the batch.
        seed: Of the problem.
        parameters: Key -> value, of the keys that vary.
        recipe: The recipe before it is varied.
        source: The recipe's folder, absolute.
        folder: Where the scene's files will lie, absolute.
        device: See :func:`~esh.solve`.
        max_steps: See there.
        endings: Of the placement's files.
    """

    number: int
    seed: int
    parameters: Mapping[str, Any]
    recipe: ParsedRecipe
    source: Path
    folder: Path
    device: str
    max_steps: int
    endings: tuple[str, ...]


def read_scene(scene: Scene) -> tuple[Problem, dict[str, Any]]:
    """Return the problem of a scene, and the recipe of it.

    Raises:
        EshError: A key or value that has no meaning.
    """
    entries = varied(scene.recipe.entries, dict(scene.parameters)) | {"seed": scene.seed}
    # A reader takes what it knows out of the tables.
    return read_recipe(ParsedRecipe(scene.recipe.path, copy.deepcopy(entries))), entries


def solved_scene(scene: Scene, inputs: Mapping[str, bytes] | None = None) -> dict[str, bytes]:
    """Solve a scene; return the names of its files and what is in them. A scene that cannot be solved has a report that says so.

    Args:
        scene: What to do.
        inputs: The files that the recipe names, where the recipe's folder is on another machine; by their names in the recipe.
    """
    from ..solve import solve

    files: dict[str, bytes] = {}
    report: dict[str, Any] = {"scene": scene.number, "seed": scene.seed, "parameters": dict(scene.parameters)}
    with tempfile.TemporaryDirectory(prefix="esh-scene-") as beside:
        here = scene
        if inputs:
            for name, content in inputs.items():
                path = Path(beside, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
            recipe = ParsedRecipe(Path(beside, scene.recipe.path.name), scene.recipe.entries)
            here = Scene(**{**vars(scene), "recipe": recipe})
        try:
            problem, entries = read_scene(here)
            placement = solve(problem, device=scene.device, max_steps=scene.max_steps)
        except EshError as error:
            # As the recipe was called where it was given.
            text = " ".join(str(error).split()).replace(str(here.recipe.path), str(scene.recipe.path))
            return {"report.json": strict_json(report | {"error": text})}
        # While the files that it names are there.
        files["recipe.toml"] = _recipe_text(entries, scene, here.recipe.path.parent)
    for ending in scene.endings:
        name = f"placement{ending}"
        file = io.BytesIO()
        placement_writer(scene.folder / name, placement)(file)
        files[name] = file.getvalue()
    assert placement.report is not None
    digest = hashlib.sha256(files[f"placement{scene.endings[0]}"]).hexdigest()
    report |= {"bodies": problem.body_count, "hash": digest, **placement.report.to_dict()}
    # Last, so that a reader who finds it finds the others, too.
    return files | {"report.json": strict_json(report)}


def input_files(entries: Any, folder: Path) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield the tables and keys of a recipe whose value is the name of a file beside it."""
    if isinstance(entries, dict):
        for key, value in entries.items():
            if isinstance(value, str) and key != "name" and value.strip():
                try:
                    there = (folder / value).is_file()
                except (OSError, ValueError):  # a text that no file can have as its name
                    there = False
                if there:
                    yield entries, key
            else:
                yield from input_files(value, folder)
    elif isinstance(entries, list):
        for entry in entries:
            yield from input_files(entry, folder)


def _recipe_text(entries: dict[str, Any], scene: Scene, beside: Path) -> bytes:
    """Return the recipe of a scene; it names its images, which now lie in ``beside``, from where it will lie."""
    entries = copy.deepcopy(entries)
    for table, key in list(input_files(entries, beside)):
        try:
            name = os.path.relpath(scene.source / table[key], scene.folder)
        except ValueError:  # on another drive
            name = str(scene.source / table[key])
        table[key] = Path(name).as_posix()
    text: str = import_extra("tomli_w", "batch", "a batch").dumps(entries)
    return text.encode("utf-8")
