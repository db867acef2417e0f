"""The demo scenes and the README show what others can write: they use of esh only what is public."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import esh
import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = {path.relative_to(ROOT).as_posix(): path for path in sorted((ROOT / "demo_scenes").rglob("*.py"))}
CODE = {name: path.read_text(encoding="utf-8") for name, path in SCRIPTS.items()}
README = (ROOT / "README.md").read_text(encoding="utf-8")
CODE |= {
    f"README.md, script {number}": script
    for number, script in enumerate(re.findall(r"^```python\n(.*?)^```$", README, re.MULTILINE | re.DOTALL), 1)
}


def complaints(code: str) -> list[str]:
    """What of esh a script uses that is not public, or imports in another way than ``import esh``."""
    found = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            found += [
                alias.name
                for alias in node.names
                if alias.name.partition(".")[0] == "esh" and (alias.name, alias.asname) != ("esh", None)
            ]
        elif isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in {"esh", "bl_ext"}:
            found.append(node.module)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "esh":
            found += [] if node.attr in esh.__all__ else [f"esh.{node.attr}"]
    return found


@pytest.mark.parametrize("name", CODE)
def test_a_script_uses_the_public_interface_only(name: str):
    assert complaints(CODE[name]) == []


def test_what_is_not_public_is_found():
    code = (
        "import esh.engine\nimport esh as e\nfrom esh.engine.solve import solve\nimport esh\nesh.engine.solve\nesh.Size"
    )
    assert complaints(code) == ["esh.engine", "esh", "esh.engine.solve", "esh.engine"]
    assert any("esh." in code for code in CODE.values())
