"""Runs inside a windowed Blender: how long scattering takes from the click to the result, and how long the window stands still.

Says it for 1,000 trees, which have run once before, and for 100,000. Drawing counts, too: where a screen is drawn in software, that is
most of it, and all processors that it takes the solver lacks. So 100,000 are scattered again while the view shows the ground alone.
"""

import time
from functools import wraps
from itertools import pairwise

import bpy
import window_steps as steps
from window_steps import answer

LONGEST_RUN = 90.0
# Number of trees, and the length of the ground's side [m]; the first runs once before it is looked at.
RUNS = {"warm": (1_000, 60.0), "thousand": (1_000, 60.0), "many": (100_000, 600.0), "undrawn": (100_000, 600.0)}


class Watch:
    """When the window was alive, and what of its time went into this extension.

    Attributes:
        ticks: When a timer was called [s].
        own: Processor time of the longest of the operator's calls, by their names [s].
        invoked: When the button was pressed [s], and how much processor time all threads had used by then [s].
        shown: The same of the result.
    """

    def __init__(self, name):
        self.name, self.ticks, self.own = name, [], {}
        self.invoked = self.shown = None
        self.done = False
        bpy.app.timers.register(self.look, first_interval=0.0)

    def look(self):
        self.ticks.append(time.perf_counter())
        scatter = bpy.context.scene.esh_scatter.active
        if self.shown is None and scatter.result is not None and scatter.report_json:
            self.shown = self.ticks[-1], time.process_time()
        # A moment longer: the result is drawn only then.
        self.done = self.shown is not None and self.ticks[-1] > self.shown[0] + 3.0
        return None if self.done else 0.0


watch = None


def _spent(name, start):
    if watch is not None:
        watch.own[name] = max(watch.own.get(name, 0.0), time.thread_time() - start)


def _timed(method, name):
    @wraps(method)
    def timed(self, *arguments):
        start = time.thread_time()
        found = method(self, *arguments)
        _spent(name, start)
        return found

    return timed


def watch_operators():
    """Have the operator say how long the window waits for it."""
    operator = steps.ours("operators.run_operator").RunOperator
    invoke, modal = _timed(operator.invoke, "invoke"), _timed(operator.modal, "modal")

    # Blender looks how many arguments these two are written with.
    def timed_invoke(self, context, event):
        watch.invoked = time.perf_counter(), time.process_time()
        return invoke(self, context, event)

    def timed_modal(self, context, event):
        return modal(self, context, event)

    operator.invoke, operator.modal = timed_invoke, timed_modal
    operator._write, operator._finish = _timed(operator._write, "write"), _timed(operator._finish, "finish")


def fill_in(name):
    count, side = RUNS[name]

    def filled():
        with steps.window_context():
            steps.show_tab()
            steps.remove_objects()
            while bpy.context.scene.esh_scatter.scatters:
                bpy.context.scene.esh_scatter.scatters.remove(0)
            bpy.ops.mesh.primitive_cone_add(vertices=6, radius1=0.5, depth=2.0, location=(0.0, 0.0, -50.0))
            tree = bpy.context.object
            bpy.ops.mesh.primitive_grid_add(size=side, x_subdivisions=50, y_subdivisions=50)
            scatter = bpy.context.scene.esh_scatter.add_scatter(bpy.context.object)
            body_class = scatter.add_class()
            body_class.name = "Tree"
            body_class.sizes[0].source_object, body_class.sizes[0].count = tree, count
            scatter.device = "CPU"
            bpy.ops.view3d.view_axis(type="TOP")
            bpy.ops.view3d.view_selected()
            if name == "undrawn":
                # What is made from now on is not shown here.
                bpy.ops.view3d.localview(frame_selected=False)

    return filled


def press(name):
    def pressed():
        global watch
        watch = Watch(name)
        with steps.window_context():
            bpy.ops.esh.scatter("INVOKE_DEFAULT")

    return pressed


def seen():
    if not watch.done:
        return False
    steps.take_screenshot(f"times-{watch.name}.png")
    during = [at for at in watch.ticks if watch.invoked[0] <= at <= watch.shown[0] + 1.0]
    gaps = [b - a for a, b in pairwise(during)]
    answer[watch.name] = {
        "to_result": watch.shown[0] - watch.invoked[0],
        "processors": watch.shown[1] - watch.invoked[1],
        "solving": bpy.context.scene.esh_scatter.active.report["seconds"],
        "placed": len(bpy.context.scene.esh_scatter.active.result.data.vertices),
        "own": watch.own,
        "gaps": sorted(gaps)[-8:],
        "over": sum(1 for gap in gaps if gap > 0.1),
    }
    return True


steps.run(
    [
        steps.open_sidebar,
        watch_operators,
        *(
            step
            for name in RUNS
            for step in (fill_in(name), (press(name), 0.5), (steps.within(LONGEST_RUN, seen), 0.5))
        ),
    ],
    by_hand=False,
)
