"""Functions are short, not nested deeply, and take few arguments: whoever reads one sees all of it at once."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("engine", "esh_scatter", "tools", "demo_scenes", "benchmarks")
SOURCES = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py"))
MOST_LINES = 70
MOST_ARGUMENTS = 10
DEEPEST = 4
NESTING = (ast.For, ast.While, ast.If, ast.With, ast.Try, ast.Match, ast.FunctionDef, ast.AsyncFunctionDef)


def functions(text):
    """Name, lines and depth of every function in a source."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield node.name, node.end_lineno - node.lineno + 1, depth(node)


def depth(node):
    """How deeply statements lie in loops, conditions and functions of a function; ``elif`` goes no deeper than its ``if``."""
    deepest = 0
    for child in ast.iter_child_nodes(node):
        is_elif = isinstance(node, ast.If) and isinstance(child, ast.If) and node.orelse == [child]
        deepest = max(deepest, depth(child) + (isinstance(child, NESTING) and not is_elif))
    return deepest


def test_lengths_and_depths_are_counted():
    lines = "def f(x):,    for i in x:,        if i:,            pass,        elif x:,            pass,        else:,"
    lines += "            with x:,                pass"
    source = lines.replace(",", "\n")
    assert list(functions(source)) == [("f", 9, 3)]


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_functions_are_short_and_not_nested_deeply(path):
    found = list(functions(path.read_text(encoding="utf-8")))
    assert not [f"{name}: {lines} lines" for name, lines, _ in found if lines > MOST_LINES]
    assert not [f"{name}: nested {deep} deep" for name, _, deep in found if deep > DEEPEST]


@pytest.mark.parametrize("path", sorted((ROOT / "engine").rglob("kernels_*.py")), ids=lambda path: path.stem)
def test_functions_of_kernels_take_few_arguments(path):
    """What belongs together is a ``wp.struct``. Native code has no structures, and of a kernel's arrays one has to be an argument."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef) and "wp.func" in map(ast.unparse, node.decorator_list):
            assert len(node.args.args) <= MOST_ARGUMENTS, f"{node.name} takes {len(node.args.args)} arguments"
