"""Every array says on which device it is: Warp's default is a GPU where there is one, and the CPU cannot read its memory."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
MODULES = sorted(path for folder in ("engine", "esh_scatter") for path in (ROOT / folder).rglob("*.py"))
MAKERS = {"array", "empty", "full", "ones", "zeros", "from_numpy", "launch", "ScopedCapture"}
# What only a type in a kernel's signature gives.
OF_A_TYPE = {"dtype", "ndim"}


def without_device(source: str) -> Iterator[int]:
    """Lines of the calls that make an array, or launch, and leave the device to Warp; what a kernel makes is where it runs."""
    tree = ast.parse(source)
    in_kernels = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and any(ast.unparse(d) == "wp.kernel" for d in node.decorator_list)
        for statement in node.body
        for inner in ast.walk(statement)
    }
    for node in ast.walk(tree):
        if node in in_kernels:
            continue
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in MAKERS:
            given = {keyword.arg for keyword in node.keywords}
            is_warp = isinstance(node.func.value, ast.Name) and node.func.value.id == "wp"
            if is_warp and (node.args or not given <= OF_A_TYPE) and "device" not in given:
                yield node.lineno


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_array_has_a_device(path: Path):
    assert list(without_device(path.read_text(encoding="utf-8"))) == []


def test_the_check_sees_a_missing_device():
    assert list(without_device("x = wp.array([0, 1], dtype=wp.int32)\ny: wp.array(dtype=float)")) == [1]
    assert list(without_device("x = wp.zeros(3, dtype=float, device=d)")) == []
    assert list(without_device("def f(p):\n    x = wp.array(ptr=p, shape=(3,), dtype=float)")) == [2]
    assert list(without_device("@wp.kernel\ndef f(p: int):\n    x = wp.array(ptr=p, shape=(3,), dtype=float)")) == []
