"""The example file opens with its settings and its result, and runs again."""

from __future__ import annotations

from pathlib import Path

import pytest

FILE = Path(__file__).parents[2] / "demo_scenes" / "example.blend"


@pytest.fixture
def extension():
    bpy = pytest.importorskip("bpy")
    import esh

    bpy.ops.wm.read_factory_settings(use_empty=True)
    esh.register()
    yield bpy
    esh.unregister()
    bpy.ops.wm.read_factory_settings(use_empty=True)


def test_it_opens_and_runs_again(extension):
    bpy = extension
    bpy.ops.wm.open_mainfile(filepath=str(FILE))
    (scatter,) = bpy.context.scene.esh_scatter.scatters
    assert [one.name for one in scatter.classes] == ["Pine", "Beech", "Bush"]
    assert scatter.obstacle(bpy.context.scene) is None and not scatter.left_out()
    count = len(scatter.result.data.vertices)
    assert count > 400
    scatter.seed += 1
    assert bpy.ops.esh.scatter() == {"FINISHED"}
    assert len(scatter.result.data.vertices) == pytest.approx(count, rel=0.02)


def test_it_is_made_by_its_script(extension, module, tmp_path):
    import esh

    # The script registers the extension by itself.
    esh.unregister()
    module("example").main(tmp_path / "example.blend")
    esh.register()
    extension.ops.wm.open_mainfile(filepath=str(tmp_path / "example.blend"))
    assert len(extension.context.scene.esh_scatter.scatters) == 1
