"""The one run that is under way in this Blender: its thread, timer and what the window shows of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import bpy

from ..targets.references import Reference
from .background_run import BackgroundRun
from .moving_bodies import MovingBodies
from .redrawing import redraw_sidebars

if TYPE_CHECKING:
    from ...engine.solver.progress import Progress

__all__ = ["end", "keep", "lets_through", "may_compile", "session", "start", "still_stopping", "stop"]

SIDEBAR_TAB = "ESH Scatter"

# Seconds between two looks at the run: short enough that Esc feels immediate, long enough to cost nothing.
_TICK = 0.05
# After drawing so many times as long without: a screen that is slow to draw leaves time to events, and the solver its processors.
_REST = 2.0
# Seconds without a first step after which the panel says what takes so long.
_PATIENCE = 3.0
# Seconds that disabling the add-on or quitting waits for the thread to come out of the engine.
_LONGEST_JOIN = 5.0
# Seconds that a run waits for one that was stopped to come out of the engine: compiling takes no longer.
_LONGEST_WAIT = 120.0

# Looking around is allowed during a run; changing anything is not.
_NAVIGATION = {
    "MOUSEMOVE",
    "INBETWEEN_MOUSEMOVE",
    "MIDDLEMOUSE",
    "WHEELUPMOUSE",
    "WHEELDOWNMOUSE",
    "WHEELINMOUSE",
    "WHEELOUTMOUSE",
    "TRACKPADPAN",
    "TRACKPADZOOM",
    "MOUSEROTATE",
    "MOUSESMARTZOOM",
    "NDOF_MOTION",
    "WINDOW_DEACTIVATE",
    "TIMER",
    "TIMER0",
    "TIMER1",
    "TIMER2",
    "TIMER_JOBS",
    "TIMER_REPORT",
    "TIMERREGION",
    "TIMER_AUTOSAVE",
}


class Session:
    """A run under way.

    Attributes:
        job: The API's job, whose ``write`` is called at the end, on the main thread; or a survey that comes before it.
        run: The thread.
        device: Where it runs, by the name that the engine gives it.
        stop_reason: Why it ends early, as a sentence; empty while it runs.
        keeps: Whether it ends early with what is there.
        bodies: What the viewport shows of it.
    """

    # When drawing was asked for that has not been looked at yet, and until when nothing is drawn [s].
    _asked: float | None = None
    _rests_until = 0.0

    def __init__(self, context: bpy.types.Context, job: Any) -> None:
        self.job = job
        self._scene = Reference(context.scene, "scene")
        # Of the scatter that is solved; what comes before a job has none yet.
        self._uid = context.scene.esh_scatter.active.own_uid() if hasattr(job, "write") else None
        self.device = str(getattr(job, "device", ""))
        self.stop_reason = ""
        self.keeps = False
        self.bodies = MovingBodies(job)
        before, solve = _still_at_work(), job.solve

        def solve_after_the_last(progress: Callable[[Progress], bool]) -> None:
            # Two solvers at once would share the processors; the one that was stopped may still be compiling.
            if before is not None:
                before.join(_LONGEST_WAIT)
            solve(lambda now: self._see(now, progress), self._ask)

        self.run = BackgroundRun(solve_after_the_last)
        self.timer = context.window_manager.event_timer_add(_TICK, window=context.window)
        self._shown = ""
        self.show()

    def _see(self, now: Progress, progress: Callable[[Progress], bool]) -> bool:
        """Look where bodies are, in the solver's thread; answer whether the run is to go on."""
        go_on = progress(now)
        if go_on:
            self.bodies.see(now)
        return go_on

    def _ask(self) -> None:
        """End the run if it was abandoned; its thread may be here before it has a name."""
        if "run" in vars(self):
            self.run.ask()

    @property
    def scatter(self) -> Any:
        """The settings that are solved, or None once they or their scene are no longer in the file."""
        scene = self._scene.find()
        return next((one for one in scene.esh_scatter.scatters if one.uid == self._uid), None) if scene else None

    @property
    def is_lost(self) -> bool:
        """Whether what the result would belong to was removed from the file, as a script can."""
        return self._scene.find() is None if self._uid is None else self.scatter is None

    @property
    def factor(self) -> float:
        """Share of the steps that are done, 0..1."""
        progress = self.run.progress
        return progress.step / max(progress.steps, 1) if progress else 0.0

    @property
    def text(self) -> str:
        """What is going on, in a few words."""
        progress = self.run.progress
        if self.keeps:
            return "Keeping what is there"
        if progress:
            # Footprints that still overlap are pushed apart then, which takes as long again where it is crowded.
            return f"Step {progress.step} of {progress.steps}" if progress.step < progress.steps else "Finishing"
        if still_stopping():
            return "Waiting for the stopped run"
        compiling = self.run.seconds >= _PATIENCE and may_compile(self.device)
        return "Compiling (first run only)" if compiling else "Preparing"

    def show(self) -> None:
        """Bring viewport, panel and status bar up to date where something changed; the next call comes once that has been drawn."""
        if self.run.progress:
            _ran_on.add(self.device)
        now = time.monotonic()
        if self._asked is not None:
            # What is drawn from one look to the next is quick enough.
            self._rests_until = now + _REST * max(0.0, now - self._asked - 2.0 * _TICK)
            self._asked = None
        if now < self._rests_until:
            return
        # What is kept moves no farther, and to draw it once more would hold up the result.
        if not self.keeps and self.bodies.show():
            self._asked = now
        if self._shown != self.text:
            self._shown, self._asked = self.text, now
            _set_status(f"ESH Scatter: {self.text}   |   Esc: stop without changes")
            redraw_sidebars()


