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
LONGEST_WALK = 240.0
# How densely the sidebar is looked over, from the top down [pixels]; a row is 20 high.
DOWN = 14
# How far the header of a closed panel is above the next one [pixels].
HEADER = 26

_drawn: set[str] = set()
# What the mouse has passed in the sidebar, at shares of its width and so far below its upper edge [pixels]; and where headers were.
_passed: dict[float, dict[int, str]] = {}
# Where the first one is with a line of status above it, for a start.
_headers: dict[str, int] = {"ESH_PT_surface": 180}


def take(walks, stage, *, opening=steps.open_sidebar):
    """Open the sidebar, set the stage, and take walks one after the other."""
    limited = (steps.within(LONGEST_WALK, step_of(walk)) for walk in walks)
    steps.run([opening, stage, *((step, 0.02) for step in limited)])


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


def _heard(seconds):
    """Wait until Blender has done what mouse or keyboard have just told it: it asks timers first, and hears of that thereafter."""
    yield 0.0
    yield seconds


def _go(place, seconds):
    _do("mousemove", *place)
    yield from _heard(seconds)


def keys(*names):
    """Press keys one after the other, such as ``ctrl+z``."""
    for name in names:
        _do("key", name)
        yield from _heard(0.25)


def function_key(number):
    """Press F1 to F12, by the place on the keyboard: Blender does not hear xdotool's names of them."""
    _do("key", 66 + number if number <= 10 else 84 + number)
    yield from _heard(CLICK)


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
    yield from _heard(CLICK)


def move(place):
    """Move the mouse to a place on the screen: keys mean what they do there."""
    yield from _go(place, SURE)


def nudge(x, y):
    """Move the mouse by some pixels: while a number is dragged, Blender hides it, and puts it elsewhere."""
    _do("mousemove_relative", "--", x, y)
    yield from _heard(SURE)


def click(place, *modifiers, times=1):
    """Click with the mouse on a place on the screen."""
    yield from _go(place, HOVER)
    for name in modifiers:
        _do("keydown", name)
        yield from _heard(HOVER)
    _do("click", "--repeat", times, "--delay", 60, 1)
    for name in modifiers:
        yield from _heard(SURE)
        _do("keyup", name)
    yield from _heard(CLICK)


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


def sidebar():
    window, area, _ = steps.view()
    return window, area, next(one for one in area.regions if one.type == "UI")


def _below_mouse():
    """The Python command or the data path of the button of the sidebar below the mouse; an empty text where there is none."""
    window, area, region = sidebar()
    manager = bpy.context.window_manager
    with bpy.context.temp_override(window=window, area=area, region=region):
        for copy in (bpy.ops.ui.copy_python_command_button, bpy.ops.ui.copy_data_path_button):
            if copy.poll():
                manager.clipboard = ""
                copy()
                return manager.clipboard
    return ""


def _column(across):
    """Where a share of the sidebar's width is on the screen, and its upper and lower edge [pixels]."""
    window, _, region = sidebar()
    top = window.height - region.y - region.height
    return round(region.x + across * region.width), top, window.height - region.y - 4


def find(wanted, across=0.6, first=0):
    """Move the mouse down the sidebar onto the button whose command or data path contains a text; the generator returns where it is.

    Where the mouse has passed it before, it goes there first.

    Args:
        wanted: The text.
        across: Where the button is, as a share of the sidebar's width.
        first: How far below the sidebar's upper edge the mouse begins [pixels].
    """
    x, top, bottom = _column(across)
    first = max(first, 8)
    passed = _passed.setdefault(across, {})
    known = sorted(down for down, text in passed.items() if wanted in text and down >= first)
    for down in known[:2]:
        if (place := (yield from _surely(wanted, x, top + down))) is not None:
            return place
        del passed[down]
    seen = set()
    # A busy Blender overlooks moves of the mouse: a second time more slowly.
    for pause in (HOVER, SURE):
        for y in range(top + first, bottom, DOWN):
            yield from _go((x, y), pause)
            found = passed[y - top] = _below_mouse()
            seen.add(found)
            if wanted in found and (place := (yield from _surely(wanted, x, y))) is not None:
                return place
    raise LookupError(f"no button for {wanted}; there are {sorted(seen)}")


def _surely(wanted, x, y):
    """Make sure that the button that does this is here, and move onto it; or the mouse has just left it."""
    for place in ((x, y), (x, y - DOWN)):
        yield from _go(place, SURE)
        if wanted in _below_mouse():
            return place
    return None


def press(wanted, across=0.6, first=0, times=1):
    """Click on the button of the sidebar that does this; the generator returns where it is."""
    place = yield from find(wanted, across, first)
    yield from click(place, times=times)
    return place


