"""Runs inside a windowed Blender: install the zip, fill in the sidebar, press Scatter, take a screenshot, say what happened.

Arguments after ``--``: the zip, the folder for the answers.
"""

import json
import shutil
import subprocess
import sys
import time
import traceback
from pathlib import Path

import bpy

ZIP, FOLDER = (Path(argument) for argument in sys.argv[sys.argv.index("--") + 1 :][:2])
LONGEST_RUN = 60.0


def window_context():
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return bpy.context.temp_override(window=window, area=area, region=region)


def take_screenshot(name):
    path = str(FOLDER / name)
    if shutil.which("import"):
        subprocess.run(["import", "-window", "root", path], check=True)
    else:
        bpy.ops.screen.screenshot(filepath=path)


def install():
    bpy.ops.extensions.package_install_files(
        filepath=str(ZIP), repo="user_default", enable_on_install=True, overwrite=True
    )


def open_sidebar():
    with window_context():
        bpy.context.area.spaces.active.show_region_ui = True
        bpy.ops.screen.screen_full_area()


def fill_in():
    with window_context():
        region = next(region for region in bpy.context.area.regions if region.type == "UI")
        region.active_panel_category = "ESH Scatter"
        bpy.ops.mesh.primitive_grid_add(size=20, x_subdivisions=20, y_subdivisions=20)
        bpy.context.object.name = "Ground"
        bpy.ops.esh.scatter_add()
        scatter = bpy.context.scene.esh_scatter.active
        for name, add, count in (
            ("Pine", bpy.ops.mesh.primitive_cone_add, 120),
            ("Beech", bpy.ops.mesh.primitive_ico_sphere_add, 80),
        ):
            add(location=(30.0, 0.0, 0.0), scale=(0.4, 0.4, 0.4))
            bpy.context.object.name = name
            bpy.ops.esh.class_add()
            made = scatter.active_class
            made.name = name
            made.sizes[0].source_object, made.sizes[0].count = bpy.context.object, count
        bpy.ops.object.select_all(action="DESELECT")


def press():
    with window_context():
        take_screenshot("before.png")
        answer["pressed"] = sorted(bpy.ops.esh.scatter("INVOKE_DEFAULT"))
    answer["deadline"] = time.time() + LONGEST_RUN


def finished():
    scatter = bpy.context.scene.esh_scatter.active
    if scatter.result is None and time.time() < answer["deadline"]:
        return False
    answer["points"] = len(scatter.result.data.vertices) if scatter.result else 0
    depsgraph = bpy.context.evaluated_depsgraph_get()
    answer["instances"] = sum(1 for one in depsgraph.object_instances if one.is_instance)
    answer["report"] = scatter.report
    return True


def look():
    with window_context():
        take_screenshot("after.png")


def end():
    answer["done"] = True
    write()
    bpy.ops.wm.quit_blender()


def write():
    (FOLDER / "answer.json").write_text(json.dumps(answer), encoding="utf-8")


# Each with the seconds to wait afterwards, so that the window is drawn; one that returns False is asked again.
STEPS = [(install, 2.0), (open_sidebar, 2.0), (fill_in, 3.0), (press, 0.5), (finished, 3.0), (look, 0.5), (end, 1.0)]
answer = {"blender": bpy.app.version_string}


def next_step():
    step, wait = STEPS[0]
    try:
        if step() is not False:
            STEPS.pop(0)
    except Exception:
        answer["error"] = traceback.format_exc()
        write()
        bpy.ops.wm.quit_blender()
        return None
    return wait if STEPS else None


bpy.app.timers.register(next_step, first_interval=2.0)
