"""Runs inside a windowed Blender: Tilt is dragged, and once the mouse is let go the status says how many lean into each other.

What happens is done with the mouse and the keyboard only, beside the scene at the start; what came of it is read. No report is: to ask
for one would have it counted.
"""

import time

import bpy
import window_hand as hand
import window_steps as steps
from window_scene import ask_for, begin, fill_in, on_screen, scatter, update
from window_steps import answer, take_screenshot

LONGEST_COUNT = 20.0

# How long the window was held up by reading what is counted [s].
_spent = [0.0]


def set_stage():
    """Beeches are high and stand close to each other."""
    fill_in()
    bpy.data.objects["Beech"].scale.z = 2.0
    counted = steps.ours("solving.counted_again")
    counted._begin = _timed(counted._begin)


def _timed(begin_count):
    def timed(asked):
        start = time.thread_time()
        found = begin_count(asked)
        _spent.append(time.thread_time() - start)
        return found

    return timed


def denser():
    yield from ask_for("220")
    yield from update()


def known():
    """How many counts are kept, and whether one is under way or asked for."""
    counted = steps.ours("solving.counted_again")
    busy = counted._going is not None or counted._asked or bpy.app.timers.is_registered(counted._look)
    return len(counted._known), bool(busy)


def leaning():
    """What is known of the result as it stands, without asking."""
    counted = steps.ours("solving.counted_again")
    number = counted.number_of(scatter().result, exactly=True)
    found = next((one for key, one in counted._known.items() if key.number == number), None)
    return None if found is None or found.leaning is None else found.leaning.pairs


def rest():
    """Away from the sidebar, until nothing is to be counted any more."""
    yield from hand.move(on_screen((0.0, 0.0, 0.0)))
    yield from hand.until(lambda: not known()[1], LONGEST_COUNT, "counting")
    yield 1.5
    yield from hand.until(lambda: not known()[1], LONGEST_COUNT, "counting")


def tilt_dragged():
    """The tilt of a class is dragged with the mouse: nothing is counted before it is let go."""
    top = yield from hand.turn_panel("ESH_PT_class")
    top = yield from hand.turn_panel("ESH_PT_density", is_open=False, first=top + 20)
    top = yield from hand.turn_panel("ESH_PT_standing", first=top)
    place = yield from hand.find(".tilt", first=top)
    yield from rest()
    answer["before"] = scatter().active_class.tilt, known()
    during = []
    with hand.held(place):
        for _ in range(12):
            yield from hand.nudge(60, 0)
            during.append((scatter().active_class.tilt, *known()))
        take_screenshot("lean-1-dragged.png")
    answer["during"] = during
    yield from hand.until(lambda: known()[0] > 0, LONGEST_COUNT, "the count")
    yield from rest()
    answer["dragged"] = scatter().active_class.tilt, leaning(), known()
    take_screenshot("lean-2-counted.png")


def undone_and_redone():
    yield from hand.keys("ctrl+z")
    yield from rest()
    answer["undone"] = scatter().active_class.tilt, known()
    yield from hand.keys("ctrl+shift+z")
    yield from rest()
    answer["redone"] = scatter().active_class.tilt, leaning(), known()


def sunk_by_typing():
    """An offset needs no new run: the status is that of the run, with what leans by now."""
    yield from hand.press("esh.scatter(")
    yield from hand.until(lambda: not scatter().changes() and not known()[1], 60.0, "the run")
    yield 1.0
    count = known()[0]
    yield from hand.enter(".offset", "0.3")
    yield from hand.until(lambda: known()[0] > count, LONGEST_COUNT, "the count")
    yield from rest()
    answer["sunk"] = scatter().changes(), leaning(), known()[0] - count
    answer["longest_reading"] = max(_spent)
    take_screenshot("lean-3-offset.png")


hand.take((begin, denser, tilt_dragged, undone_and_redone, sunk_by_typing), set_stage)
