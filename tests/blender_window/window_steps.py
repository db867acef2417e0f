"""What scripts that drive a windowed Blender share: its areas, screenshots, the mouse, and steps one after the other."""

import json
import shutil
import subprocess
import sys
import time
import traceback
from pathlib import Path

import bpy

ZIP, FOLDER, DRIVER, *ARGUMENTS = sys.argv[sys.argv.index("--") + 1 :]
FOLDER = Path(FOLDER)

# It would take the first click, or the first drag.
bpy.context.preferences.view.show_splash = False

# Without xdotool there is no hand.
answer = {"blender": bpy.app.version_string, "mouse": shutil.which("xdotool") is not None}
# How often the viewport has been drawn.
_draws = [0]


def view():
    """The 3D viewport's window, area and region."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    return window, area, next(region for region in area.regions if region.type == "WINDOW")


def window_context():
    window, area, region = view()
    return bpy.context.temp_override(window=window, area=area, region=region)


def remove_objects():
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)


def open_asset_browser(share):
    """Split the viewport: an asset browser has this share of its width."""
    with window_context():
        areas = bpy.context.window.screen.areas
        before = list(areas)
        bpy.ops.screen.area_split(direction="VERTICAL", factor=share)
        next(one for one in areas if one not in before).ui_type = "ASSETS"


def asset_browser():
    """The area that is one; None where there is none."""
    areas = bpy.context.window_manager.windows[0].screen.areas
    return next((one for one in areas if one.ui_type == "ASSETS"), None)


def take_screenshot(name):
    path = str(FOLDER / name)
    if shutil.which("import"):
        subprocess.run(["import", "-window", "root", path], check=True)
    else:
        bpy.ops.screen.screenshot(filepath=path)


def take_screenshot_aside(name):
    """Take one while Blender goes on, where that is possible."""
    if shutil.which("import"):
        subprocess.Popen(["import", "-window", "root", str(FOLDER / name)])


def ours(name):
    """A module of the extension."""
    return next(module for full, module in sys.modules.items() if full.endswith(f".esh_scatter.{name}"))


def install():
    if ZIP != "-":
        bpy.ops.extensions.package_install_files(
            filepath=ZIP, repo="user_default", enable_on_install=True, overwrite=True
        )
    elif "bl_ext.user_default.esh_scatter" not in bpy.context.preferences.addons:
        bpy.ops.preferences.addon_enable(module="bl_ext.user_default.esh_scatter")


def open_sidebar():
    with window_context():
        bpy.context.area.spaces.active.show_region_ui = True
        bpy.ops.screen.screen_full_area()


def show_tab():
    """Turn the sidebar to this extension's tab."""
    _, area, _ = view()
    next(region for region in area.regions if region.type == "UI").active_panel_category = "ESH Scatter"


def on_screen(x, y):
    """Where on the screen a place in the viewport is, in pixels from the upper left."""
    window, _, region = view()
    return round(region.x + x), round(window.height - (region.y + y))


def drag(way, seconds):
    """Drag the mouse along places on the screen, in a process of its own, while Blender goes on."""
    pause = seconds / len(way)
    moves = "; ".join(f"xdotool mousemove {x} {y}; sleep {pause:.3f}" for x, y in way[1:])
    (x, y) = way[0]
    return subprocess.Popen(
        [
            "sh",
            "-c",
            f"xdotool mousemove {x} {y}; sleep 0.5; xdotool mousedown 1; sleep 0.1; {moves}; xdotool mouseup 1",
        ]
    )


def end():
    answer["done"] = True
    write()
    bpy.ops.wm.quit_blender()


def write():
    (FOLDER / "answer.json").write_text(json.dumps(answer), encoding="utf-8")


def within(seconds, step):
    """Return a step that fails once it has answered False for so long."""
    deadline = []

    def limited():
        deadline[:] = deadline or [time.time() + seconds]
        if time.time() > deadline[0]:
            raise TimeoutError(f"{step.__name__} took longer than {seconds:g} s")
        return step()

    limited.__name__ = step.__name__
    return limited


def redrawn():
    """Return a step that is done once the window has been drawn twice: the first time may still change what is where."""
    until = []

    def waited():
        until[:] = until or [_draws[0] + 2]
        for area in bpy.context.window_manager.windows[0].screen.areas:
            area.tag_redraw()
        return _draws[0] >= until[0]

    return within(30.0, waited)


def _count_draw():
    _draws[0] += 1


def fail():
    """Say what has just been raised, and end."""
    answer["error"] = traceback.format_exc()
    take_screenshot("error.png")
    write()
    bpy.ops.wm.quit_blender()


def run(steps, *, by_hand=True):
    """Install the extension, take steps, and end.

    Each step is followed by so many seconds, or else by what it takes to draw the window anew; one that returns False is asked again.
    What is done by hand is left out where there is none.
    """
    bpy.types.SpaceView3D.draw_handler_add(_count_draw, (), "WINDOW", "POST_PIXEL")
    queue = [(redrawn(), 0.5)]
    for step in (install, *(steps if answer["mouse"] or not by_hand else ()), end):
        queue += [step] if isinstance(step, tuple) else [(step, 0.05), (redrawn(), 0.05)]

    def next_step():
        step, wait = queue[0]
        try:
            if step() is not False:
                queue.pop(0)
        except Exception:
            fail()
            return None
        return wait if queue else None

    # Another file may be opened meanwhile.
    bpy.app.timers.register(next_step, first_interval=0.1, persistent=True)