def may_compile(device: str) -> bool:
    """Tell whether a run on a device may have to compile its kernels first: none has come to its first step, and none are prebuilt."""
    if device in _ran_on:
        return False
    from ...engine.device.prebuilt_gpu_kernels import are_prebuilt_for_gpus
    from ...engine.device.prebuilt_kernels import are_prebuilt

    return not (are_prebuilt() if device == "cpu" else are_prebuilt_for_gpus())


# Devices that a run has come to its first step on, in this process.
_ran_on: set[str] = set()
session: Session | None = None
_stopping: BackgroundRun | None = None


def start(context: bpy.types.Context, job: Any) -> None:
    """Begin solving ``job`` for the active scatter in the background: a ScatterJob, or what comes before it."""
    global session
    session = Session(context, job)
    for handlers in _interrupting():
        handlers.append(_interrupt)


def stop(reason: str) -> None:
    """Ask the run to end early; the operator reports ``reason`` at its next event."""
    if session is not None:
        session.run.abandon()
        session.stop_reason = session.stop_reason or reason


def keep() -> None:
    """Ask the run to end early, and take what is there for its result."""
    if session is not None:
        session.keeps = True
        session.run.stop()
        session.show()


def end(wait: bool = False) -> None:
    """Take away timer, status text and handlers, and let the thread go; ``wait`` for it to come to its end."""
    global session, _stopping
    ended, session = session, None
    for handlers in _interrupting():
        if _interrupt in handlers:
            handlers.remove(_interrupt)
    if ended is not None:
        ended.run.abandon()
        ended.bodies.end()
        _stopping = ended.run
        bpy.context.window_manager.event_timer_remove(ended.timer)
        _set_status(None)
        redraw_sidebars()
    if wait and _stopping is not None:
        _stopping.join(_LONGEST_JOIN)
    still_stopping()


def still_stopping() -> bool:
    """Tell whether the thread of a run that was stopped is still inside the engine (it may be compiling)."""
    global _stopping
    if _stopping is not None and not _stopping.running:
        # It holds all that the solver held, for its last progress.
        _stopping = None
    return _stopping is not None


def _still_at_work() -> BackgroundRun | None:
    """Return the run that was stopped and has not come to its end, or None."""
    return _stopping if still_stopping() else None


def lets_through(context: bpy.types.Context, event: bpy.types.Event) -> bool:
    """Tell whether ``event`` may reach the window: looking around, and the sidebar tab with its Stop button."""
    if event.type in _NAVIGATION or event.type.startswith("NUMPAD") or event.type.startswith("NDOF"):
        return True
    return event.type == "LEFTMOUSE" and _over_panel(context, event)


def _over_panel(context: bpy.types.Context, event: bpy.types.Event) -> bool:
    for area in context.screen.areas if context.screen else ():
        for region in area.regions if area.type == "VIEW_3D" else ():
            if (
                region.type == "UI"
                and region.active_panel_category == SIDEBAR_TAB
                and 0 <= event.mouse_x - region.x < region.width
                and 0 <= event.mouse_y - region.y < region.height
            ):
                return True
    return False


def _set_status(text: str | None) -> None:
    workspace = bpy.context.workspace
    if workspace is not None:
        workspace.status_text_set(text)


def _interrupting() -> tuple[list[Any], ...]:
    """Return what happens to a file that frees the data a job holds."""
    handlers = bpy.app.handlers
    return handlers.undo_pre, handlers.redo_pre, handlers.load_pre


def _interrupt(*_arguments: object) -> None:
    stop("Stopped, because the file changed during the run. Nothing was placed")