def enter(wanted, text, across=0.6, first=0):
    """Type a text into a field of the sidebar in place of what it holds."""
    yield from press(wanted, across, first, times=2)
    yield from replace(text)


def replace(text):
    """Type a text into the field that is being edited, in place of all that is in it."""
    yield from keys("ctrl+a")
    yield from write(text)
    yield from keys("Return")


def choose(wanted, name, across=0.6, first=0):
    """Click on a field that holds something of the file, and choose what it is to hold by its name."""
    yield from press(wanted, across, first)
    yield 0.5
    yield from write(name)
    yield from keys("Return")
    yield 0.5


def watch_panels():
    """Have every panel of ours say when it is drawn: those that are open."""
    for panel in _panels():
        if hasattr(panel, "draw"):
            panel.draw = _watched(panel.draw, panel.__name__)


def _panels():
    """All panels of ours, from the uppermost to the lowest."""
    return steps.ours("sidebar.panels").CLASSES


def _watched(draw, name):
    def watched(self, context):
        _drawn.add(name)
        draw(self, context)

    return watched


def _open_panels():
    _, _, region = sidebar()
    _drawn.clear()
    region.tag_redraw()
    yield from until(lambda: _drawn, 10.0, "drawing the sidebar")
    return set(_drawn)


def turn_panel(name, is_open=True, first=120):
    """Open or close a panel by a click on its header; the generator returns how far below the sidebar's upper edge that is.

    Blender does not say which header is where, but a click on one shows whose it is, and so how far the one that is wanted is from it.
    """
    x, top, bottom = _column(0.62)
    before = yield from _open_panels()
    if (name in before) == is_open:
        # A line of status or two may have come above it since.
        return max(first, _headers.get(name, first) - 2 * HEADER)
    # Where others were the last time, then where it was itself: taken from the end.
    guesses = [down for other, place in _headers.items() for down in _below(other, name, before, place)]
    guesses += [_headers[name]] if name in _headers else []
    tried = set()
    rows = iter(range(first, bottom - top, DOWN))
    while (down := guesses.pop() if guesses else next(rows, None)) is not None:
        if down in tried or not (yield from _is_bare(x, top + down)):
            continue
        tried.add(down)
        yield from click((x, top + down))
        changed = (yield from _open_panels()) ^ before
        # With a panel, those in it close.
        turned = next((one.__name__ for one in _panels() if one.__name__ in changed), None)
        if turned is not None:
            # What was seen last comes last.
            _headers.pop(turned, None)
            _headers[turned] = down
        if turned == name:
            return down
        if turned is not None:
            yield from _turn_back((x, top + down), before)
            guesses += _below(turned, name, before, down)
    raise LookupError(f"no panel {name}; open are {sorted(before)}")


def _turn_back(place, panels):
    """Click on a header until these panels are open, and no others."""
    for _ in range(3):
        yield from click(place)
        deadline = time.time() + 3.0
        while time.time() < deadline:
            if (yield from _open_panels()) == panels:
                return
            yield 0.1
    raise TimeoutError(f"{sorted(panels)} are not all that is open")


def _is_bare(x, y):
    """Move the mouse to a place, and say whether no button is there that does anything."""
    yield from _go((x, y), HOVER)
    if _below_mouse():
        return False
    yield SURE
    return not _below_mouse()


def _below(known, wanted, is_open, down):
    """Where a header is, told from that of another one, if all panels between them are closed."""
    window, area, region = sidebar()
    with bpy.context.temp_override(window=window, area=area, region=region):
        names = [
            one.__name__
            for one in _panels()
            if getattr(one, "bl_parent_id", "ESH_PT_scatter") in is_open
            and (not hasattr(one, "poll") or one.poll(bpy.context))
        ]
    if known not in names or wanted not in names:
        return []
    begin, end = sorted((names.index(known), names.index(wanted)))
    if is_open.intersection(names[begin:end]):
        return []
    return [down + HEADER * (names.index(wanted) - names.index(known))]


def on_panel(top, lines):
    """A place so many lines below the header of a panel."""
    x, upper, _ = _column(0.6)
    return x, upper + top + round(23 * lines)


def upper_edge(wanted, first=0):
    """Find the button that does this; the generator returns its middle from left to right, and its upper edge on the screen."""
    x, y = yield from find(wanted, first=first)
    while wanted in _below_mouse():
        y -= 3
        yield from move((x, y))
    return x, y


def file_dialog():
    return next((one for one in bpy.context.window_manager.windows[0].screen.areas if one.ui_type == "FILES"), None)


def name_file(name):
    """Type a name into the field at the lower edge of the dialog."""
    yield from click(_in_dialog("EXECUTE", 0.4))
    yield from replace(name)
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
