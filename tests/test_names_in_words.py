"""What the pages and the docstrings name exists: identifiers, files and folders, targets of references; and papers are named."""

from __future__ import annotations

import ast
import contextlib
import gc
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES += sorted((ROOT / "demo_scenes").rglob("README.md"))
CODE = ("engine", "esh_scatter", "tools", "benchmarks", "demo_scenes", "tests")
# Of other programs; and files that users make.
FOREIGN = {"InstancedMesh"}
OF_USERS = {"render.py"}


def tracked(pattern: str) -> list[Path]:
    """Files of the code's folders and of the root."""
    found = [path for folder in CODE for path in (ROOT / folder).rglob(pattern)]
    return sorted([*found, *ROOT.glob(pattern)])


@contextlib.contextmanager
def without_collector() -> Iterator[None]:
    """Parse without Python's collector of garbage, which looks through all trees again and again: four fifths of the time."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


@cache
@without_collector()
def words_of_the_code() -> frozenset[str]:
    """Every name in the sources, and every word of their texts, such as keys and options; docstrings and comments do not count."""
    words: set[str] = set()
    for path in tracked("*.py"):
        nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        described = (ast.Module, ast.ClassDef, ast.FunctionDef)
        docstrings = {
            id(node.body[0].value)
            for node in nodes
            if isinstance(node, described) and ast.get_docstring(node) and isinstance(node.body[0], ast.Expr)
        }
        for node in nodes:
            for field in ("id", "attr", "arg", "name", "module"):
                if isinstance(name := getattr(node, field, None), str):
                    words |= set(name.split("."))
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
                words |= set(re.findall(r"[A-Za-z_]\w*", node.value))
    for pattern in ("*.toml", "*.yaml", "*.sh", "Makefile"):
        for path in tracked(pattern):
            words |= set(re.findall(r"[A-Za-z_]\w*", path.read_text(encoding="utf-8")))
    return frozenset(words)


def is_word(name: str) -> bool:
    """Whether a name is in the code, or is made there of a beginning and a number: ``weight_0``."""
    words = words_of_the_code()
    return name in words or f"{name.rpartition('_')[0]}_" in words


def files_of_modules() -> dict[str, Path]:
    """Every module of the package by its dotted name, as it is imported."""
    found = {}
    for path in [ROOT / "__init__.py", *(ROOT / "engine").rglob("*.py"), *(ROOT / "esh_scatter").rglob("*.py")]:
        parts = path.relative_to(ROOT).with_suffix("").parts
        parts = parts[:-1] if parts[-1] == "__init__" else parts
        found[".".join(("esh", *parts))] = path
    return found


@cache
def modules() -> dict[str, ast.Module]:
    """The same, parsed: not before a test asks, since every process that tests run in collects them all."""
    with without_collector():
        return {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in files_of_modules().items()}


def teardown_module() -> None:
    """Let go of the trees, which the collector would look through in all tests that follow."""
    modules.cache_clear()
    names_of.cache_clear()


def defined_in(body: list[ast.stmt]) -> dict[str, ast.stmt]:
    """What the statements of a module or class define or import, by name."""
    names: dict[str, ast.stmt] = {}
    for node in body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names[node.name] = node
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            names |= {(alias.asname or alias.name): node for alias in node.names}
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {target.id: node for target in targets if isinstance(target, ast.Name)}
        elif isinstance(node, ast.If):
            names |= defined_in(node.body)
    return names


@cache
def names_of(module: str) -> dict[str, ast.stmt]:
    """What a module defines or imports."""
    return defined_in(modules()[module].body)


def attributes_of(cls: ast.ClassDef) -> set[str]:
    """Methods, fields, and what methods set on ``self``."""
    set_there = {
        node.attr
        for node in ast.walk(cls)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "self"
    }
    return set(defined_in(cls.body)) | set_there


def exists(target: str) -> bool:
    """Whether a dotted name is that of a module, or of something in one, or of an attribute of a class in one."""
    parts = target.split(".")
    for cut in range(len(parts), 0, -1):
        module = ".".join(parts[:cut])
        if module not in modules():
            continue
        rest = parts[cut:]
        if not rest:
            return True
        node = names_of(module).get(rest[0])
        if node is None:
            return False
        return len(rest) == 1 or not isinstance(node, ast.ClassDef) or rest[1] in attributes_of(node)
    return False


def candidates(target: str, module: str) -> list[str]:
    """What a reference in a module may mean: as Sphinx looks, in the module first."""
    if not target.startswith("."):
        return [target, f"{module}.{target}", f"esh.{target}"]
    package = module.rpartition(".")[0]
    folders = [package, *(name for name in modules() if name.startswith(f"{package}."))]
    return [f"{folder}{target}" for folder in (*folders, "esh", *modules())]


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_pages_name_what_there_is(path: Path):
    text = re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    for token in re.findall(r"`([^`\n]+)`", text):
        bare = token.removesuffix("()")
        if not re.fullmatch(r"[A-Za-z_][\w.]*", bare) or bare in FOREIGN:
            continue
        if re.search(r"\.(py|md|toml|json|png|npz|csv|blend|parquet|cff|whl|txt)$", bare):
            continue
        if "_" in bare or re.search(r"[a-z][A-Z]", bare) or bare.endswith(".py"):
            missing = [part for part in bare.split(".") if part and not is_word(part)]
            assert not missing, f"{path.name} names `{token}`, and nothing in the code is called {missing[0]}"


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_pages_name_files_that_there_are(path: Path):
    names = {found.name for found in tracked("*.py")}
    folders = "|".join((*CODE, "docs"))
    for token in re.findall(r"`([\w./*-]+)`", path.read_text(encoding="utf-8")):
        if re.fullmatch(rf"(?:{folders})/[\w./*-]*", token):
            assert list(ROOT.glob(token.rstrip("/"))), f"{path.name} names {token}, which is not there"
        elif re.fullmatch(r"[\w/]+\.py", token):
            assert Path(token).name in names | OF_USERS, f"{path.name} names {token}, which is not there"


@pytest.mark.parametrize("module", sorted(files_of_modules()))
def test_references_of_docstrings_have_a_target(module: str):
    for node in ast.walk(modules()[module]):
        if not isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)):
            continue
        for target in re.findall(r":(?:func|class|meth|mod|data|attr):`~?!?([\w.]+)`", ast.get_docstring(node) or ""):
            known = any(exists(name) for name in candidates(target, module))
            # Short for an attribute of the class that is described, or of one of its bases.
            known = known or ("." not in target.lstrip(".") and target.lstrip(".") in words_of_the_code())
            own = target.lstrip(".").split(".")
            known = known or (len(own) == 2 and any(exists(f"{name}.{'.'.join(own)}") for name in modules()))
            assert known, f"{module} refers to {target}, which is not there"


# What points into a paper, and how a paper is named: authors and year.
INTO_A_PAPER = r"\b(?:sections?|equations?|eqs?\.|figures?) \d|\bthe paper\b|\bpaper's\b"
NAME_OF_A_PAPER = r"[A-Z][a-z]+ (?:et al\. )?(?:19|20)\d\d\b"


@pytest.mark.parametrize(
    "path",
    sorted(path for folder in ("engine", "esh_scatter", "benchmarks") for path in (ROOT / folder).rglob("*.py")),
    ids=lambda path: path.relative_to(ROOT).as_posix(),
)
def test_modules_that_point_into_a_paper_name_it(path: Path):
    text = path.read_text(encoding="utf-8")
    found = re.search(INTO_A_PAPER, text, re.IGNORECASE)
    if found is not None:
        line = text.count("\n", 0, found.start()) + 1
        named = re.search(NAME_OF_A_PAPER, ast.get_docstring(ast.parse(text)) or "")
        assert named, (
            f'{path.name}, line {line}: "{found[0]}" of which paper? Its module docstring must name authors and year'
        )


# One spelling for all that is read, the one of Blender's own interface: what of each word is British.
BRITISH = (
    r"colou[r]|\bgre[y]|cent[r]e|cent[r]ing\b|metr[e]s?\b|neighbou[r]|licenc[e]|favou[r]|behaviou[r]|fibr[e]|"
    r"(?:optim|minim|organ|normal|initial|vector|quant|recogn|summar)is(?:ed?|es|ing|ation)\b"
)
# What a library calls an argument, a public argument, and a mistake that a test makes.
NOT_OURS = r"\bgre[y]scale=|\bpixels_per_metr[e]|colou[r] = |\[2\]\.colou[r]"


@pytest.mark.parametrize(
    "path", [*PAGES, ROOT / "CHANGELOG.md", *tracked("*.py")], ids=lambda path: path.relative_to(ROOT).as_posix()
)
def test_words_are_spelled_as_in_blender(path: Path):
    text = re.sub(NOT_OURS, "", path.read_text(encoding="utf-8"))
    found = [line.strip() for line in text.splitlines() if re.search(BRITISH, line, re.IGNORECASE)]
    assert not found, f"{path.name} spells in two ways: {found[0]}"
