"""What is evaluated is asked for in one place, beside threads that work in Python as well."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("bpy")

BLENDERS_SIDE = Path(__file__).resolve().parents[2] / "esh_scatter"
SCRIPT = """
import os
import threading
import time

import bpy
from esh.esh_scatter.targets.depsgraph import evaluated_depsgraph

bpy.ops.wm.read_homefile(use_empty=True)
bpy.ops.mesh.primitive_grid_add(x_subdivisions=40, y_subdivisions=40)
item = bpy.context.object
item.modifiers.new("Smooth", "SUBSURF")


def work():
    while True:
        for number in range(2000):
            str(number)
        time.sleep(0.0001)


for _ in range(2):
    threading.Thread(target=work, daemon=True).start()
until = time.monotonic() + 5.0
# A crash comes within a second.
with bpy.context.temp_override(scene=bpy.context.scene):
    while time.monotonic() < until:
        item.location.x += 0.01
        item.data.vertices[0].co.x += 0.01
        item.data.update()
        evaluated = item.evaluated_get(evaluated_depsgraph(bpy.context))
        assert abs(evaluated.location.x - item.location.x) < 1e-6
        assert len(evaluated.data.vertices) > 6000
print("still there", flush=True)
# Some of Blender's own threads may hold up the end.
os._exit(0)
"""


def test_threads_of_others_may_work_while_it_is_evaluated():
    finished = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=120)
    assert "still there" in finished.stdout, (finished.returncode, finished.stderr[-1000:])


def test_it_is_asked_for_nowhere_else():
    assert not [p for p in BLENDERS_SIDE.rglob("*.py") if "evaluated_depsgraph_get" in p.read_text(encoding="utf-8")]


def test_a_scene_of_which_nothing_was_evaluated_is():
    import bpy
    from esh.esh_scatter.targets.depsgraph import evaluated_depsgraph

    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.data.scenes.new("Other")
    scene.collection.objects.link(bpy.data.objects.new("Here", None))
    bpy.data.objects["Here"].location.z = 2.0
    with bpy.context.temp_override(scene=scene):
        depsgraph = evaluated_depsgraph(bpy.context)
    assert depsgraph.scene.name == "Other"
    assert bpy.data.objects["Here"].evaluated_get(depsgraph).matrix_world.translation.z == 2.0


def test_what_has_changed_is_evaluated():
    import bpy
    from esh.esh_scatter.targets.depsgraph import evaluated_depsgraph

    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_cube_add()
    item = bpy.context.object
    item.location.z = 3.0
    depsgraph = evaluated_depsgraph(bpy.context)
    assert item.evaluated_get(depsgraph).matrix_world.translation.z == 3.0
    assert depsgraph.view_layer.name == bpy.context.view_layer.name
