"""No module imports another one that imports it in turn, by whatever way: at the top, in a function, or for types only."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Modules of a package are known by their dotted names, scripts by the names that those beside them import.
FOLDERS = ("engine", "esh_scatter", "benchmarks", "demo_scenes", "tools")
SCRIPTS = {"benchmarks", "demo_scenes", "tools"}
# Imports for types only, of the class whose constructor calls the module: what is checked of a whole problem, and what it fixes of
# an earlier answer.
FOR_TYPES = {
    ("engine.problem.feasibility", "engine.problem.problem"),
    ("engine.problem.fixed_bodies", "engine.problem.placement"),
}


def modules() -> dict[str, Path]:
    """Every module's file, by the module's dotted name from the root on."""
    found = {}
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported_by(name: str, path: Path, known: dict[str, Path]) -> Iterator[str]:
    """The modules, of those that are known, that a module imports."""
    package = name.split(".") if path.stem == "__init__" else name.split(".")[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            wanted = [alias.name.split(".") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            module = node.module.split(".") if node.module else []
            base = [*package[: len(package) + 1 - node.level], *module] if node.level else module
            wanted = [[*base, alias.name] for alias in node.names]
        else:
            continue
        for parts in wanted:
            here = [package[0], *parts] if package[0] in SCRIPTS else parts
            for candidate in (parts, parts[1:] if parts[0] == "esh" else parts, here):
                # What is imported is a module, or something in one.
                whole, within = ".".join(candidate), ".".join(candidate[:-1])
                if whole in known or within in known:
                    yield whole if whole in known else within
                    break


@cache
def graph() -> dict[str, set[str]]:
    """What every module imports."""
    known = modules()
    return {name: set(imported_by(name, path, known)) - {name} for name, path in known.items()}


def cycles(imports: dict[str, set[str]]) -> list[list[str]]:
    """Modules that lie on a way of imports back to themselves: each with all that can be reached from it and reach it."""
    reached: dict[str, set[str]] = {}
    for start in imports:
        seen: set[str] = set()
        ahead = [start]
        while ahead:
            new = imports[ahead.pop()] - seen
            seen |= new
            ahead += new
        reached[start] = seen
    found = {frozenset(b for b in reached[a] if a in reached[b]) for a in imports if a in reached[a]}
    return sorted(sorted(ring) for ring in found)


def test_no_module_is_imported_by_what_it_imports():
    imports = {
        module: {other for other in others if (module, other) not in FOR_TYPES} for module, others in graph().items()
    }
    rings = cycles(imports)
    ways = [f"{module} -> {', '.join(sorted(imports[module] & set(ring)))}" for ring in rings for module in ring]
    assert not rings, "these modules import each other: " + "; ".join(ways)


def test_the_exceptions_are_needed_and_are_for_types_only():
    imports = graph()
    for module, other in FOR_TYPES:
        assert other in imports[module], f"{module} no longer imports {other}; take it off the list"
        tree = ast.parse(modules()[module].read_text(encoding="utf-8"))
        for_types = [n for n in tree.body if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING"]
        inside = {id(child) for node in for_types for child in ast.walk(node)}
        last = other.rpartition(".")[2]
        found = [n for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.module == last]
        assert found and all(id(node) in inside for node in found), f"{module} imports {other} at runtime"


def test_imports_of_every_kind_are_seen():
    imports = graph()
    assert "engine.solver.solver" in imports["engine.solve"], "at the top"
    assert "esh_scatter.solving.live" in imports["esh_scatter.properties.scatter"], "of a package, in a function"
    assert "engine.problem.problem" in imports["engine.problem.feasibility"], "for types"
    assert "benchmarks.figures_of_color" in imports["benchmarks.figures"], "of a script beside it"
    assert "engine.device.launcher" in imports["benchmarks.figures"], "by the package's name"
    assert cycles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}, "e": set()}) == [["a", "b", "c"]]
