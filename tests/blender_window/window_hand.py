"""Mouse and keyboard of a windowed Blender, as an artist uses them: finds buttons of the sidebar by what they do, and presses them.

Blender does not say where its buttons are. But it copies the Python command, or the data path, of the one below the mouse; so the
mouse is moved over the sidebar until it is the one wanted. Everything that takes time is a generator, which yields seconds to wait.
"""

import subprocess
import time
from contextlib import contextmanager

import bpy
import window_steps as steps

# Before a button is known to Blender that the mouse was moved onto, and before a click has done something [s].
HOVER, CLICK = 0.08, 0.4
# And before it is believed: a busy Blender may still mean the button that was left.
SURE = 0.3
# How densely the sidebar is looked over, from the top down [pixels]; a row is 20 high.
DOWN = 14

_drawn: set[str] = set()


def step_of(walk):
    """Return a step that goes through a generator."""
    state = {}

    def step():
        state.setdefault("walk", walk())
        if time.time() < state.get("until", 0.0):
            return False
        try:
            state["until"] = time.time() + next(state["walk"])
        except StopIteration:
            return True
        return False

    step.__name__ = walk.__name__
    return step


def until(done, seconds, what):
    """Wait until something is true."""
    deadline = time.time() + seconds
    while not done():
        if time.time() > deadline:
            raise TimeoutError(f"{what} took longer than {seconds:g} s")
        yield 0.05


def _do(*arguments):
    subprocess.run(["xdotool", *map(str, arguments)], check=True)


def keys(*names):
    """Press keys one after the other, such as ``ctrl+z``."""
    for name in names:
        _do("key", name)
        yield 0.25


def function_key(number):
    """Press F1 to F12, by the place on the keyboard: Blender does not hear xdotool's names of them."""
    _do("key", 66 + number if number <= 10 else 84 + number)
    yield CLICK


def search(text):
    """Find an entry of the menus by its name with F3, and choose it."""
    yield from function_key(3)
    yield 0.5
    yield from write(text)
    yield 0.5
    yield from keys("Return")


def write(text):
    """Type a text."""
    _do("type", "--delay", 60, text)
    yield CLICK


def move(place):
    """Move the mouse to a place on the screen: keys mean what they do there."""
    _do("mousemove", *place)
    yield SURE


def nudge(x, y):
    """Move the mouse by some pixels: while a number is dragged, Blender hides it, and puts it elsewhere."""
    _do("mousemove_relative", "--", x, y)
    yield SURE


def click(place, *modifiers, times=1):
    """Click with the mouse on a place on the screen."""
    _do("mousemove", *place)
    yield HOVER
    for name in modifiers:
        _do("keydown", name)
        yield HOVER
    _do("click", "--repeat", times, "--delay", 60, 1)
    for name in modifiers:
        yield SURE
        _do("keyup", name)
    yield CLICK


@contextmanager
def held(place):
    """Hold the mouse down, from a place on the screen on, while what is in the block goes on."""
    _do("mousemove", *place)
    time.sleep(HOVER)
    _do("mousedown", 1)
    try:
        yield
    finally:
        _do("mouseup", 1)


def _sidebar():
    window, area, _ = steps.view()
    return window, area, next(one for one in area.regions if one.type == "UI")


def _below_mouse():
    """The Python command or the data path of the button of the sidebar below the mouse; an empty text where there is none."""
    window, area, region = _sidebar()
    manager = bpy.context.window_manager
    with bpy.context.temp_override(window=window, area=area, region=region):
        for copy in (bpy.ops.ui.copy_python_command_button, bpy.ops.ui.copy_data_path_button):
            if copy.poll():
                manager.clipboard = ""
                copy()
                return manager.clipboard
    return ""


def find(wanted, across=0.6, first=0):
    """Move the mouse down the sidebar onto the button whose command or data path contains a text; the generator returns where it is.

    Args:
        wanted: The text.
        across: Where the button is, as a share of the sidebar's width.
        first: How far below the sidebar's upper edge the mouse begins [pixels].
    """
    window, _, region = _sidebar()
    top, bottom = window.height - region.y - region.height, window.height - region.y - 4
    x, seen = round(region.x + across * region.width), []
    # A busy Blender overlooks moves of the mouse: a second time more slowly.
    for pause in (HOVER, SURE):
        for y in range(top + max(first, 8), bottom, DOWN):
            _do("mousemove", x, y)
            yield pause
            found = _below_mouse()
            seen.append(found)
            # It may be the button that the mouse has just left.
            for back in (0, DOWN) if wanted in found else ():
                _do("mousemove", x, y - back)
                yield SURE
                if wanted in _below_mouse():
                    return x, y - back
    raise LookupError(f"no button for {wanted}; there are {sorted(set(seen))}")


def press(wanted, across=0.6, first=0, times=1):
    """Click on the button of the sidebar that does this; the generator returns where it is."""
    place = yield from find(wanted, across, first)
    yield from click(place, times=times)
    return place


def watch_panels():
    """Have every panel of ours say when it is drawn: those that are open."""
    for name in dir(bpy.types):
        panel = getattr(bpy.types, name)
        if name.startswith("ESH_PT_") and hasattr(panel, "draw"):
            panel.draw = _watched(panel.draw, name)


def _watched(draw, name):
    def watched(self, context):
        _drawn.add(name)
        draw(self, context)

    return watched


def _open_panels():
    _, _, region = _sidebar()
    _drawn.clear()
    region.tag_redraw()
    yield from until(lambda: _drawn, 10.0, "drawing the sidebar")
    return set(_drawn)


def turn_panel(name, is_open=True, first=120):
    """Open or close a panel by a click on its header; the generator returns how far below the sidebar's upper edge that is."""
    window, _, region = _sidebar()
    top, bottom = window.height - region.y - region.height, window.height - region.y - 4
    x, before = round(region.x + 0.62 * region.width), (yield from _open_panels())
    if (name in before) == is_open:
        return first
    for y in range(top + first, bottom, DOWN):
        _do("mousemove", x, y)
        yield HOVER
        if _below_mouse():
            continue
        yield SURE
        if _below_mouse():
            continue
        yield from click((x, y))
        now = yield from _open_panels()
        if (name in now) == is_open:
            return y - top
        if now != before:
            yield from click((x, y))
    raise LookupError(f"no panel {name}; open are {sorted(before)}")


def on_panel(top, lines):
    """A place so many lines below the header of a panel."""
    window, _, region = _sidebar()
    return round(region.x + 0.6 * region.width), window.height - region.y - region.height + top + round(23 * lines)


def file_dialog():
    return next((one for one in bpy.context.window_manager.windows[0].screen.areas if one.ui_type == "FILES"), None)


def name_file(name):
    """Type a name into the field at the lower edge of the dialog."""
    yield from click(_in_dialog("EXECUTE", 0.4))
    yield from keys("ctrl+a")
    yield from write(name)
    yield from keys("Return")
    yield 1.0


def confirm():
    """Click on the button beside the name."""
    yield from click(_in_dialog("EXECUTE", 0.95))
    yield from until(lambda: not file_dialog(), 20.0, "the export")
    yield 1.0


def _in_dialog(name, across):
    """A place halfway up a region of the dialog."""
    window = bpy.context.window_manager.windows[0]
    region = next(one for one in file_dialog().regions if one.type == name)
    return round(region.x + across * region.width), window.height - region.y - region.height // 2
