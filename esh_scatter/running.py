"""The one run that is under way in this Blender: its thread, timer and what the window shows of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy

from .background_run import BackgroundRun
from .references import Reference

if TYPE_CHECKING:
    from .api import ScatterJob
    from .properties.scatter import ESH_PG_scatter

__all__ = ["end", "lets_through", "may_compile", "session", "start", "still_stopping", "stop"]

SIDEBAR_TAB = "ESH Scatter"

# Seconds between two looks at the run: short enough that Esc feels immediate, long enough to cost nothing.
_TICK = 0.05
# Seconds without a first step after which the panel says what takes so long.
_PATIENCE = 3.0
# Seconds that disabling the add-on or quitting waits for the thread to come out of the engine.
_LONGEST_JOIN = 5.0

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
        job: The API's job; its ``write`` is called at the end, on the main thread.
        run: The thread.
        scatter_index: Which of the scene's scatters.
        device: Where it runs, by the name that the engine gives it.
        stop_reason: Why it ends early, as a sentence; empty while it runs.
    """

    def __init__(self, context: bpy.types.Context, job: ScatterJob, scatter: ESH_PG_scatter) -> None:
        self.job = job
        self._scene = Reference(context.scene, "scene")
        self.scatter_index = context.scene.esh_scatter.scatter_index
        self.steps = scatter.max_steps
        self.device = str(getattr(job, "device", ""))
        self.stop_reason = ""
        self.run = BackgroundRun(job.solve)
        self.timer = context.window_manager.event_timer_add(_TICK, window=context.window)
        self._shown = ""
        self.show()

    @property
    def scene(self) -> bpy.types.Scene:
        """The scene whose scatter it is; raises ProblemError once it is no longer in the file."""
        return self._scene.get()

    @property
    def factor(self) -> float:
        """Share of the steps that are done, 0..1."""
        progress = self.run.progress
        return progress.step / max(progress.steps, 1) if progress else 0.0

    @property
    def text(self) -> str:
        """What is going on, in a few words."""
        progress = self.run.progress
        if progress:
            return f"Step {progress.step} of {progress.steps}"
        compiling = self.run.seconds >= _PATIENCE and may_compile(self.device)
        return "Compiling (first run only)" if compiling else "Preparing"

    def show(self) -> None:
        """Bring panel and status bar up to date where something changed."""
        if self.run.progress:
            _ran_on.add(self.device)
        if self._shown != self.text:
            self._shown = self.text
            _set_status(f"ESH Scatter: {self.text}   |   Esc: stop without changes")
            redraw_sidebars()


def may_compile(device: str) -> bool:
    """Tell whether a run on a device may have to compile its kernels first: none has come to its first step, and none are prebuilt."""
    if device in _ran_on:
        return False
    from ..engine.device.prebuilt_kernels import are_prebuilt

    return device != "cpu" or not are_prebuilt()


# Devices that a run has come to its first step on, in this process.
_ran_on: set[str] = set()
session: Session | None = None
_stopping: BackgroundRun | None = None


def start(context: bpy.types.Context, job: ScatterJob, scatter: ESH_PG_scatter) -> None:
    """Begin solving ``job`` for ``scatter`` in the background."""
    global session
    session = Session(context, job, scatter)
    for handlers in _interrupting():
        handlers.append(_interrupt)


def stop(reason: str) -> None:
    """Ask the run to end early; the operator reports ``reason`` at its next event."""
    if session is not None:
        session.run.stop()
        session.stop_reason = session.stop_reason or reason


def end(wait: bool = False) -> None:
    """Take away timer, status text and handlers, and let the thread go; ``wait`` for it to come to its end."""
    global session, _stopping
    ended, session = session, None
    for handlers in _interrupting():
        if _interrupt in handlers:
            handlers.remove(_interrupt)
    if ended is not None:
        ended.run.stop()
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


def lets_through(context: bpy.types.Context, event: bpy.types.Event) -> bool:
    """Tell whether ``event`` may reach the window: looking around, and the sidebar tab with its Stop button."""
    if event.type in _NAVIGATION or event.type.startswith("NUMPAD") or event.type.startswith("NDOF"):
        return True
    return event.type == "LEFTMOUSE" and _over_panel(context, event)


def redraw_sidebars() -> None:
    """Have every 3D viewport's sidebar drawn anew."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()


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
