"""What tests of the demo scenes share."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

SCENES = Path(__file__).parents[2] / "demo_scenes"


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], ModuleType]]:
    """Import a module of the demo scenes, which are scripts and no package."""
    monkeypatch.syspath_prepend(str(SCENES))
    names = []

    def load(name: str) -> ModuleType:
        names.append(name)
        return importlib.import_module(name)

    yield load
    for name in names:
        sys.modules.pop(name, None)


@pytest.fixture
def blender_module(module: Callable[[str], ModuleType]) -> Callable[[str], ModuleType]:
    """As :func:`module`, where Blender is there: scenes that import it on their first lines."""
    pytest.importorskip("bpy")
    return module
