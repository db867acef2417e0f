"""What all tests share: a Blender without the developer's settings, and markers that skip by themselves."""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile

import pytest

# Before anything imports bpy: Blender reads the folder once. Warp's kernel cache is left where it is, in the user's
# cache folder, so that kernels are compiled once and not once a run.
if "bpy" not in sys.modules:
    _blender_folder = tempfile.mkdtemp(prefix="esh-test-blender-")
    os.environ["BLENDER_USER_RESOURCES"] = _blender_folder
    atexit.register(shutil.rmtree, _blender_folder, ignore_errors=True)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip tests marked ``cuda`` where Warp sees no GPU."""
    marked = [item for item in items if item.get_closest_marker("cuda")]
    if marked:
        import warp as wp

        if not wp.is_cuda_available():
            for item in marked:
                item.add_marker(pytest.mark.skip(reason="no CUDA device on this machine"))
