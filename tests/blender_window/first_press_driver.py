"""Runs inside a windowed Blender: Scatter Selection is pressed before anything that computes is loaded."""

import sys
import time

import bpy
import window_steps as steps
from window_steps import answer

LONGEST_RUN = 60.0


def press():
    with steps.window_context():
        steps.remove_objects()
        bpy.ops.mesh.primitive_cube_add(size=0.3, location=(0.0, 0.0, 5.0))
        stone = bpy.context.object
        bpy.ops.mesh.primitive_plane_add(size=20.0)
        stone.select_set(True)
        answer["loaded_before"] = "warp" in sys.modules
        start = time.perf_counter()
        bpy.ops.esh.scatter_selection("INVOKE_DEFAULT")
        answer["invoke"] = time.perf_counter() - start
    answer["first"] = type(steps.ours("solving.running").session.job).__name__


def done():
    scatter = bpy.context.scene.esh_scatter.active
    if scatter is None or not scatter.report_json:
        return False
    answer["placed"] = len(scatter.result.data.vertices)
    return True


steps.run(
    [
        (press, 0.1),
        (steps.within(LONGEST_RUN, done), 0.3),
    ],
    by_hand=False,
)
