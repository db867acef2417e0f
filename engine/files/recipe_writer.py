"""Writing a problem as a recipe, so that it can be kept, edited and solved elsewhere."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ..problem.balance import Balance
from ..problem.body_class import BodyClass, PlacingSettings
from ..problem.domain import Domain
from ..problem.given_values import as_path, check_is
from ..problem.prepared_class import PreparedClass
from ..problem.problem import Problem, ProblemSettings
from ..problem.settings import values_of
from ..problem.size import Size
from ..problem.validation import check_colors
from .placement_files import write_files
from .recipe_keys import written_settings
from .recipe_scene import written_fixed, written_obstacles

__all__ = ["recipe_text", "write_recipe"]

Writer = Callable[[BinaryIO], None]
Color = tuple[float, float, float]


def write_recipe(path: str | Path, problem: Problem, *, colors: Sequence[Color] | None = None) -> None:
    """Write a problem as a recipe. Reading it gives the same problem, and solving that the same bytes.

    What classes were asked for is written, with its shares, its sharpening and so on. Densities, lengths and directions that are
    images are written beside the recipe as ``.npy`` files, whose names begin with the recipe's: ``forest.toml`` and
    ``forest-1-density.npy``. Older files are replaced only once all new ones are complete.

    Args:
        path: The recipe, ``forest.toml`` for example.
        problem: What to write.
        colors: Red, green and blue 0..1 of every class in a halftone; None leaves them out.

    Raises:
        EshError: A file cannot be written; nothing was changed.
    """
    path, problem = as_path(path), check_is(problem, Problem, "`problem`")
    files: dict[Path, Writer] = {}
    names: dict[tuple[str, tuple[int, ...], bytes], str] = {}

    def name_array(what: str, array: np.ndarray) -> str:
        """Return the name of the file that holds an array; equal arrays are in one file."""
        key = (array.dtype.str, array.shape, array.tobytes())
        if key not in names:
            names[key] = f"{path.stem}-{len(names) + 1}-{what}.npy"
            files[path.with_name(names[key])] = lambda file: np.save(file, array, allow_pickle=False)
        return names[key]

    text = recipe_text(problem, lambda what, array, _: name_array(what, array), colors=colors)
    write_files({**files, path: lambda file: _write_all(file, text.encode("utf-8"))})


def recipe_text(
    problem: Problem,
    name_array: Callable[[str, np.ndarray, str], str],
    *,
    colors: Sequence[Color] | None = None,
) -> str:
    """Return the recipe of a problem.

    Args:
        problem: What it describes.
        name_array: Gets what an array is (``"density"``, ``"length"``, ``"direction"``, ``"slope"`` or ``"obstacle"``), the array, and
            the name of its class; returns the name of its file.
        colors: Of the classes, in a halftone.
    """
    domain = problem.rectangle
    colors = None if colors is None else check_colors(colors, len(problem.classes))
    tables: list[tuple[str, dict[str, Any]]] = [
        ("", {"version": 1, **written_settings(problem, ProblemSettings, _no_arrays)}),
        ("[domain]", written_settings(domain, Domain, _no_arrays)),
        ("[balance]", written_settings(problem.balance, Balance, _no_arrays)),
    ]
    for number, placed in enumerate(problem.classes):

        def name_of_class(what: str, array: np.ndarray, name: str = placed.name) -> str:
            return name_array(what, array, name)

        asked = _asked(placed)
        keys = written_settings(asked, BodyClass, name_of_class, leave=("sizes",))
        if colors is not None:
            keys["color"] = list(colors[number])
        tables.append(("[[class]]", keys))
        tables.extend(("[[class.size]]", written_settings(size, Size, name_of_class)) for size in asked.sizes)
    tables.extend(("[[fixed]]", keys) for keys in written_fixed(problem))
    obstacles = written_obstacles(problem, lambda what, array: name_array(what, array, ""))
    tables.extend(("[[obstacle]]", keys) for keys in obstacles)
    lines: list[str] = []
    for header, keys in tables:
        if keys:
            lines += _table_lines(header, keys)
    return "\n".join(lines[1:]) + "\n"


def _asked(placed: PreparedClass) -> BodyClass:
    """Return what a class was made from; where more went into it, what asks for it as it is."""
    placed = placed.base or placed
    if placed.asked is not None:
        return placed.asked
    return BodyClass(placed.name, placed.sizes, placed.density_image, **values_of(placed, PlacingSettings))


def _table_lines(header: str, keys: dict[str, Any]) -> list[str]:
    """Return the lines of a table, and of the tables inside it after it."""
    lines = ["", header] if header else [""]
    lines += [f"{key} = {_toml(value)}" for key, value in keys.items() if not isinstance(value, dict)]
    for key, value in keys.items():
        if isinstance(value, dict):
            lines += _table_lines(f"[{header.strip('[]')}.{key}]", value)
    return lines


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # What may have to be escaped in TOML, JSON escapes in the same way.
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, list):
        return f"[{', '.join(_toml(entry) for entry in value)}]"
    # Python writes the shortest digits that read back as the same number.
    return repr(value)


def _no_arrays(what: str, _array: np.ndarray) -> str:
    raise AssertionError(f"{what} is an array where a recipe has none")


def _write_all(file: BinaryIO, data: bytes) -> None:
    file.write(data)
