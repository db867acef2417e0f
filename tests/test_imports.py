"""Imports stay light, inside the package, and off the forbidden paths."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ENGINE = sorted((ROOT / "engine").rglob("*.py"))
EVERYTHING = [
    ROOT / "__init__.py",
    *ENGINE,
    *sorted((ROOT / "esh_scatter").rglob("*.py")),
]

# What the extension's zip and Blender bring along; all that code running inside Blender may count on.
BUNDLED = {"bl_ui", "blf", "bmesh", "bpy", "bpy_extras", "gpu", "gpu_extras", "idprop", "mathutils"}
BUNDLED |= {"numpy", "trimesh", "warp"}


def imported_names(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield (level, dotted name) of every import below a node; a name that is imported is part of the dotted name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((0, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from ((node.level, f"{node.module or ''}.{alias.name}".lstrip(".")) for alias in node.names)


def run_python(code: str) -> str:
    """Return what a fresh interpreter prints; its errors fail the test."""
    outcome = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert outcome.returncode == 0, outcome.stderr
    return outcome.stdout.strip()


def test_importing_the_package_imports_nothing_heavy():
    code = (
        "import sys; before = set(sys.modules); import esh; "
        "new = {name.partition('.')[0] for name in set(sys.modules) - before}; "
        "print(sorted(new - set(sys.stdlib_module_names)))"
    )
    assert run_python(code) == "['esh']"


def test_the_command_answers_ctrl_c_before_it_loads_anything():
    """Until its handler is there, Ctrl-C shows a traceback."""
    late = ast.FunctionDef, ast.If
    before_the_handler = ["__init__", "engine/__init__", "engine/version", "engine/cli/__init__", "engine/cli/start"]
    for name in (*before_the_handler, "engine/cli/first_signals"):
        path = ROOT / f"{name}.py"
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if not isinstance(node, late):
                loaded = {one.partition(".")[0] for level, one in imported_names(node)}
                assert loaded <= {"__future__", "os", "signal", "engine", "version", "first_signals"}, (
                    f"{path} loads {loaded}"
                )


def test_describing_a_problem_imports_neither_blender_nor_warp():
    code = (
        "import sys, esh; esh.Problem; esh.EshError; print([n for n in ('bpy', 'warp', 'trimesh') if n in sys.modules])"
    )
    assert run_python(code) == "[]"


def test_solving_imports_nothing_that_the_extension_does_not_bundle():
    code = (
        "import sys, esh\n"
        "for name in ('PIL', 'matplotlib', 'rich', 'scipy', 'bpy'): sys.modules[name] = None\n"
        "problem = esh.Problem(esh.Domain((2.0, 1.0)), [esh.BodyClass('a', [esh.Size('b', 0.01, 5)])])\n"
        "print(len(esh.solve(problem, device='cpu', max_steps=2).position))"
    )
    assert run_python(code).splitlines()[-1] == "5"


def test_dir_lists_the_public_names():
    code = "import esh; print(sorted(esh.__all__) == dir(esh), 'ScatterClass' in dir(esh), len(esh.__all__))"
    assert run_python(code).startswith("True True ")


def test_a_name_that_is_not_public_is_an_attribute_error():
    assert run_python("import esh; print(hasattr(esh, 'Scaterclass'), hasattr(esh, '__path__'))") == "False True"


def test_type_checkers_see_exactly_what_is_fetched():
    tree = ast.parse((ROOT / "__init__.py").read_text(encoding="utf-8"))
    for_types = next(n for n in tree.body if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING")
    seen = {alias.name: "." + node.module for node in for_types.body for alias in node.names}
    written = {
        node.targets[0].id: ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    assert seen == written["_MODULES"]
    assert sorted(written["__all__"]) == sorted([*seen, "__version__", "register", "unregister"])
    assert (ROOT / "py.typed").is_file()


def test_every_public_name_can_be_fetched():
    pytest.importorskip("bpy")
    code = "import bpy, esh; print([name for name in esh.__all__ if getattr(esh, name, None) is None])"
    assert run_python(code).splitlines()[-1] == "[]"


@pytest.mark.parametrize("path", ENGINE, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_the_engine_never_looks_at_blender(path: Path):
    for level, name in imported_names(ast.parse(path.read_text(encoding="utf-8"))):
        parts = name.split(".")
        depth = len(path.relative_to(ROOT / "engine").parts)
        assert level <= depth, f"{path.name} imports {name} from outside of engine"
        assert "esh_scatter" not in parts
        assert level or parts[0] not in {"bpy", "bmesh", "mathutils", "bl_ui", "gpu"}, f"{path.name} imports {name}"


@pytest.mark.parametrize("path", EVERYTHING, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_imports_are_relative_and_what_is_not_bundled_is_fetched_late(path: Path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    late = {
        id(child)
        for node in ast.walk(tree)
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
        or (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
        for child in ast.walk(node)
    }
    for node in ast.walk(tree):
        for level, name in imported_names(node) if isinstance(node, (ast.Import, ast.ImportFrom)) else ():
            top = name.partition(".")[0]
            assert level or top not in {"esh", "engine", "esh_scatter", "bl_ext"}, (
                f"{path} must import {name} relatively"
            )
            if not level and id(node) not in late:
                assert top in BUNDLED | sys.stdlib_module_names, f"{path} must import {name} where it is used"


@pytest.mark.parametrize("path", EVERYTHING, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_nothing_touches_the_module_search_path(path: Path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "sys":
            assert node.attr not in {"path", "meta_path", "path_hooks"}
        assert not (isinstance(node, ast.ImportFrom) and node.module == "site")


@pytest.mark.parametrize("path", EVERYTHING, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_nothing_uses_the_network(path: Path):
    network = {"asyncio", "ftplib", "http", "requests", "smtplib", "socket", "socketserver", "ssl", "urllib", "xmlrpc"}
    found = {name.partition(".")[0] for level, name in imported_names(ast.parse(path.read_text("utf-8"))) if not level}
    assert not found & network, f"{path} imports {found & network}: the manifest asks for no such permission"
