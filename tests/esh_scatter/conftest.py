"""What tests of Blender's side share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture
def empty_file() -> Iterator[None]:
    """An empty file, with the extension registered."""
    bpy = pytest.importorskip("bpy")
    from esh.esh_scatter import registration

    bpy.ops.wm.read_homefile(use_empty=True)
    registration.register()
    yield
    registration.unregister()
