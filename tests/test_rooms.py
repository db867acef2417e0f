"""The rooms of the engine, and of Blender's side, know only those below them."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ENGINE = ROOT / "engine"
# Every room, and those that it may import; errors and native_output are for all.
MAY_IMPORT: dict[str, set[str]] = {
    "geometry": set(),
    "problem": {"geometry"},
    "device": set(),
    "transforms": {"device"},
    "space": {"device", "geometry", "problem", "transforms"},
    "surface": {"device", "geometry", "problem"},
    "heat": {"device", "geometry", "problem", "space"},
    "cascade": {"device", "space", "surface"},
    "field": {"device", "space", "transforms"},
    "model": {"cascade", "device", "field", "geometry", "problem", "space", "surface"},
    "motion": {"cascade", "device", "field", "geometry", "model", "problem", "space", "surface"},
    "contact": {"cascade", "device", "geometry", "model", "motion", "problem", "space", "surface"},
    "descent": {"cascade", "contact", "device", "geometry", "heat", "model", "motion", "problem", "space", "surface"},
    "edits": {"descent", "device", "model", "motion", "problem", "space", "surface"},
    "solver": {"descent", "device", "edits", "heat", "model", "motion", "problem", "quality", "space"},
    "quality": {"device", "field", "geometry", "heat", "problem", "space", "surface", "transforms"},
    "files": {"problem"},
    "drawing": {"files", "problem"},
    "scenes": {"device", "files", "problem", "solve"},
    "tiles": {
        "descent",
        "device",
        "edits",
        "field",
        "files",
        "model",
        "motion",
        "problem",
        "quality",
        "scenes",
        "space",
    },
    "cli": {"device", "drawing", "files", "problem", "scenes", "solve", "solver", "tiles"},
}
FOR_ALL = {"errors", "native_output", "version"}
# Files beside the rooms, and what they may import. What is asked of the engine as a whole is in one file.
FILES = {
    "errors": set(),
    "native_output": set(),
    "version": set(),
    "solve": {"device", "problem", "quality", "solver"},
}
MODULES = sorted(path for path in ENGINE.rglob("*.py") if path != ENGINE / "__init__.py")

BLENDER = ROOT / "esh_scatter"
# Rooms of Blender's side, and files beside them, from the lowest to the highest; each may import those before it.
BLENDER_ORDER = (
    "targets",
    "densities",
    "classes",
    "result",
    "solving",
    "api",
    "versions",
    "properties",
    "editing",
    "operators",
    "sidebar",
    "registration",
)
BLENDER_MODULES = sorted(path for path in BLENDER.rglob("*.py") if path != BLENDER / "__init__.py")


def name_of(path: Path, package: Path = ENGINE) -> str:
    return path.relative_to(package).with_suffix("").as_posix()


def imported(path: Path, root: Path = ENGINE) -> Iterator[tuple[int, str]]:
    """Line, and room (or file beside the rooms), of all that a module imports of its package, also late or for types only."""
    package = path.relative_to(root).parts[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level:
            if node.level > len(package) + 1:
                continue  # of another package
            base = package[: len(package) - node.level + 1] + tuple(
                (node.module or "").split(".") if node.module else ()
            )
            yield from ((node.lineno, (*base, alias.name)[0]) for alias in node.names)


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_a_module_imports_only_rooms_below_its_own(path: Path):
    room = path.relative_to(ENGINE).with_suffix("").parts[0]
    allowed = (FILES[room] if path.parent == ENGINE else MAY_IMPORT[room] | {room}) | FOR_ALL
    for line, other in imported(path):
        assert other in allowed, f"engine/{name_of(path)}.py, line {line}: {room} may not import {other}"


@pytest.mark.parametrize("room", MAY_IMPORT)
def test_a_room_imports_all_that_it_may(room: str):
    """A permission that nothing needs says something wrong of the room."""
    used = {other for path in (ENGINE / room).rglob("*.py") for _, other in imported(path)}
    assert MAY_IMPORT[room] <= used, f"engine/{room} imports nothing of {sorted(MAY_IMPORT[room] - used)}"


@pytest.mark.parametrize("path", BLENDER_MODULES, ids=lambda path: name_of(path, BLENDER))
def test_a_module_of_blenders_side_imports_only_what_is_below(path: Path):
    room = path.relative_to(BLENDER).with_suffix("").parts[0]
    allowed = BLENDER_ORDER[: BLENDER_ORDER.index(room) + 1]
    for line, other in imported(path, BLENDER):
        assert other in allowed, f"esh_scatter/{name_of(path, BLENDER)}.py, line {line}: {room} may not import {other}"


def test_no_two_rooms_know_each_other():
    left = dict(MAY_IMPORT)
    while left:
        lowest = [room for room, below in left.items() if not below & left.keys()]
        assert lowest, f"each of {sorted(left)} may import another one of them"
        for room in lowest:
            del left[room]


def test_every_room_is_there_and_says_what_is_in_it():
    rooms = {path.parent.name for path in ENGINE.glob("*/__init__.py")}
    assert rooms == MAY_IMPORT.keys()
    for room in rooms:
        tree = ast.parse((ENGINE / room / "__init__.py").read_text(encoding="utf-8"))
        # What the room is for, and then what it may import.
        told = " ".join((ast.get_docstring(tree) or "").split())
        purpose, may, below = told.partition(" May import ")
        assert set(re.findall(r"``(\w+)(?:\.py)?``", below)) == MAY_IMPORT[room], f"engine/{room}/__init__.py"
        assert may or purpose.endswith(" Imports no other room.")
        assert len(purpose.removesuffix(" Imports no other room.").split()) > 4, f"engine/{room}/__init__.py"
        assert len(tree.body) == 1, f"engine/{room}/__init__.py imports something"
    rooms = {path.parent.name for path in BLENDER.glob("*/__init__.py")}
    files = {path.stem for path in BLENDER.glob("*.py")} - {"__init__"}
    assert rooms | files == set(BLENDER_ORDER)
    for room in rooms:
        told = ast.get_docstring(ast.parse((BLENDER / room / "__init__.py").read_text(encoding="utf-8")))
        assert told and len(told.split()) > 4, f"esh_scatter/{room}/__init__.py"


def test_geometry_problems_and_files_need_no_warp():
    for room in ("geometry", "problem", "files", "drawing"):
        for path in (ENGINE / room).glob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
                assert "warp" not in {name.partition(".")[0] for name in names}, (
                    f"engine/{name_of(path)}.py imports Warp"
                )
